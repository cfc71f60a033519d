"""Runs the loops of an attitude and heading reference through their schedule, beside the matrix exponential."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.exceptions import InputError
from strapgen.navigation.loops import loop_gains
from strapgen.navigation.loops.loop_errors import LoopErrors
from strapgen.navigation.loops.loop_gains import closed_loop
from strapgen.navigation.loops.loop_schedule import LoopMode, LoopSchedule, LoopSetting
from strapgen.navigation.systems.system_runner import SystemMemory, SystemRun, SystemRunner
from strapgen.results import figures
from strapgen.results.records import INTERNAL, entry
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.run import backends

Array = NDArray[np.float64]
#: The loops of every mode; erection takes the place of levelling.
LOOPS = ("level", "heading", "vertical")
#: Units of the states in which results are told, and the factor to them.
_DEG, _DEG_H = math.degrees(1), math.degrees(3600)
UNITS = {
    "level": {"velocity": ("m/s", 1.0), "tilt": ("deg", _DEG), "bias": ("deg/h", _DEG_H)},
    "heading": {"heading": ("deg", _DEG), "bias": ("deg/h", _DEG_H)},
    "vertical": {"height": ("m", 1.0), "climb": ("m/s", 1.0), "bias": ("m/s^2", 1.0)},
}
#: Records of a mode for a picture, and most cycles of a run.
_RECORDS, _LONGEST = 150, 1_000_000
_TERMS = 24


@dataclass(frozen=True)
class LoopCourse:
    """A loop through the schedule."""

    loop: str
    cases: tuple[str, ...]
    #: (K,): in s
    times: Array
    #: (K, cases, states): states by the kernel and by the matrix exponential, in SI units
    run: Array
    exact: Array
    #: Records at which the modes end
    ends: tuple[int, ...]


@dataclass(frozen=True)
class LoopGains:
    """The gains of a loop in a mode."""

    mode: str
    loop: str
    reference: str
    #: Time constant
    tau_s: float | None
    slowest_pole_s: float | None
    gains: list[float]
    #: The same exactly
    exact: tuple[Fraction, ...] = field(metadata=entry(kind=list[str]))


def mode_gains(schedule: LoopSchedule, setting: LoopSetting) -> tuple[Fraction, ...]:
    """Return the gains of a loop, exactly; zeros where it is open."""
    if setting.time_constant_s is None:
        return (Fraction(0),) * len(closed_loop(setting.loop).gains)
    return loop_gains.gains(
        setting.loop, setting.time_constant_s, setting.order, schedule.gravity, schedule.radius
    )


def schedule_gains(schedule: LoopSchedule) -> list[LoopGains]:
    """Return the gains of all loops of all modes; unstable ones are refused."""
    rows = []
    for mode in schedule.modes:
        for setting in mode.loops:
            values, tau, slowest = mode_gains(schedule, setting), setting.time_constant_s, None
            if tau is not None:
                known = (schedule.cycle_s, schedule.gravity, schedule.radius)
                try:
                    loop_gains.check_stable(setting.loop, values, *known)
                except InputError as error:
                    raise InputError(f"mode {mode.name}: {error}") from None
                pole = abs(loop_gains.poles_of_a_cycle(setting.loop, values, *known)[0])
                slowest = -float(schedule.cycle_s) / math.log(pole) if pole else 0.0
            head = (mode.name, setting.loop, setting.reference)
            numbers = [float(value) for value in values]
            rows.append(LoopGains(*head, None if tau is None else float(tau), slowest, numbers, values))
    return rows


def cycles_of_modes(schedule: LoopSchedule, modes: tuple[LoopMode, ...]) -> list[int]:
    """Return the cycles of each mode."""
    counts = []
    for mode in modes:
        count = (mode.duration_s or Fraction(0)) / schedule.cycle_s
        if count.denominator != 1:
            raise InputError(
                f"mode {mode.name}: duration_s is no whole number of cycles of {float(schedule.cycle_s):g} s"
            )
        counts.append(int(count))
    if not 0 < sum(counts) <= _LONGEST:
        raise InputError(f"the run has {sum(counts)} cycles; 1 to {_LONGEST} are possible")
    return counts


def run_loops(
    schedule: LoopSchedule, modes: tuple[LoopMode, ...], errors: LoopErrors, backend: str = "numpy"
) -> Iterator[LoopCourse]:
    """Yield every loop through modes one after the other."""
    for loop in LOOPS:
        yield _course(schedule, modes, loop, errors, backend)


def _course(
    schedule: LoopSchedule, modes: tuple[LoopMode, ...], loop: str, errors: LoopErrors, backend: str
) -> LoopCourse:
    """Run the cases of a loop side by side."""
    cases = errors.cases(loop, float(schedule.gravity))
    full = closed_loop(loop)
    inputs = np.array([[drive.get(name, 0.0) for name in full.inputs] for drive, _ in cases.values()])
    start = np.array([[begin.get(name, 0.0) for name in full.states] for _, begin in cases.values()])
    cycle = float(schedule.cycle_s)
    plant = _PLANTS[loop](schedule, inputs, backend)
    run, exact, cycles, ends = [start], [start], [0], []
    for mode, count in zip(modes, cycles_of_modes(schedule, modes), strict=True):
        setting = mode.loop(loop)
        spacing = max(1, count // _RECORDS)
        matrices = _matrices(schedule, setting, loop)
        gains = [float(value) for value in mode_gains(schedule, setting)]
        if mode is modes[0]:
            plant.begin(start, setting.loop, gains)
        for first in range(0, count, spacing):
            part = min(spacing, count - first)
            run.append(plant.run(setting.loop, gains, part))
            exact.append(_advance(matrices, exact[-1], inputs, part * cycle))
            cycles.append(cycles[-1] + part)
        ends.append(len(cycles) - 1)
    times = np.array([float(count * schedule.cycle_s) for count in cycles])
    return LoopCourse(loop, tuple(cases), times, np.array(run), np.array(exact), tuple(ends))


def _matrices(schedule: LoopSchedule, setting: LoopSetting, loop: str) -> tuple[Array, Array]:
    """Return A and D of x' = A x + D d for all states of a loop, those that a mode holds among them."""
    full, part = closed_loop(loop), closed_loop(setting.loop)
    known = dict(zip(part.gains, mode_gains(schedule, setting), strict=True))
    known |= {loop_gains.g: schedule.gravity, loop_gains.R: schedule.radius}
    count = len(full.states)
    A, D = np.zeros((count, count)), np.zeros((count, len(full.inputs)))
    for array, matrix in ((A, part.continuous), (D, part.disturbance)):
        numbers = np.array(matrix.subs(known).tolist(), float)
        array[: numbers.shape[0], : numbers.shape[1]] = numbers
    return A, D


