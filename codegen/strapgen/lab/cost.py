"""Measures generated C on microcontrollers: instructions, memory, and instructions executed in a call."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import ClassVar

from strapgen import catalogue, fixedpoint, pipeline
from strapgen.catalogue import Choice
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.read_only import ReadOnly
from strapgen.ir.signals import Signal
from strapgen.ir.sources import Sources
from strapgen.lab.processors import PROCESSORS, executed, run_tool, version
from strapgen.results.records import entry, reader_table
from strapgen.results.result import Result
from strapgen.results.table import TextTable
from strapgen.run.compiler import C_FLAGS, C, build_key
from strapgen.storage import cache as disk_cache
from strapgen.storage import drafts
from strapgen.targets import TARGETS

#: Flags of the compiler beside those of the processor.
FLAGS = ("-std=c99", "-O2", "-ffreestanding", "-ffp-contract=off")
_MULTIPLICATION = re.compile(r"f?mul\w*|ml[as]|[su]ml?a?[ls]?\w*l|[su]mul\w*|smm\w*")
#: The processor on which the whole catalogue is measured, and the kernels that are measured on every other.
REFERENCE, EVERYWHERE = "cortex-m3", ("euler-rk4-2", "dcm-rk4-2")
#: Part of its range that an argument of a measured call has.
_PART = 3

#: What stands above the table of the standard catalogue.
_HEAD = """# What the standard catalogue costs

Written by `strapgen cost --all --format markdown --out generated/COST.md`.

