"""Processors of microcontrollers: how C is compiled for them, runs on them in an emulator, and is counted."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

from strapgen.ir.exceptions import CompilerError

#: Asks for a reset, at which the emulator ends.
_RESET = (0xE000ED0C, 0x05FA0004)

_VECTORS = """
extern char stack_top[];
void start(void);
__attribute__((section(".start"), used)) void *const vectors[2] = {(void *)stack_top, (void *)start};
"""
_ENTRY = """
__asm__(".section .start,\\"ax\\"\\n.globl entry\\nentry: la sp, stack_top\\n call start\\n1: j 1b\\n.text\\n");
"""
_START = """
#include <stddef.h>
#include <stdint.h>
{start}
/* What compilers call even where there is no library. */
void *memcpy(void *to, const void *from, size_t count);
void *memcpy(void *to, const void *from, size_t count)
{{
    for (size_t k = 0; k < count; ++k)
        ((volatile char *)to)[k] = ((const char *)from)[k];
    return to;
}}
void *memset(void *to, int byte, size_t count);
void *memset(void *to, int byte, size_t count)
{{
    for (size_t k = 0; k < count; ++k)
        ((volatile char *)to)[k] = (char)byte;
    return to;
}}
/* Ends the emulator. */
void stop(void);
__attribute__((noinline, used)) void stop(void)
{{
    *(volatile uint32_t *)(uintptr_t){address}u = {word}u;
    for (;;) {{
    }}
}}
"""
_LAYOUT = """
SECTIONS
{{
    . = {code};
    .start : {{ KEEP(*(.start)) }}
    .text : {{ *(.text*) *(.rodata*) *(.srodata*) }}
    .ARM.exidx : {{ *(.ARM*) }}
    . = {data};
    .data : {{ *(.data*) *(.sdata*) *(.bss*) *(.sbss*) *(COMMON) }}
    . = ALIGN(16);
    . += 0x1800;
    stack_top = .;
}}
"""
#: Flags that link a program without a library; `layout.ld` says where its parts lie.
LINKING = ("-nostartfiles", "-nostdlib", "-T", "layout.ld", "-Wl,--no-warn-rwx-segments")

#: Name of the source of the start.
START = "start.c"

#: Longest time in s that an emulated call may take, and that a program may run.
_CALL_PATIENCE, _PATIENCE = 60, 300

_MAIN = """
{declarations}
void refuse(void);
__attribute__((noinline, used)) void refuse(void)
{{
    __asm__ volatile("");
}}
void start(void);
__attribute__((noinline, used)) void start(void)
{{
    {call};
    stop();
}}
"""

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

_ARM = "gcc-arm-none-eabi qemu-system-arm"


@dataclass(frozen=True)
class Processor:
    """A processor, and the programs that compile for it and run its code."""

    #: Cross compiler, of the family of gcc
    compiler: str
    #: Flags that choose the processor
    flags: tuple[str, ...]
    #: QEMU with a machine of this processor; empty if it has none
    emulator: tuple[str, ...] = ()
    #: Addresses of the machine's memory for code, from which it starts, and for data
    code: int = 0
    data: int = 0
    #: "vectors" if it starts from a table of vectors, "code" if at the first instruction
    start: Literal["vectors", "code"] = "vectors"
    #: An address and a word: writing it there ends the emulator
    stop: tuple[int, int] = (0, 0)

    def tool(self, name: str) -> str:
        """Return the name of another program of the compiler's tools, as "objdump"."""
        return self.compiler.removesuffix("gcc") + name


def _cortex(core: str, machine: str, code: int = 0, data: int = 0x20000000) -> Processor:
    return Processor(
        "arm-none-eabi-gcc",
        (f"-mcpu={core}", "-mthumb", "-mfloat-abi=soft"),
        ("qemu-system-arm", "-M", machine),
        code,
        data,
        stop=_RESET,
    )


#: Processors by the names that ``strapgen cost --cpu`` takes.
PROCESSORS = {
    "cortex-m0": _cortex("cortex-m0", "microbit"),
    "cortex-m3": _cortex("cortex-m3", "mps2-an385"),
    "cortex-m4": _cortex("cortex-m4", "mps2-an386"),
    "cortex-m7": _cortex("cortex-m7", "mps2-an500"),
    "cortex-m33": _cortex("cortex-m33", "mps2-an505", 0x10000000, 0x38000000),
    "rv32imc": Processor(
        "riscv64-unknown-elf-gcc",
        ("-march=rv32imc", "-mabi=ilp32"),
        ("qemu-system-riscv32", "-M", "virt", "-bios", "none"),
        0x80000000,
        0x80100000,
        start="code",
        stop=(0x100000, 0x5555),
    ),
    "avr": Processor("avr-gcc", ("-mmcu=atmega2560",)),
}


def write_start(processor: Processor, folder: Path, rest: str, name: str = START) -> None:
    """Write C from which a processor starts, which calls ``start()``, and the layout of the memory.

    ``stop()`` ends the emulator.
    """
    address, word = processor.stop
    start = _VECTORS if processor.start == "vectors" else _ENTRY
    (folder / name).write_text(
        _START.format(start=start, address=address, word=word) + rest, encoding="utf-8", newline="\n"
    )
    (folder / "layout.ld").write_text(
        _LAYOUT.format(code=processor.code, data=processor.data), encoding="utf-8", newline="\n"
    )