def _advance(matrices: tuple[Array, Array], states: Array, inputs: Array, time: float) -> Array:
    """Return states after a time under constant inputs, by the matrix exponential."""
    A, D = matrices
    count, driven = D.shape
    block = np.zeros((count + driven, count + driven))
    block[:count, :count], block[:count, count:] = A, D
    power = exponential(block * time)
    return np.asarray(states @ power[:count, :count].T + inputs @ power[:count, count:].T)


def exponential(matrix: Array) -> Array:
    """Return the exponential of a matrix, by its series and repeated squaring.

    >>> exponential(np.array([[0.0, 1.0], [0.0, 0.0]])).tolist()
    [[1.0, 1.0], [0.0, 1.0]]
    """
    halvings = max(0, math.ceil(math.log2(max(np.abs(matrix).sum(axis=1).max(), 1e-300))) + 1)
    small, term = matrix / 2.0**halvings, np.eye(len(matrix))
    total = term
    for number in range(1, _TERMS):
        term = term @ small / number
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return np.asarray(total)


def _without_checks(name: str, backend: str, inputs: Array) -> Callable[..., Any]:
    """Return a kernel for as many runs as `inputs` has rows, without the checks of arrays, most of a call."""
    kernel, batch = backends.evaluator(name, backend), (len(inputs),)

    def call(*values: Any) -> tuple[Array, ...]:
        return kernel.evaluate([np.asarray(value, float) for value in values], batch)

    return call


