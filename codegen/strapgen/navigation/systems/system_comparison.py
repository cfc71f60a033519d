"""Compares a described system on several back ends: along a run, and pass by pass with the certified bounds."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, ClassVar, Protocol

import numpy as np

from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import float_above
from strapgen.ir.signals import Signal
from strapgen.ir.units import Sensor
from strapgen.navigation.systems.system_bounds import bounds
from strapgen.navigation.systems.system_runner import (
    CompiledSystem,
    SystemMemory,
    SystemRun,
    SystemRunner,
    carried,
    system_runner,
)
from strapgen.navigation.systems.wiring import Description
from strapgen.results.records import entry, reader_table
from strapgen.results.result import Result
from strapgen.results.table import TextTable
from strapgen.run.backends import BACKENDS
from strapgen.run.evaluators import Array


@dataclass(frozen=True)
class OutputComparison:
    """An output of a system on a back end beside a reference."""

    backend: str = field(metadata=entry("", align="<"))
    output: str = field(metadata=entry("output", align="<"))
    unit: str = field(metadata=entry("unit", align="<"))
    #: Largest difference of an element over the run, in the unit
    run: float = field(metadata=entry("run", ".3g"))
    #: Largest difference of an element after one pass from equal memories; None for a back end that runs no C
    one_pass: float | None = field(metadata=entry("one pass", ".3g"))
    #: Certified bound of that difference; None where there is none
    bound: float | None = field(metadata=entry("certified", ".3g"))
    #: Largest difference of one pass as a part of its bound
    share: float | None
    #: Why there is no bound
    reason: str


class RunsSamples(Protocol):
    """A runner of a system: a back end, or files."""

    def run(self, inputs: Mapping[str, Any]) -> SystemRun:
        """Run cycles of the fastest rate, see `SystemRunner.run`."""


def compare_system(
    description: Description,
    names: Iterable[str],
    reference: str,
    inputs: Mapping[str, Any],
    settings: Settings | None = None,
    files: Mapping[str, RunsSamples] | None = None,
    begin: Callable[[SystemRunner], SystemMemory] = SystemRunner.begin,
) -> list[OutputComparison]:
    """Run a system on back ends over the same samples and compare its outputs with those of a reference.

    `inputs` (cycles, shape): samples in SI units. `begin`: returns the memory with which a runner begins; files of a
    user begin as their code does.
    """
    if settings is not None and settings.sensor is not None:
        inputs = {**inputs, **_counts(description, inputs, settings.sensor)}
    other = system_runner(description, reference, settings if BACKENDS[reference].fixed else None)
    expected = other.run(inputs, begin(other)).values
    rows = []
    runners: dict[str, RunsSamples] = {
        name: system_runner(description, name, settings if BACKENDS[name].fixed else None) for name in names
    }
    for name, runner in (runners | dict(files or {})).items():
        memory = begin(runner) if isinstance(runner, SystemRunner) else None
        values = (
            runner.run(inputs, memory).values
            if isinstance(runner, SystemRunner)
            else runner.run(inputs).values
        )
        passes: PassAgreement | None = None
        if isinstance(runner, CompiledSystem):
            passes = agreement(runner, other, inputs, memory)
        for output in description.system.outputs:
            signal = description.system.cell(output).signal
            difference = float(distance(signal, values[output], expected[output]).max(initial=0))
            rows.append(_row(name, output, signal.unit, difference, passes))
    return rows


def _counts(description: Description, inputs: Mapping[str, Any], sensor: Sensor) -> dict[str, Any]:
    """Return the angle increments in whole counts of a gyro, each with the rounding error of those before."""
    return {
        signal.name: carried(np.asarray(inputs[signal.name], float), sensor.count)
        for signal in description.system.inputs
        if signal.is_angle_increment
    }


def _row(
    backend: str, output: str, unit: str, difference: float, passes: PassAgreement | None
) -> OutputComparison:
    if passes is None:
        return OutputComparison(backend, output, unit, difference, None, None, None, "no pass of it is known")
    return OutputComparison(
        backend,
        output,
        unit,
        difference,
        passes.largest[output],
        passes.certified.get(output),
        passes.share.get(output),
        passes.reasons.get(output, ""),
    )


#: Cycles that are compared together.
_BLOCK = 20_000


@dataclass(frozen=True)
class PassAgreement:
    """The difference of one pass on two back ends, from equal memories and samples."""

    #: Number of passes that were compared
    cycles: int
    #: Largest difference of an element of a cell, in its unit
    largest: Mapping[str, float]
    #: Sum of the error bounds of both back ends, of the worst element
    certified: Mapping[str, float]
    #: Largest difference of an element as a part of its bound; above 1 would refute the bound
    share: Mapping[str, float]
    #: Why a cell has no bound
    reasons: Mapping[str, str]

    @property
    def holds(self) -> bool:
        """Whether every difference is within its bound."""
        return all(share <= 1 for share in self.share.values())


def agreement(
    runner: SystemRunner,
    reference: SystemRunner,
    inputs: Mapping[str, Any],
    memory: SystemMemory | None = None,
) -> PassAgreement:
    """Run a system on one back end, and every single cycle of it on another from the memory before.

    `inputs` (cycles, shape): samples in SI units.
    """
    if not isinstance(runner, CompiledSystem):
        raise InputError(f"back end {runner.backend} runs no C; the memory of every cycle is read from C")
    samples = runner.samples(inputs)
    trace = runner.trace(samples, memory).cells
    limits = bounds(runner.fit)
    certified = {name: _added(limits.errors[name], _own(reference, name)) for name in limits.errors}
    largest = dict.fromkeys(trace, 0.0)
    share = dict.fromkeys(certified, 0.0)
    count = len(next(iter(trace.values()))) - 1
    start = (memory or runner.begin()).cycle
    for due, cycles in _groups(runner, start, count).items():
        for first in range(0, len(cycles), _BLOCK):
            rows = cycles[first : first + _BLOCK]
            differences = _differences(runner, reference, trace, samples, rows, due)
            for name, difference in differences.items():
                largest[name] = max(largest[name], float(difference.max(initial=0)))
                if name in share:
                    share[name] = max(share[name], _share(difference, certified[name]))
    worst = {name: float_above(max(errors)) for name, errors in certified.items()}
    return PassAgreement(count, largest, worst, share, dict(limits.reasons))


def _own(reference: SystemRunner, name: str) -> tuple[Fraction, ...] | None:
    """Return the error bounds of the reference itself; None in exact arithmetic."""
    if reference.many_digits:
        return None
    errors: tuple[Fraction, ...] | None = reference.rounding.errors.get(name)
    return errors


def _added(one: tuple[Fraction, ...], other: tuple[Fraction, ...] | None) -> tuple[Fraction, ...]:
    return one if other is None else tuple(a + b for a, b in zip(one, other, strict=True))


def _groups(runner: SystemRunner, start: int, count: int) -> dict[int, Array]:
    """Return the cycles in which so many rates are due, counted from the fastest."""
    numbers = np.arange(count)
    due = np.zeros(count, int)
    for rate in runner.system.rates:
        due += (start + numbers + 1) % rate.every == 0
    return {int(k): numbers[due == k] for k in np.unique(due)}


def _differences(
    runner: SystemRunner,
    reference: SystemRunner,
    trace: Mapping[str, Array],
    samples: Mapping[str, Array],
    rows: Array,
    due: int,
) -> dict[str, Array]:
    """Return the differences after the given cycles, from equal memories before them, for the cells that change."""
    before = reference.begin(len(rows))
    for name in before.cells:
        before.cells[name] = reference.stored(name, runner.in_si(name, trace[name][rows]))
    measured = {
        name: reference.stored(name, runner.in_si(name, values[rows])) for name, values in samples.items()
    }
    with np.errstate(all="ignore"):
        reference.call(before, measured, runner.system.rates[:due])
    return {
        name: distance(
            runner.system.cell(name).signal,
            runner.in_si(name, trace[name][rows + 1]),
            reference.in_si(name, values),
        )
        for name, values in before.cells.items()
    }


def distance(signal: Signal, one: Array, other: Array) -> Array:
    """Return how far values are from each other, element by element; angles without whole turns.

    `one, other` has shape (..., elements).
    """
    apart = one - other
    if signal.unit == "rad":
        apart = apart - math.tau * np.rint(apart / math.tau)
    return np.asarray(np.abs(apart))


def _share(differences: Array, errors: tuple[Fraction, ...]) -> float:
    """Return the largest difference as a part of its bound, with half a unit in the last place of a double to spare."""
    worst = 0.0
    for column, error in zip(differences.T, errors, strict=True):
        largest = float(column.max(initial=0))
        if largest:
            worst = max(worst, largest / float(error) if error else np.inf)
    return worst


@dataclass(frozen=True)
class SystemComparisonResult(Result):
    """The outputs of a described system on several back ends: a row for each output and back end."""

    rows_in = "outputs"
    row: ClassVar[type | None] = OutputComparison

    outputs: Sequence[OutputComparison]
    #: The system and its run in words
    title: str
    reference: str

    def reader(self) -> TextTable:
        """Return the outputs for a reader."""
        return reader_table(self.outputs, OutputComparison)

    def text(self) -> str:
        """Return the table, and why bounds are missing."""
        lines = [
            self.title,
            f"largest difference of an element from {self.reference}: over the run, where differences add up, and",
            "after one pass from equal memories, beside the certified bound of a pass",
            "",
            *self.reader().lines(),
        ]
        reasons = dict.fromkeys(
            f"no bound of {row.output}: {row.reason}"
            for row in self.outputs
            if row.one_pass is not None and row.reason
        )
        return "\n".join([*lines, *reasons])
