"""The certificate of a described system: what the rounding of each stage has made of its outputs along a run.

The system runs beside exact twins of itself, in balls. After each call of a stage its own rounding is known: the cells
that it wrote less the exact program on the cells that it read. The first twin computes exactly; in the next one the
first stage rounds as it did, in the one after that the first two, and in the last one, which is the run, all. What
rounding made of an output is the distance of the first twin from the last, and the part of a stage that of its two.
Nothing is linearized, and error feedback needs nothing: only cells enter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.interfaces import Argument
from strapgen.ir.signals import CYCLE, Signal
from strapgen.lab.certificate import balls
from strapgen.lab.certificate.certificate_report import Angle, near, rounded_up
from strapgen.navigation.systems.system import Cell, Push, SystemStage
from strapgen.navigation.systems.system_runner import SystemMemory, SystemRunner
from strapgen.navigation.systems.system_runs import parameters
from strapgen.results import figures
from strapgen.results.records import INTERNAL, Record, entry, reader_table
from strapgen.results.result import Result
from strapgen.results.table import ANGLE
from strapgen.run.evaluators import Array

#: Bits of balls at first, and those that must be left of a number near 1 after all cycles.
_BITS, _LEFT = 192, 96
#: What is left of a part that is none, at most.
_NOTHING = 2.0**-_LEFT
#: Stages that the text shows for an output.
_SHOWN = 4
#: Cycles, about, whose roundings are in memory at once.
_TOGETHER = 4096


@dataclass(frozen=True)
class OutputRounding(Record):
    """What rounding has made of an output at the end of a run."""

    output: str = field(metadata=entry("output", align="<"))
    unit: str = field(metadata=entry("unit", align="<"))
    #: Angle of an attitude in rad, or length of the difference of a vector, from exact arithmetic on the same samples
    rounding: float = field(metadata=entry("rounding", ANGLE))
    #: Radius of the ball of that number, and of each element
    rounding_radius: float = field(metadata=entry("+-", cell=rounded_up, align=">"))
    #: The rotation vector of an attitude in rad, or the difference of each element
    rounding_elements: tuple[float, ...]
    #: The largest at any of the instants
    largest_rounding: float = field(metadata=entry("largest", ANGLE))
    #: The stage with the largest part, and the part of each stage
    largest_stage: str = field(metadata=entry("most by", align="<"))
    stages: Mapping[str, float]
    #: Whether the output is a change over its cycle, of which the sum is examined
    is_sum: bool


@dataclass(frozen=True)
class SystemInstant(Record):
    """What rounding has made of the outputs up to an instant."""

    time_s: float
    #: By the name of the output
    roundings: Mapping[str, float] = field(metadata=entry(split=True))


@dataclass(frozen=True)
class SystemCertificateResult(Result):
    """What rounding did to the outputs of a described system along a run, stage by stage."""

    rows_in = "outputs"
    drawn_by = f"{__name__}:system_certificate_image"

    system: str
    backend: str
    cycles: int
    duration_s: float
    outputs: Sequence[OutputRounding]
    departures: Sequence[SystemInstant]
    #: Where the samples come from
    source: str = field(default="", metadata=INTERNAL)

    def text(self) -> str:
        """Return the roundings of the outputs, and the part of each stage in them."""
        title = f"{self.system}, {self.backend}: {self.cycles} cycles, {self.duration_s:.6g} s"
        lines = [
            f"{title} of {self.source}" if self.source else title,
            "rounding on this run, from exact arithmetic on the same samples",
            "",
            *reader_table(self.outputs, OutputRounding).lines(),
            "",
        ]
        for one in self.outputs:
            largest = sorted(one.stages.items(), key=lambda part: -part[1])[:_SHOWN]
            parts = ", ".join(f"{name} {part:.3g}" for name, part in largest if part)
            whole = ", the sum of all its cycles," if one.is_sum else ""
            lines.append(f"{one.output}{whole} by stages, {one.unit}: {parts or 'nothing is rounded'}")
        return "\n".join(lines)


def certify_system(
    runner: SystemRunner,
    inputs: Mapping[str, Any],
    *,
    memory: SystemMemory | None = None,
    instants: int = 400,
) -> SystemCertificateResult:
    """Certify what rounding did to the outputs of a described system, and which stage did most of it.

    Each stage runs as generated, one cycle after the other; exact arithmetic on the same samples runs beside it in
    balls. A velocity or position change over a cycle is examined as the sum of all cycles.

    Parameters
    ----------
    runner : SystemRunner
        What `system_runner` returns, on any back end whose numbers are words or doubles.
    inputs : mapping of str to array_like, (cycles, shape)
        Samples of every input in SI units, as for `SystemRunner.run`.
    memory : SystemMemory, optional
        What a run before has left, or the attitude at the start; by default `SystemRunner.begin`.
    instants : int, optional
        Most instants for which the roundings are returned.

    Returns
    -------
    SystemCertificateResult
        For each output an angle in rad, or a length in its unit, with the radius of its ball, and its parts by stages.

    Raises
    ------
    InputError
        If a sample does not fit, a stage refuses its input, or the back end computes in many digits.
    MissingExtraError
        If python-flint is not installed.

    Examples
    --------
    >>> from strapgen import read_system, system_runner
    >>> runner = system_runner(read_system("two-speed-euler"), "fixed-model")
    >>> turns, pushes = np.full((640, 3), 2e-4), np.full((640, 3), 3e-3)
    >>> found = certify_system(runner, {"gyro": turns, "accelerometer": pushes, "turn": np.zeros((640, 3))})
    >>> [(one.output, one.unit, one.rounding_radius < one.rounding / 1e6) for one in found.outputs]
    [('slow_state', 'rad', True), ('nav_velocity_change', 'm/s', True)]
    """
    balls.flint()
    if runner.many_digits:
        raise InputError(
            f"back end {runner.backend} computes in many digits; there is no rounding to certify"
        )
    instants = checks.count("instants", instants, smallest=2)
    samples = runner.samples(inputs)
    count = len(next(iter(samples.values())))
    if count < runner.system.cycle:
        raise InputError(
            f"{count} samples are given; a cycle of the slowest rate needs {runner.system.cycle}"
        )
    count -= count % runner.system.cycle
    bits: int | None = _BITS
    while bits is not None:
        twins = _Twins(runner, memory, bits)
        bits = twins.run(samples, count, max(1, math.ceil(count / runner.system.cycle / (instants - 1))))
    interval = 1 / runner.system.sample_hz
    return SystemCertificateResult(
        runner.system.name,
        runner.backend,
        count,
        float(count * interval),
        twins.outputs(),
        [SystemInstant(float(k * interval), row) for k, row in twins.rows],
    )


class _Rounding(NamedTuple):
    """A difference of two values of an output in doubles that hold its ball."""

    size: float
    radius: float
    elements: tuple[float, ...]


class _Called(NamedTuple):
    """A stage that is called, or a sample that is put into a cell, on balls."""

    #: The names of what it reads, each with whether that is a sample
    reads: tuple[tuple[str, bool], ...]
    #: Its program, one argument for each element; None for a sample that is put into a cell
    function: Callable[..., list[list[Any]]] | None
    #: The cells that it writes
    writes: tuple[str, ...]
    #: Number of the stage, whose rounding it is
    place: int
    #: The roundings of the elements of each cell, by the cycle of a part; None where all is exact
    roundings: dict[int, Sequence[Any] | None]


class _Twins:
    """A run beside its twins, of which the first is exact and each next one rounds in one stage more."""

    def __init__(self, runner: SystemRunner, memory: SystemMemory | None, bits: int) -> None:
        self._runner, self._memory = runner, (memory or runner.begin()).copy()
        self._bits, self._system = bits, runner.system
        self._held = {name: self._system.cell(name) for name in self._system.outputs}
        self._every = {name: runner.system.every(name) for name in self._held}
        self._phases = [
            [place for place, rate in enumerate(runner.system.rates) if k % rate.every == 0]
            for k in range(runner.system.cycle)
        ]
        self._stages = [stage.name for stage in self._system.stages]
        #: The calls of the cycles in which all rates are due, in their order, each with its step
        self._calls: list[list[tuple[Push | SystemStage, _Called]]] = []
        #: Cells of each twin, and of the run, and the sums of their changes
        self._cells: list[dict[str, list[Any]]] = []
        self._sums: list[dict[str, list[Any]]] = []
        #: Numbers of cycles with the roundings of the outputs after them
        self.rows: list[tuple[int, dict[str, float]]] = []

    def run(self, samples: Mapping[str, Array], count: int, every: int) -> int | None:
        """Run so many cycles; return the bits that are needed, or None where these are enough.

        `every`: cycles of all rates from one instant to the next.
        """
        from flint import arb, ctx

        step = self._system.cycle * every
        together = max(1, _TOGETHER // step) * step
        with ctx.workprec(self._bits):
            self._calls = [[(step, self._called(step)) for step in rate.steps] for rate in self._system.rates]
            begun = {name: [*self._exact(name, rows)[0]] for name, rows in self._memory.cells.items()}
            zeros = {
                name: [arb(0)] * cell.signal.size
                for name, cell in self._held.items()
                if cell.signal.over == CYCLE
            }
            self._cells = [dict(begun) for _ in (*self._stages, None)]
            self._sums = [dict(zeros) for _ in self._cells]
            for first in range(0, count, together):
                last = min(first + together, count)
                part = {name: rows[first:last] for name, rows in samples.items()}
                trace = self._runner.trace(part, self._memory)
                with ctx.workprec(_BITS):
                    self._round(trace, part)
                balls_of = {name: self._exact(name, rows).tolist() for name, rows in part.items()}
                for begin in range(0, last - first, step):
                    end = min(begin + step, last - first)
                    self._carry(0, balls_of, range(begin, end))
                    with ctx.workprec(_BITS):
                        for twin in range(1, len(self._stages)):
                            self._carry(twin, balls_of, range(begin, end))
                            self._drop_radii(twin)
                    self._follow(trace, range(begin, end))
                    if (needed := self._needed(first + end, count)) is not None:
                        return needed
                    self.rows.append(
                        (first + end, {name: self._between(name, 0).size for name in self._held})
                    )
                self._memory = SystemMemory(
                    {name: rows[-1:] for name, rows in trace.cells.items()},
                    {name: rows[-1:] for name, rows in trace.feedback.items()},
                    trace.cycle,
                )
        return None

    def _called(self, step: Push | SystemStage) -> _Called:
        """Return a step on balls."""
        if isinstance(step, Push):
            reader = next(
                place
                for place, stage in enumerate(self._system.stages)
                if step.cell in {wire.source for wire in stage.wires}
            )
            return _Called(((step.source, step.external),), None, (step.cell,), reader, {})
        program = self._runner.fit.description.programs[step.name]
        cells = dict(step.results)
        return _Called(
            tuple((wire.source, wire.external) for wire in step.wires),
            balls.scalar_function(program),
            tuple(cells[one.signal.name] for one in program.outputs),
            self._stages.index(step.name),
            {},
        )

    def _exact(self, name: str, words: Any) -> Array:
        """Return stored numbers as balls, (count, elements)."""
        argument: Argument | None = self._runner.fit.arguments.get(name)
        array = np.asarray(words)
        column: Array = balls.column_of(array.ravel().tolist())
        if argument is not None:
            column = column * balls.ball(Fraction(argument.unit))
        return column.reshape(array.shape)

    def _round(self, trace: SystemMemory, samples: Mapping[str, Array]) -> None:
        """Note the rounding of every call: what it wrote less the exact program on what it read.

        A trace has the memory between cycles; so the calls of all cycles in which as many rates are due are made again,
        side by side.
        """
        runner, system = self._runner, self._system
        count = len(next(iter(samples.values())))
        due = np.array([len(self._due(k)) for k in range(count)])
        for calls in self._calls:
            for _, called in calls:
                called.roundings.clear()
        for many in np.unique(due):
            cycles = np.flatnonzero(due == many)
            memory = SystemMemory(
                {name: rows[cycles] for name, rows in trace.cells.items()},
                {name: rows[cycles] for name, rows in trace.feedback.items()},
            )
            taken = {name: rows[cycles] for name, rows in samples.items()}
            for rate, calls in zip(system.rates[:many], self._calls, strict=False):
                for step, called in calls:
                    read = [
                        column
                        for name, external in called.reads
                        for column in self._exact(name, (taken if external else memory.cells)[name]).T
                    ]
                    if isinstance(step, Push):
                        before = self._exact(step.cell, memory.cells[step.cell]).T
                        exact = [[*before[len(read) :], *read]]
                        runner.push(memory, step, taken)
                    else:
                        exact = balls.evaluate(runner.fit.description.programs[step.name], read)
                        runner.call_stage(memory, step, taken)
                    parts = []
                    for cell, elements in zip(called.writes, exact, strict=True):
                        computed = self._exact(cell, memory.cells[cell])
                        wanted = [np.broadcast_to(x, len(cycles)) for x in elements]
                        parts.append((computed - np.stack(wanted, axis=1)).tolist())
                    for k, row in zip(cycles.tolist(), zip(*parts, strict=True), strict=True):
                        is_exact = all(x.is_zero() for elements in row for x in elements)
                        called.roundings[k] = None if is_exact else row
                runner.clear(memory, rate)
            for name, rows in memory.cells.items():
                if not np.array_equal(rows, trace.cells[name][cycles + 1]):
                    raise InputError(
                        f"the code of {system.name} leaves another {name} than its stages one by one"
                    )

    def _due(self, k: int) -> list[int]:
        """Return the numbers of the rates that are due in a cycle of a part."""
        return self._phases[(self._memory.cycle + k + 1) % self._system.cycle]

    def _carry(self, twin: int, samples: Mapping[str, Any], cycles: range) -> None:
        """Run a twin, which rounds in the stages of numbers below its own."""
        from flint import arb

        cells, sums, zero = self._cells[twin], self._sums[twin], arb(0)
        calls = [[called for _, called in calls] for calls in self._calls]
        cleared = [rate.cleared for rate in self._system.rates]
        for k in cycles:
            for place in self._due(k):
                for reads, function, writes, stage, roundings in calls[place]:
                    values: list[Any] = []
                    for name, external in reads:
                        values += samples[name][k] if external else cells[name]
                    kept = [] if function is not None else cells[writes[0]][len(values) :]
                    found = [kept + values] if function is None else function(*values)
                    if stage < twin and (rounding := roundings[k]) is not None:
                        found = [
                            [x + y for x, y in zip(*pair, strict=True)]
                            for pair in zip(found, rounding, strict=True)
                        ]
                    cells.update(zip(writes, found, strict=True))
                for name in cleared[place]:
                    cells[name] = [zero] * len(cells[name])
            for name, total in sums.items():
                if (self._memory.cycle + k + 1) % self._every[name] == 0:
                    sums[name] = [x + y for x, y in zip(total, cells[name], strict=True)]

    def _drop_radii(self, twin: int) -> None:
        """Take the middles of a twin's balls: a part needs no radius beside that of the whole."""
        for values in (self._cells[twin], self._sums[twin]):
            for name, elements in values.items():
                values[name] = [x.mid() for x in elements]

    def _follow(self, trace: SystemMemory, cycles: range) -> None:
        """Take over the cells of the run itself after some cycles."""
        cells, sums = self._cells[-1], self._sums[-1]
        for name, rows in trace.cells.items():
            cells[name] = [*self._exact(name, rows[cycles.stop])]
        for name, total in sums.items():
            ends = [k + 1 for k in cycles if (self._memory.cycle + k + 1) % self._every[name] == 0]
            changes = (
                self._exact(name, trace.cells[name][ends]) if ends else np.zeros((0, len(total)), object)
            )
            sums[name] = [sum(column, x) for x, column in zip(total, changes.T, strict=True)]

    def _needed(self, done: int, count: int) -> int | None:
        """Return the bits that a run needs; None where its own are enough so far.

        Radii grow by a factor with every cycle.
        """
        lost = 0
        for values in self._cells[0].values():
            for x in values:
                if not x.is_finite():
                    return 2 * self._bits
                if not x.is_exact():
                    lost = max(lost, _magnitude(x.rad()) - max(0, _magnitude(x.mid())) + self._bits)
        if self._bits - lost >= _LEFT:
            return None
        return max(2 * self._bits, int(lost * count / done * 1.05) + _LEFT + 32)

    # Outputs

    def _between(self, name: str, first: int, last: int = -1) -> _Rounding:
        """Return what lies between two twins in an output."""
        signal = self._held[name].signal
        pair = [(self._sums if name in self._sums[0] else self._cells)[twin][name] for twin in (last, first)]
        if not is_attitude(self._held[name]):
            return _difference(signal, *pair)
        computed, exact = (_matrix(signal, values) for values in pair)
        angle = Angle.of(computed * exact.inv())
        return _Rounding(angle.size, max(angle.radius, angle.axes_radius), angle.axes)

    def outputs(self) -> list[OutputRounding]:
        """Return what rounding has made of the outputs at the end."""
        from flint import ctx

        found = []
        with ctx.workprec(self._bits):
            for name, cell in self._held.items():
                whole = self._between(name, 0)
                sizes = [self._between(name, place, place + 1).size for place in range(len(self._stages))]
                parts = {
                    stage: size if size > _NOTHING else 0.0
                    for stage, size in zip(self._stages, sizes, strict=True)
                }
                largest = max(row[name] for _, row in self.rows)
                most = max(parts, key=lambda stage: parts[stage])
                unit = "rad" if is_attitude(cell) else cell.signal.unit
                found.append(
                    OutputRounding(
                        *(name, unit, whole.size, whole.radius, whole.elements, largest),
                        *(most if parts[most] else "-", parts, name in self._sums[0]),
                    )
                )
        return found