class _LevelPlant:
    """The channel of V_y and phi_x, with the kernel of levelling or of erection."""

    def __init__(self, schedule: LoopSchedule, inputs: Array, backend: str) -> None:
        self._kernels = {name: _without_checks(name, backend, inputs) for name in ("level-loop", "erection")}
        self._cycle, self._gravity = float(schedule.cycle_s), float(schedule.gravity)
        self._curvature = 1 / float(schedule.radius)
        self._drift, self._force, reference = inputs.T
        zero = np.zeros_like(reference)
        self._reference = np.stack([zero, reference], axis=1)

    def begin(self, states: Array, loop: str, gains: list[float]) -> None:
        """Take the states at the start, and the rate that they command."""
        zero = np.zeros(len(states))
        self._velocity, self._bias = (np.stack([zero, zero], axis=1) for _ in range(2))
        self._velocity[:, 1], self._tilt, self._bias[:, 0] = states.T
        self._command(loop, gains, np.zeros((len(states), 3)), 0.0)

    def _command(self, loop: str, gains: list[float], change: Array, cycle: float) -> None:
        """Call the kernel of a mode."""
        level, erect = self._kernels.values()
        if loop == "erection":
            self._velocity, self._rate = erect(self._velocity, change, *gains, cycle)
        else:
            self._velocity, self._bias, self._rate = level(
                self._velocity, self._bias, change, self._reference, self._curvature, *gains, cycle
            )

    def run(self, loop: str, gains: list[float], count: int) -> Array:
        """Run cycles, and return the states after them."""
        T, change = self._cycle, np.zeros((len(self._tilt), 3))
        for _ in range(count):
            tilt = self._tilt + T * (self._drift - self._rate[:, 0])
            change[:, 1] = T * (self._gravity * (self._tilt + tilt) / 2 + self._force)
            self._tilt = tilt
            self._command(loop, gains, change, T)
        return np.stack([self._velocity[:, 1], self._tilt, self._bias[:, 0]], axis=1)


class _HeadingPlant:
    """The heading, which the commanded rate turns."""

    def __init__(self, schedule: LoopSchedule, inputs: Array, backend: str) -> None:
        self._kernel = _without_checks("heading-loop", backend, inputs)
        self._cycle = float(schedule.cycle_s)
        self._drift, self._reference = inputs.T

    def begin(self, states: Array, _: str, gains: list[float]) -> None:
        """Take the states at the start, and the rate that they command."""
        self._heading, self._bias = states.T
        _bias, self._rate = self._kernel(self._heading, self._reference, self._bias, *gains, 0.0)

    def run(self, _: str, gains: list[float], count: int) -> Array:
        """Run cycles, and return the states after them."""
        for _cycle in range(count):
            self._heading = self._heading + self._cycle * (self._drift - self._rate)
            self._bias, self._rate = self._kernel(
                self._heading, self._reference, self._bias, *gains, self._cycle
            )
        return np.stack([self._heading, self._bias], axis=1)


class _VerticalPlant:
    """The vertical channel, whose states are all in the kernel."""

    def __init__(self, schedule: LoopSchedule, inputs: Array, backend: str) -> None:
        self._kernel = _without_checks("vertical-loop", backend, inputs)
        self._cycle, self._gravity = float(schedule.cycle_s), float(schedule.gravity)
        self._gradient = 2 * self._gravity / float(schedule.radius)
        force, self._reference = inputs.T
        zero = np.zeros_like(force)
        self._change = np.stack([zero, zero, -self._cycle * (self._gravity + force)], axis=1)

    def begin(self, states: Array, _loop: str, _gains: list[float]) -> None:
        """Take the states at the start."""
        self._states = tuple(states.T)

    def run(self, _: str, gains: list[float], count: int) -> Array:
        """Run cycles, and return the states after them."""
        known = (self._change, self._reference, self._gravity, self._gradient, *gains, self._cycle)
        for _cycle in range(count):
            self._states = self._kernel(*self._states, *known)
        return np.stack(self._states, axis=1)


_PLANTS: Mapping[str, type[_LevelPlant] | type[_HeadingPlant] | type[_VerticalPlant]] = {
    "level": _LevelPlant,
    "heading": _HeadingPlant,
    "vertical": _VerticalPlant,
}


