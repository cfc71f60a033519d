"""Counts the instructions that a processor executes in a call of a function, one by one under QEMU."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from strapgen.ir.exceptions import CompilerError
from strapgen.lab.cost import bare_metal
from strapgen.lab.cost.processors import Processor

#: Longest time in s that a call may take in the emulator.
_PATIENCE = 60

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


def executed(
    processor: Processor, flags: Sequence[str], binary: Path, function: str, declarations: str, call: str
) -> int | None:
    """Return the number of instructions from the entry of a function to its return."""
    if not processor.emulator or shutil.which(processor.emulator[0]) is None:
        return None
    folder = binary.parent
    bare_metal.write_start(processor, folder, _MAIN.format(declarations=declarations, call=call), "main.c")
    command = [processor.compiler, *processor.flags, *flags, *bare_metal.LINKING]
    # Roots and sines of floating point; integers need nothing but what the compiler brings.
    library = ["-lm", "-lc"] if any(flag.startswith("--specs") for flag in flags) else []
    libraries = ["-Wl,--start-group", *library, "-lgcc", "-Wl,--end-group"]
    bare_metal.compiled([*command, "main.c", binary.name, *libraries, "-o", "program.elf"], folder)
    log = folder / "trace.log"
    one_by_one = ["-singlestep"] if _major_version(processor.emulator[0]) < 8 else ["-one-insn-per-tb"]
    command = [*processor.emulator, "-display", "none", "-serial", "none", "-monitor", "none", "-no-reboot"]
    command += ["-kernel", "program.elf", *one_by_one, "-d", "exec,nochain", "-D", log.name]
    try:
        subprocess.run(command, cwd=folder, capture_output=True, check=False, timeout=_PATIENCE)
    except subprocess.TimeoutExpired:
        raise CompilerError(
            f"{processor.emulator[0]}: {function} has not returned in {_PATIENCE} s"
        ) from None
    return _counted(log, _addresses(processor, folder / "program.elf"), function)


def _counted(log: Path, places: dict[str, tuple[int, int]], function: str) -> int:
    """Return how many instructions of a trace lie between the entry of a function and the next one of its caller."""
    (entry, _), (first, size), (refused, _) = places[function], places["start"], places["refuse"]
    count, inside, back = 0, False, False
    with log.open() as lines:
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
    listing = subprocess.run(command, cwd=program.parent, capture_output=True, text=True, check=True).stdout
    rows = [line.split() for line in listing.splitlines()]
    return {row[3]: (int(row[0], 16), int(row[1], 16)) for row in rows if len(row) == 4}


@cache
def _major_version(program: str) -> int:
    said = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout
    match = re.search(r"version (\d+)", said)
    return int(match[1]) if match else 0