The kernels of `c_fixed/`, 32-bit fixed point for increments of up to 1/8 rad: all of them on a Cortex-M3, the steps of
fourth order on every processor. None of the processors is given a floating-point unit. `executed` are the instructions
of one call under QEMU, from the entry of the function to its return, for input inside its range; `stack` is that of the
function and of the deepest function of its file that it calls.
"""

#: Kind of cache entry that holds the size of object code, and its file.
_SIZES, _SIZE = "sizes", "size.txt"


@dataclass(frozen=True)
class Cost:
    """Size, stack and executed instructions of a kernel on a processor."""

    kernel: str = field(metadata=entry("kernel", align="<"))
    cpu: str = field(metadata=entry("cpu", align="<"))
    #: Instructions of the object code
    instructions: int = field(metadata=entry("instructions"))
    #: Instructions from the entry of the function to its return, for input inside its range; None without
    #: emulator
    executed: int | None = field(metadata=entry("executed"))
    #: Those of the instructions that multiply
    multiplications: int = field(metadata=entry("multiplications"))
    code_bytes: int = field(metadata=entry("code, B"))
    constant_bytes: int = field(metadata=entry("constants, B"))
    #: Stack of the function and of the deepest of the file's own functions that it calls, in bytes
    stack_bytes: int = field(metadata=entry("stack, B"))
    #: Compiler and version
    compiler: str


def cost(sources: Sources, cpu: str) -> Cost:
    """Compile the files of a step for a processor and measure them."""
    if not TARGETS[sources.target].compiled:
        raise InputError(f"sources for {sources.target} are not in C, which cost measures")
    processor = PROCESSORS[cpu]
    with drafts.temporary_folder() as folder:
        for file, text in sources.step_files.items():
            (folder / file).write_text(text, encoding="utf-8", newline="\n")
        source = folder / next(file for file in sources.step_files if file.endswith(".c"))
        flags = [*FLAGS, *_library(processor.compiler)]
        run_tool(
            [processor.compiler, *processor.flags, *flags, "-fstack-usage", "-c", source.name],
            folder,
        )
        binary = f"{source.stem}.o"
        listing = run_tool([processor.tool("objdump"), "-d", "--no-show-raw-insn", binary], folder)
        mnemonics = re.findall(r"^\s+[0-9a-f]+:\s+([a-z][\w.]*)", listing, flags=re.MULTILINE)
        sizes = run_tool([processor.tool("size"), "-A", binary], folder)
        return Cost(
            sources.kernel,
            cpu,
            len(mnemonics),
            executed(processor, flags, folder / binary, sources.function.name, *_call(sources)),
            sum(bool(_MULTIPLICATION.fullmatch(word.partition(".")[0])) for word in mnemonics),
            _section_bytes(sizes, ".text"),
            _section_bytes(sizes, ".rodata"),
            _stack(folder / f"{source.stem}.su", sources.function.name),
            f"{processor.compiler} {version(processor.compiler)}".strip(),
        )


def processors(cross: str | None = None, cpus: Sequence[str] = ()) -> list[str]:
    """Return the names of the requested processors, by default of all whose compiler is installed."""
    for cpu in cpus:
        checks.choice("cpu", cpu, PROCESSORS)
    if cross is not None:
        checks.choice("cross compiler", cross, dict.fromkeys(p.compiler for p in PROCESSORS.values()))
    names = [name for name in cpus or PROCESSORS if cross in (None, PROCESSORS[name].compiler)]
    if cpus and len(names) < len(cpus):
        other = next(name for name in cpus if name not in names)
        raise InputError(f"{cross} does not compile for {other}; {PROCESSORS[other].compiler} does")
    present = [name for name in names if shutil.which(PROCESSORS[name].compiler)]
    if not present or (cpus and present != names):
        needed = ", ".join(dict.fromkeys(PROCESSORS[name].compiler for name in names))
        raise InputError(f"no cross compiler for {', '.join(names)}: install {needed}")
    return present


def catalogue_costs(cpus: Sequence[str]) -> Iterator[Cost]:
    """Measure the standard catalogue in 32-bit fixed point, as it stands in ``generated/c_fixed``."""
    for cpu in sorted(cpus, key=lambda name: name != REFERENCE):
        for choice in catalogue.standard():
            if cpu != REFERENCE and choice.kernel not in EVERYWHERE:
                continue
            if fixedpoint.can_lower(pipeline.program(choice)):
                yield cost(pipeline.compile(choice, "c-fixed"), cpu)


def costs_of(
    choices: Iterable[Choice],
    target: str = "c-fixed",
    settings: Settings | None = None,
    cpus: Sequence[str] = (),
    cross: str | None = None,
) -> CostResult:
    """Measure kernels on processors, by default on all whose compiler is installed."""
    checks.choice("target", target, [name for name, entry in TARGETS.items() if entry.compiled])
    names = processors(cross, cpus)
    every = [pipeline.compile(choice, target, settings) for choice in choices]
    return CostResult([cost(sources, name) for sources in every for name in names])


@cache
def _library(compiler: str) -> list[str]:
    """Return the flags that find the headers of a C library, if there is one for the compiler."""
    command = [compiler, "-print-file-name=picolibc.specs"]
    place = subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
    return ["--specs=picolibc.specs"] if Path(place).is_absolute() else []


def _section_bytes(sizes: str, section: str) -> int:
    """Return the bytes of a section and of its parts."""
    rows = re.findall(rf"^{re.escape(section)}(?:\.\S*)?\s+(\d+)", sizes, flags=re.MULTILINE)
    return sum(map(int, rows))


def _stack(usage: Path, function: str) -> int:
    """Return the stack of a function and the deepest of the others in its file, which it calls."""
    rows = [line.split("\t") for line in usage.read_text(encoding="utf-8").splitlines()]
    depths = {row[0].rpartition(":")[2]: int(row[1]) for row in rows}
    depth = depths.pop(function)
    return depth + max(depths.values(), default=0)


def _call(sources: Sources) -> tuple[str, str]:
    """Return declarations of arguments inside their ranges, and a call with them, as C text."""
    lines = [f'#include "{sources.function.name}.h"']
    names = []
    fixed = {} if sources.fixed is None else {a.signal.name: a for a in sources.fixed.inputs}
    word = 0 if sources.fixed is None else sources.fixed.settings.word
    kind = f"int{word}_t" if word else TARGETS[sources.target].number
    for number, signal in enumerate(sources.function.inputs):
        if fixed:
            argument = fixed[signal.name]
            unit = float(argument.unit)
            scaled = [round(value / unit) for value in _values(signal, argument.high * unit)]
            values: Sequence[float] = [min(argument.high, integer) for integer in scaled]
        else:
            values = _values(signal, 0.01 * _PART if signal.bound is None else float(signal.bound))
        text = ", ".join(map(str, values))
        memory = f"int{fixed[signal.name].format.word}_t" if fixed else kind
        lines.append(f"{memory} argument_{number}[{signal.size}] = {{{text}}};")
        names.append(f"argument_{number}" + ("" if signal.shape or fixed else "[0]"))
    if sources.fixed is not None and sources.fixed.residuals:
        fresh = ", ".join(f"{feedback.fresh}u" for feedback in sources.fixed.residuals)
        lines.append(f"uint{word}_t feedback[{len(sources.fixed.residuals)}] = {{{fresh}}};")
        names.append("feedback")
    for number, signal in enumerate(sources.function.outputs):
        lines.append(f"{kind} result_{number}[{signal.size}];")
        names.append(f"result_{number}")
    call = f"{sources.function.name}({', '.join(names)})"
    return "\n".join(lines), f"if ({call} != 0) refuse()" if fixed else call


def _values(signal: Signal, largest: float) -> list[float]:
    """Return numbers that a signal may have: an attitude, or a part of the largest one with changing signs."""
    if signal.constraint == "unit":
        return [1 / math.sqrt(signal.size)] * signal.size
    if signal.constraint == "rotation":
        return [float(place % 4 == 0) for place in range(signal.size)]
    return [largest / _PART * (-1) ** place / (1 + place % 3) for place in range(signal.size)]


@dataclass(frozen=True)
class CostResult(ReadOnly, Result):
    """Size and execution of kernels on microcontrollers: a row for each kernel and processor."""

    rows_in = "costs"
    row: ClassVar[type | None] = Cost

    costs: Sequence[Cost]
    #: Whether they are all of the standard catalogue, which is a page in Markdown
    of_catalogue: bool = False

    __repr__ = short_repr

    def _in_words(self) -> str:
        return ", ".join(f"{one.kernel} on {one.cpu}: {one.instructions} instructions" for one in self.costs)

    def table(self) -> TextTable:
        """Return the numbers without the compiler."""
        return reader_table(self.costs, Cost)

    def text(self) -> str:
        """Return the table, and the compilers."""
        return (
            f"{self.table().as_text()}\n\n"
            "executed: instructions of one call, for input inside its range\n"
            f"{self._compilers()}"
        )

    def written(self, format: str) -> str:
        """Return the result in a format; the catalogue is a page in Markdown."""
        text = super().written(format)
        page = self.of_catalogue and format == "markdown"
        return f"{_HEAD}\n{text}\n\n{self._compilers()}" if page else text

    def _compilers(self) -> str:
        return "\n".join(dict.fromkeys(f"compiled by {cost.compiler} -O2" for cost in self.costs))


def code_size(sources: Sources) -> int | None:
    """Return the size in bytes of the code and constants of a compiled C source; None if it cannot be determined.

    The cache keeps it: to measure it takes a compilation of its own.
    """
    if not any(name.endswith(".c") for name in sources.files):
        return None
    words, counter = C.command(), shutil.which("size")
    if counter is None:
        return None
    key = build_key([sources], C_FLAGS)
    place = disk_cache.lookup(_SIZES, key)
    if place is not None:
        with suppress(FileNotFoundError):  # another process has removed it meanwhile
            return int(disk_cache.read(place, _SIZE))
    size = _measure_size(sources, words, counter)
    if size is not None:

        def note(draft: Path) -> None:
            (draft / _SIZE).write_text(str(size), encoding="utf-8", newline="\n")

        disk_cache.entry(_SIZES, key, note)
    return size


def _measure_size(sources: Sources, words: list[str], counter: str) -> int | None:
    """Return the size of compiled sources, measured by a program."""
    with drafts.temporary_folder() as folder:
        for name, text in sources.files.items():
            (folder / name).write_text(text, encoding="utf-8", newline="\n")
        code = next(name for name in sources.files if name.endswith(".c"))
        compiling = [*words, *C_FLAGS, "-c", code, "-o", "code.o"]
        if subprocess.run(compiling, cwd=folder, capture_output=True, check=False).returncode:
            return None
        said = subprocess.run([counter, "code.o"], cwd=folder, capture_output=True, text=True, check=False)
    match = re.match(r"\s*(\d+)\s", said.stdout.partition("\n")[2])
    return int(match[1]) if match else None