@cache
def factors(loop: str) -> Array:
    """Return the factors from SI units to those of `UNITS`, (states,)."""
    return np.array([factor for _, factor in UNITS[loop].values()])


_GAIN, _STATE = ".9g", ".7g"


@dataclass(frozen=True)
class LoopState:
    """A state of a case at the end of a mode."""

    loop: str
    mode: str
    time_s: float
    #: What disturbs the loop
    case: str
    quantity: str
    unit: str
    #: By the kernel
    run: float
    matrix_exponential: float
    #: The former less the latter
    difference: float


@dataclass(frozen=True)
class LoopsResult(Result):
    """The loops of an attitude and heading reference through their schedule."""

    rows_in = "states"
    drawn_by: ClassVar[str] = f"{__name__}:loops_image"

    #: Those that were run
    modes: tuple[LoopMode, ...] = field(metadata=INTERNAL)
    courses: Sequence[LoopCourse] = field(metadata=INTERNAL)
    #: What disturbs the loops
    errors: LoopErrors
    #: Title of the schedule
    title: str
    #: Time of a cycle
    cycle_s: float
    #: The gains of all modes
    gains: Sequence[LoopGains]
    #: Every state of every case at the end of every mode
    states: list[LoopState] = field(metadata=entry(key="rows"))

    @staticmethod
    def of(
        schedule: LoopSchedule,
        modes: tuple[LoopMode, ...],
        errors: LoopErrors,
        gains: Sequence[LoopGains],
        courses: Sequence[LoopCourse],
    ) -> LoopsResult:
        """Return the loops that were run through modes of a schedule."""
        states = [state for course in courses for state in _states(modes, course)]
        return LoopsResult(modes, courses, errors, schedule.title, float(schedule.cycle_s), gains, states)

    def text(self) -> str:
        """Return the gains, and the states of each loop."""
        return "\n".join(_lines(self))


def _states(modes: tuple[LoopMode, ...], course: LoopCourse) -> Iterator[LoopState]:
    """Yield the states of a loop: those of every case at the end of every mode."""
    run, exact = (array * factors(course.loop) for array in (course.run, course.exact))
    for mode, end in zip(modes, course.ends, strict=True):
        for k, case in enumerate(course.cases):
            for number, (quantity, (unit, _)) in enumerate(UNITS[course.loop].items()):
                one, other = float(run[end, k, number]), float(exact[end, k, number])
                facts = (course.loop, mode.name, float(course.times[end]), case, quantity, unit)
                yield LoopState(*facts, one, other, one - other)


def _lines(result: LoopsResult) -> Iterator[str]:
    yield f"{result.title or 'schedule'}: cycle {result.cycle_s:g} s"
    yield ""
    yield from _gains_table(result.gains).lines()
    for course in result.courses:
        yield ""
        yield f"{course.loop} loop at the end of each mode: by the kernel, and by the matrix exponential"
        yield ""
        yield from _states_table(course.loop, result.states).lines()


def _gains_table(several: Sequence[LoopGains]) -> TextTable:
    """Return the gains of all modes."""
    columns = [Column(name, "<") for name in ("mode", "loop", "reference")]
    columns += [Column("tau, s", spec="g"), Column("slowest pole, s", spec=".6g")]
    columns += [Column(name, spec=_GAIN) for name in ("k1", "k2", "k3")]
    rows = []
    for one in several:
        values = [] if one.tau_s is None else one.gains
        gains = [*values, *[None] * (3 - len(values))]
        rows.append([one.mode, one.loop, one.reference, one.tau_s, one.slowest_pole_s, *gains])
    return TextTable(columns, rows)


def _states_table(loop: str, states: Iterable[LoopState]) -> TextTable:
    """Return the states of a loop, a line for each mode and case."""
    columns = [Column("mode", "<"), Column("time, s", spec="g"), Column("case", "<")]
    for quantity, (unit, _) in UNITS[loop].items():
        columns += [
            Column(header, spec=_STATE, group=f"{quantity}, {unit}") for header in ("kernel", "exponential")
        ]
    rows: dict[tuple[str, str], list[Any]] = {}
    for state in states:
        if state.loop == loop:
            row = rows.setdefault((state.mode, state.case), [state.mode, state.time_s, state.case])
            row += [state.run, state.matrix_exponential]
    return TextTable(columns, list(rows.values()))