def is_attitude(cell: Cell) -> bool:
    """Return whether a cell holds an attitude: parameters of length 1, or direction cosines."""
    return bool(cell.signal.constraint) and cell.signal.size in (4, 9)


def _magnitude(x: Any) -> int:
    """Return the binary logarithm of a number without radius, rounded up."""
    digits, exponent = x.man_exp()
    return abs(int(digits)).bit_length() + int(exponent)


def _difference(signal: Signal, computed: Any, exact: Any) -> _Rounding:
    """Return the difference of two vectors; angles without whole turns."""
    from flint import arb

    apart = [x - y for x, y in zip(computed, exact, strict=True)]
    if signal.unit == "rad":
        apart = [x - 2 * arb.pi() * round(float(x.mid()) / math.tau) for x in apart]
    elements, radii = zip(*map(near, apart), strict=True)
    size, radius = near(sum((x * x for x in apart), arb(0)).nonnegative_part().sqrt())
    return _Rounding(size, max(radius, *radii), elements)


def _matrix(signal: Signal, values: list[Any]) -> Any:
    """Return an attitude as a matrix of balls, times the square of the length of parameters."""
    from flint import arb_mat

    if signal.size == 9:
        return arb_mat(3, 3, values)
    program = pipeline.program(choose(f"dcm-from-{parameters(signal)}"))
    return arb_mat(3, 3, balls.evaluate_single(program, values))


def system_certificate_image(result: SystemCertificateResult, path: str | Path) -> bytes:
    """Return the roundings of the outputs over time, a panel for each unit."""
    units = list(dict.fromkeys(one.unit for one in result.outputs))
    figure, grid = figures.grid_of_axes(len(units), 1, (8.5, 1.2 + 3.2 * len(units)))
    time = [row.time_s for row in result.departures]
    for unit, axes in zip(units, grid[:, 0], strict=True):
        shown = [one for one in result.outputs if one.unit == unit and one.largest_rounding]
        for one, colour in zip(shown, figures.several_colours(len(shown)), strict=True):
            values = np.array([row.roundings[one.output] or math.nan for row in result.departures])
            label = f"{one.output}, sum" if one.is_sum else one.output
            axes.plot(time, values, color=colour, linewidth=1.4, label=label)
        if shown:
            axes.set_yscale("log")
            axes.legend(frameon=False, fontsize=9)
        axes.set_xlabel("time, s")
        axes.set_ylabel(f"rounding, {unit}")
        figures.style(axes)
    figures.title(figure, f"Certificate of {result.system}, {result.backend}")
    return figures.image(figure, path)
