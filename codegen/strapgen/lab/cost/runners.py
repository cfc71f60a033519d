"""Runs C programs that report text on emulated processors, with and without an operating system."""

from __future__ import annotations

import re
import shlex
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from strapgen.ir.exceptions import CompilerError
from strapgen.lab.cost import bare_metal
from strapgen.lab.cost.processors import PROCESSORS, Processor

#: Longest time in s of a run.
_PATIENCE = 300
#: Flags of the compiler for all.
_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off")
#: QEMU answers a program that reports by semihosting, on its standard output.
_SEMIHOSTING = (
    *("-display", "none", "-serial", "none", "-monitor", "none", "-no-reboot"),
    *("-chardev", "stdio,id=said", "-semihosting-config", "enable=on,target=native,chardev=said"),
)
_COLOR = re.compile(r"\x1b\[[\d;]*m")
_PROGRAM = "./program.elf"
_BEGIN = """
int main(void);
void start(void);
__attribute__((noinline, used)) void start(void)
{
    (void)main();
    stop();
}
"""


@dataclass(frozen=True)
class Runner:
    """A processor on which a program with `main` can be run."""

    name: str
    #: The cross compiler and what chooses the processor
    compiler: tuple[str, ...]
    #: The emulator and its options; the program follows
    emulator: tuple[str, ...]
    #: Name of the emulator, and Debian's packages that bring compiler and emulator
    tool: str
    package: str
    #: The processor without an operating system or library; None where the compiler brings both
    bare: Processor | None = None

    @property
    def commands(self) -> tuple[str, str]:
        """The programs that it needs."""
        return self.compiler[0], self.emulator[0]

    def version(self) -> str:
        """Return the version of the emulator, and the compiler with its version."""
        return f"{_version(self.emulator[0])}, {self.compiler[0]} {_version(self.compiler[0])}".strip(", ")

    def run(self, folder: Path, sources: Sequence[str]) -> str:
        """Compile a program, run it and return what it reports."""
        flags, parts = list(_FLAGS), list(sources)
        if self.bare is not None:
            bare_metal.write_start(self.bare, folder, _BEGIN)
            flags += ["-ffreestanding", *bare_metal.LINKING]
            parts += [bare_metal.START, "-lgcc"]
        build = [*self.compiler, *flags, *parts, "-o", _PROGRAM]
        start = [*self.emulator, _PROGRAM]
        (folder / "run.sh").write_text(f"{shlex.join(build)} &&\n{shlex.join(start)}\n")
        bare_metal.compiled(build, folder)
        try:
            done = subprocess.run(
                start, cwd=folder, capture_output=True, stdin=subprocess.DEVNULL, timeout=_PATIENCE
            )
        except subprocess.TimeoutExpired:
            raise CompilerError(f"{self.emulator[0]}: the program has not ended in {_PATIENCE} s") from None
        return _COLOR.sub("", (done.stdout + done.stderr).decode(errors="replace"))


@cache
def _version(program: str) -> str:
    """Return the version that a program states; "" where it states none."""
    said = subprocess.run([program, "--version"], capture_output=True, text=True, check=False)
    match = re.search(r"(?:version |\) )(\d[\w.]*)", said.stdout)
    return match[1] if match else ""


def _bare(name: str, package: str) -> Runner:
    processor = PROCESSORS[name]
    compiler = (processor.compiler, *processor.flags)
    return Runner(name, compiler, (*processor.emulator, *_SEMIHOSTING, "-kernel"), "QEMU", package, processor)


def _hosted(name: str, compiler: str, emulator: str, package: str) -> Runner:
    return Runner(name, (compiler, "-static"), (emulator,), "QEMU", package)


_ARM = "gcc-arm-none-eabi qemu-system-arm"
#: Processors by name.
RUNNERS = {
    runner.name: runner
    for runner in (
        *(_bare(core, _ARM) for core in ("cortex-m0", "cortex-m3", "cortex-m4", "cortex-m7")),
        _bare("rv32imc", "gcc-riscv64-unknown-elf qemu-system-misc"),
        Runner(
            "avr",
            ("avr-gcc", *PROCESSORS["avr"].flags),
            ("simavr", "-m", "atmega2560", "-f", "16000000"),
            "simavr",
            "gcc-avr avr-libc simavr",
        ),
        _hosted(
            "powerpc",
            "powerpc-linux-gnu-gcc",
            "qemu-ppc",
            "gcc-powerpc-linux-gnu libc6-dev-powerpc-cross qemu-user",
        ),
        _hosted(
            "i686", "i686-linux-gnu-gcc", "qemu-i386", "gcc-i686-linux-gnu libc6-dev-i386-cross qemu-user"
        ),
    )
}