def loops_image(result: LoopsResult, path: str | Path) -> bytes:
    """Return the courses of the loops over time: the kernel as a line, the matrix exponential dashed."""
    figure, grid = figures.grid_of_axes(len(result.courses), 2, (11.0, 2.9 * len(result.courses)))
    for row, course in zip(grid, result.courses, strict=True):
        quantities = list(UNITS[course.loop].items())
        which = [number for number, (name, _) in enumerate(quantities) if name not in ("velocity", "climb")]
        for axes, number in zip(row, which, strict=True):
            quantity, (unit, factor) = quantities[number]
            colours = figures.several_colours(len(course.cases))
            for k, (case, colour) in enumerate(zip(course.cases, colours, strict=True)):
                axes.plot(course.times, factor * course.run[:, k, number], color=colour, label=case)
                axes.plot(
                    course.times, factor * course.exact[:, k, number], "--", color="0.25", linewidth=0.8
                )
            for end in course.ends[:-1]:
                axes.axvline(course.times[end], color="0.75", linewidth=0.8, zorder=0)
            axes.set_ylabel(f"{quantity}, {unit}")
            axes.set_title(f"{course.loop} loop: {quantity}", loc="left", fontsize=10)
            figures.style(axes)
        row[0].legend(fontsize=8, frameon=False)
    for axes in grid[-1]:
        axes.set_xlabel("time, s")
    figures.title(figure, f"{result.title or 'schedule'}; dashed: matrix exponential")
    return figures.image(figure, path)


@dataclass(frozen=True)
class RestingSensors:
    """Samples of the sensors of a level body at rest, z down."""

    #: In rad/s, axes n
    earth_rate: tuple[float, float, float] = (7.292115e-5, 0.0, 0.0)
    #: In rad/s
    gyro_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    #: In m/s^2
    accelerometer_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    #: Of the flux valve in rad, and of the air data in m
    heading: float = 0.0
    height: float = 0.0

    def samples(self, schedule: LoopSchedule, mode: LoopMode, count: int) -> dict[str, Array]:
        """Return samples of all inputs of ``examples/ahrs.toml`` for cycles of a mode."""
        T = float(schedule.cycle_s)
        force = np.add(self.accelerometer_bias, (0.0, 0.0, -float(schedule.gravity)))
        row = {
            "gyro": T * np.add(self.earth_rate, self.gyro_bias),
            "accelerometer": T * force,
            "airspeed": np.zeros(2),
            "flux_valve": np.array(self.heading),
            "air_height": np.array(self.height),
        }
        for setting in mode.loops:
            loop = setting.loop
            for number, gain in enumerate(mode_gains(schedule, setting), 1):
                row[f"{loop}_k{number}"] = np.array(float(gain))
        return {name: np.broadcast_to(value, (count, *value.shape)) for name, value in row.items()}


def run_modes(
    runner: SystemRunner,
    schedule: LoopSchedule,
    parts: Iterable[tuple[LoopMode, Fraction]],
    sensors: RestingSensors,
    memory: SystemMemory | None = None,
) -> list[SystemRun]:
    """Run a reference system through modes for some time each, one after the other.

    `parts`: with the time in s.
    """
    runs: list[SystemRun] = []
    for mode, seconds in parts:
        count = int(seconds / schedule.cycle_s)
        begin = runs[-1].memory if runs else memory
        runs.append(runner.run(sensors.samples(schedule, mode, count), begin))
    return runs


def tilt(attitude: Array) -> Array:
    """Return the errors of small computed attitudes whose true one is no rotation, C = I + [phi x], (..., 3) in rad."""
    C = np.asarray(attitude, float)
    pairs = ((2, 1), (0, 2), (1, 0))
    return np.stack([(C[..., i, j] - C[..., j, i]) / 2 for i, j in pairs], axis=-1)