def run_tool(command: Sequence[str], folder: Path) -> str:
    """Run a compiler or another of its tools in a folder, and return its output."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        lines = done.stderr.splitlines()
        errors = [line for line in lines if "error" in line or "undefined" in line]
        raise CompilerError(f"{command[0]} failed: {(errors or [done.stderr.strip()[:200]])[0]}")
    return done.stdout


@cache
def version(program: str) -> str:
    """Return the version that a program states; "" where it states none."""
    said = subprocess.run([program, "--version"], capture_output=True, text=True, check=False)
    match = re.search(r"(?:version |\) )(\d[\w.]*)", said.stdout)
    return match[1] if match else ""


def executed(
    processor: Processor, flags: Sequence[str], binary: Path, function: str, declarations: str, call: str
) -> int | None:
    """Return the number of instructions from the entry of a function to its return."""
    if not processor.emulator or shutil.which(processor.emulator[0]) is None:
        return None
    folder = binary.parent
    write_start(processor, folder, _MAIN.format(declarations=declarations, call=call), "main.c")
    command = [processor.compiler, *processor.flags, *flags, *LINKING]
    # Roots and sines of floating point; integers need nothing but what the compiler brings.
    library = ["-lm", "-lc"] if any(flag.startswith("--specs") for flag in flags) else []
    libraries = ["-Wl,--start-group", *library, "-lgcc", "-Wl,--end-group"]
    run_tool([*command, "main.c", binary.name, *libraries, "-o", "program.elf"], folder)
    log = folder / "trace.log"
    major = int(version(processor.emulator[0]).partition(".")[0] or 0)
    one_by_one = ["-one-insn-per-tb"] if major >= 8 else ["-singlestep"]
    command = [*processor.emulator, "-display", "none", "-serial", "none", "-monitor", "none", "-no-reboot"]
    command += ["-kernel", "program.elf", *one_by_one, "-d", "exec,nochain", "-D", log.name]
    try:
        subprocess.run(command, cwd=folder, capture_output=True, check=False, timeout=_CALL_PATIENCE)
    except subprocess.TimeoutExpired:
        raise CompilerError(
            f"{processor.emulator[0]}: {function} has not returned in {_CALL_PATIENCE} s"
        ) from None
    return _count(log, _addresses(processor, folder / "program.elf"), function)


def _count(log: Path, places: dict[str, tuple[int, int]], function: str) -> int:
    """Return how many instructions of a trace lie between the entry of a function and the next one of its caller."""
    (entry, _), (first, size), (refused, _) = places[function], places["start"], places["refuse"]
    count, inside, back = 0, False, False
    with log.open(encoding="utf-8", errors="replace") as lines:
        for line in lines:
            match = re.match(r"Trace \d+: \S+ \[[0-9a-f]+/([0-9a-f]+)/", line)
            if match is None:
                continue
            place = int(match[1], 16)
            if place == refused:
                raise CompilerError(f"{function} refuses the input with which it is measured")
            inside = inside or place == entry
            back = back or (inside and first <= place < first + size)
            count += inside and not back
    if back:
        return count
    raise CompilerError(f"the emulated processor did not come back from {function}")


def _addresses(processor: Processor, program: Path) -> dict[str, tuple[int, int]]:
    """Return address and size of every function of a program."""
    command = [processor.tool("nm"), "-S", program.name]
    rows = [line.split() for line in run_tool(command, program.parent).splitlines()]
    return {row[3]: (int(row[0], 16), int(row[1], 16)) for row in rows if len(row) == 4}


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
        return f"{version(self.emulator[0])}, {self.compiler[0]} {version(self.compiler[0])}".strip(", ")

    def run(self, folder: Path, sources: Sequence[str]) -> str:
        """Compile a program, run it and return its report."""
        flags, parts = list(_FLAGS), list(sources)
        if self.bare is not None:
            write_start(self.bare, folder, _BEGIN)
            flags += ["-ffreestanding", *LINKING]
            parts += [START, "-lgcc"]
        build = [*self.compiler, *flags, *parts, "-o", _PROGRAM]
        start = [*self.emulator, _PROGRAM]
        (folder / "run.sh").write_text(
            f"{shlex.join(build)} &&\n{shlex.join(start)}\n", encoding="utf-8", newline="\n"
        )
        run_tool(build, folder)
        try:
            done = subprocess.run(
                start, cwd=folder, capture_output=True, stdin=subprocess.DEVNULL, timeout=_PATIENCE
            )
        except subprocess.TimeoutExpired:
            raise CompilerError(f"{self.emulator[0]}: the program has not ended in {_PATIENCE} s") from None
        return _COLOR.sub("", (done.stdout + done.stderr).decode(errors="replace"))


def _bare(name: str, package: str) -> Runner:
    processor = PROCESSORS[name]
    compiler = (processor.compiler, *processor.flags)
    return Runner(name, compiler, (*processor.emulator, *_SEMIHOSTING, "-kernel"), "QEMU", package, processor)


def _hosted(name: str, compiler: str, emulator: str, package: str) -> Runner:
    return Runner(name, (compiler, "-static"), (emulator,), "QEMU", package)


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
