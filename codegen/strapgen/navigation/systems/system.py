"""A system is a set of stages, each a kernel at a rate of its own, and the values that pass between them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from strapgen.ir.signals import Signal


@dataclass(frozen=True)
class Cell:
    """A value that the system stores between calls."""

    #: Name in generated code: stage and signal
    name: str
    #: Shape, unit, frame and meaning
    signal: Signal
    #: The elements before the first cycle, row-major
    initial: tuple[Fraction, ...]
    #: Number of samples that it holds, the newest last; 0 for a value that is replaced as a whole
    samples: int = 0


@dataclass(frozen=True)
class Wire:
    """A wire from a cell or an input to an input of a stage."""

    #: Name of the input of the kernel
    input: str
    #: Name of a cell, or of an input of the system
    source: str
    #: Whether the source is an input of the system
    external: bool = False


@dataclass(frozen=True)
class SystemStage:
    """A kernel that runs at the end of every so many cycles."""

    #: Name in the description
    name: str
    #: Name of the kernel
    kernel: str
    #: Cycles of the fastest rate from one call to the next
    every: int
    #: One for each input of the kernel, in its order
    wires: tuple[Wire, ...]
    #: For each output of the kernel the name of the cell that takes it
    results: tuple[tuple[str, str], ...]
    #: Bits of a word in fixed point; None for those that the target is generated with
    word: int | None = None
    #: Error feedback in fixed point, a key of `CARRIES`; "" for that of the settings
    carry: str = ""


@dataclass(frozen=True)
class Push:
    """A sample that is added to a cell that holds several."""

    cell: str
    #: Name of a cell, or of an input of the system
    source: str
    #: Whether it is an input
    external: bool = False


@dataclass(frozen=True)
class Rate:
    """The steps of one rate in order: samples are stored, stages are called, sums are cleared."""

    #: Cycles of the fastest rate from one time to the next
    every: int
    steps: tuple[Push | SystemStage, ...]
    #: Cells that are set to zero at the end
    cleared: tuple[str, ...] = ()

    @property
    def stages(self) -> tuple[SystemStage, ...]:
        """The stages alone."""
        return tuple(step for step in self.steps if isinstance(step, SystemStage))

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the system's inputs that it reads, each once."""
        return tuple(dict.fromkeys(_external(self.steps)))


def _external(steps: tuple[Push | SystemStage, ...]) -> Iterator[str]:
    """Return the names of the inputs that steps read."""
    for step in steps:
        for wire in [step] if isinstance(step, Push) else step.wires:
            if wire.external:
                yield wire.source


@dataclass(frozen=True)
class DescribedSystem:
    """Stages with their wires, checked."""

    #: Name in generated code, an identifier
    name: str
    #: One line that says what it computes
    title: str
    #: Cycles of the fastest rate in a second
    sample_hz: Fraction
    #: What is measured in every cycle of the fastest rate; each has a bound
    inputs: tuple[Signal, ...]
    #: What is stored
    cells: tuple[Cell, ...]
    #: From the fastest to the slowest, in the order in which they run when they fall together
    rates: tuple[Rate, ...]
    #: Names of the cells that a run records
    outputs: tuple[str, ...]

    @property
    def stages(self) -> tuple[SystemStage, ...]:
        """All stages, in the order in which they run when all rates fall together."""
        return tuple(stage for rate in self.rates for stage in rate.stages)

    @property
    def cycle(self) -> int:
        """Cycles of the fastest rate after which all rates fall together."""
        return math.lcm(*(rate.every for rate in self.rates))

    def cell(self, name: str) -> Cell:
        """Return the cell of a name."""
        return next(cell for cell in self.cells if cell.name == name)

    def every(self, cell: str) -> int:
        """Return the cycles from one change of a cell to the next, by the fastest stage that writes it."""
        return min(
            rate.every
            for rate in self.rates
            for step in rate.steps
            if (step.cell == cell if isinstance(step, Push) else cell in dict(step.results).values())
        )
