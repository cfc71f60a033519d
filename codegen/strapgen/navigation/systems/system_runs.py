"""Runs a described system on a motion or along a recording, and compares its attitude with the true one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np

from strapgen import catalogue
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.signals import CYCLE, Signal
from strapgen.lab.motions.motions import Motion
from strapgen.lab.recordings.recording import History, Recording
from strapgen.lab.runs import Array, Run
from strapgen.lab.runs_report import TIME_COLUMN, RunSettings, places, settings_text, table_of, thinned
from strapgen.lab.sensor_errors.measured_motions import both_increments
from strapgen.navigation.systems.system import Cell, DescribedSystem
from strapgen.navigation.systems.system_runner import SystemMemory, SystemRunner
from strapgen.navigation.systems.wiring import Description
from strapgen.results.records import entry
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.run.backends import evaluator
from strapgen.run.increments import pulses

#: From this departure of the rows' scalar products from those of orthogonal ones on, a matrix is no rotation.
_NO_ROTATION = 0.5
#: Largest denominator of the rate of a recording in Hz.
_DENOMINATOR = 1000


def rate_of(recording: Recording) -> Fraction:
    """Return the samples of a recording in a second, as a number with a small denominator."""
    return Fraction(1 / recording.interval).limit_denominator(_DENOMINATOR)


def attitude_output(system: DescribedSystem) -> Cell:
    """Return the first output that is the attitude of the body."""
    for name in system.outputs:
        cell = system.cell(name)
        if cell.signal.constraint and cell.signal.frame.startswith("b to ") and cell.signal.size in (4, 9):
            return cell
    raise InputError(
        f"system {system.name} has no attitude among its outputs ({', '.join(system.outputs)}); "
        "Euler or Cayley-Klein parameters or direction cosines, frame b to n, are needed"
    )


def matrices(signal: Signal, values: Any) -> Array:
    """Return attitudes of a signal as direction cosine matrices, (N, 3, 3)."""
    rows = np.asarray(values, np.float64).reshape(-1, signal.size)
    if signal.size == 9:
        return rows.reshape(-1, 3, 3)
    return np.asarray(evaluator(f"dcm-from-{parameters(signal)}")(rows))


def parameters(signal: Signal) -> str:
    """Return the kind of an attitude of four elements: the scalar is first in Cayley-Klein parameters."""
    return "cayley-klein" if signal.elements[0].endswith("_s") else "euler"


def attitude_state(signal: Signal, matrix: Array) -> Array:
    """Return an attitude as a signal has it."""
    return matrix if signal.size == 9 else np.asarray(evaluator(f"{parameters(signal)}-from-dcm")(matrix))


def begun(runner: SystemRunner, start: Array | None) -> tuple[SystemMemory, Array]:
    """Return the memory at the start of a run, and the attitude in it as a matrix, (3, 3).

    `start` (3, 3): attitude to begin with in place of that of the description.
    """
    memory = runner.begin()
    cell = attitude_output(runner.system)
    if start is not None:
        runner.set(memory, cell.name, attitude_state(cell.signal, start))
    begin = matrices(cell.signal, [float(value) for value in cell.initial])[0] if start is None else start
    require_rotations(cell.name, np.asarray(begin)[None], np.zeros(1))
    return memory, begin


def require_rotations(name: str, values: Array, time: Array) -> None:
    """Refuse attitudes that are no rotations, which have no drift.

    `values` has shape (N, 3, 3). `time` (N,): in s.
    """
    off = np.abs(values @ np.swapaxes(values, 1, 2) - np.eye(3)).max(axis=(1, 2))
    wrong = np.flatnonzero(~(off < _NO_ROTATION))
    if len(wrong):
        place = int(wrong[0])
        raise InputError(
            f"the attitude {name} is no rotation at {time[place]:.6g} s: its rows are {off[place]:.3g} from orthogonal "
            "ones of length 1"
        )


def simulate_system(
    runner: SystemRunner,
    motion: Motion,
    duration: Fraction,
    record: Fraction | None = None,
    start: Array | None = None,
    force: tuple[float, ...] = (0.0, 0.0, 0.0),
) -> Run:
    """Run a system on a motion with a known attitude.

    The truth is the attitude of the motion, after `start` if that is stated, whatever the system begins with. The
    navigation frame rests, so that a system that follows the rotation of the earth departs by that rotation.

    `duration`: in s; a whole number of cycles of the slowest rate. `record`: time from one record to the next
    in s, a multiple of the cycle of the attitude; by default that cycle. `start` (3, 3): attitude at the start;
    by default that of the description. `force`: specific force in m/s^2, constant in reference axes.
    """
    system, cell = runner.system, attitude_output(runner.system)
    cycles, interval = cycles_of(system, duration), 1 / system.sample_hz
    cycle = system.every(cell.name) * interval
    thinning = 1 if record is None else checks.multiple("record", record, "cycle of the attitude", cycle)
    memory, begin = begun(runner, start)

    def attitude(time: Array) -> Array:
        true = np.asarray(motion.attitude(time))
        return true if start is None else start @ true

    angle, velocity = both_increments(motion, attitude, force, interval, cycles)
    records, seen = [], 0
    for run in runner.blocks(samples(runner.fit.description, angle, velocity), memory):
        values = run.values[cell.name]
        records.append(values[(thinning - 1 - seen) % thinning :: thinning])
        seen += len(values)
    states = matrices(cell.signal, np.concatenate(records))
    if not np.isfinite(states).all():
        raise InputError(f"the attitude {cell.name} is not finite; the increments are too large")
    computed = np.concatenate([begin[None], states])
    time: Array = np.arange(len(computed), dtype=np.float64) * float(cycle * thinning)
    require_rotations(cell.name, computed, time)
    true = attitude(time)
    return Run(time, computed, true, *evaluator("error-matrix")(computed, true))


def system_history(runner: SystemRunner, recording: Recording, start: Array | None = None) -> History:
    """Run a system along recorded increments of gyros, without specific force unless the recording has it.

    `start` (3, 3): attitude at the start; by default that of the description.
    """
    cell = attitude_output(runner.system)
    memory = None if start is None else begun(runner, start)[0]
    begin = np.array(
        [float(value) for value in cell.initial] if start is None else attitude_state(cell.signal, start)
    )
    begin = begin.reshape(1, *cell.signal.shape)
    course = system_course(runner, recording, memory)
    step = runner.system.every(cell.name) * recording.interval
    values = course.values[cell.name]
    time: Array = recording.start + step * np.arange(1 + len(values), dtype=np.float64)
    states = np.concatenate([begin, values])
    return History(time, states, step, course.unused, cell.signal.elements)


@dataclass(frozen=True)
class SystemCourse:
    """The outputs of a system along a recording."""

    system: DescribedSystem
    #: Time at which the first sample begins, and from sample to sample, in s
    start: float
    interval: float
    #: (times, shape): each output after each of its cycles
    values: dict[str, Array]
    #: Samples at the end that fill no cycle of the slowest rate
    unused: int

    def rows(self) -> tuple[Array, dict[str, Array]]:
        """Return the ends of the cycles of the slowest output in s, and all outputs at these times."""
        slowest = max(self.system.every(name) for name in self.values)
        rows = {
            name: values[slowest // self.system.every(name) - 1 :: slowest // self.system.every(name)]
            for name, values in self.values.items()
        }
        count = len(next(iter(rows.values())))
        return self.start + self.interval * slowest * np.arange(1.0, count + 1), rows


def system_course(
    runner: SystemRunner, recording: Recording, memory: SystemMemory | None = None
) -> SystemCourse:
    """Run a system along a recording, one increment of the sensors for each cycle of the samples."""
    cycles, unused = divmod(len(recording.samples), runner.system.cycle)
    if not cycles:
        raise InputError(
            f"the recording holds {len(recording.samples)} increments; a cycle of the slowest rate needs "
            f"{runner.system.cycle}"
        )
    count = cycles * runner.system.cycle
    angle = np.asarray(recording.samples[:count])
    velocity = np.asarray(getattr(recording, "velocity_increments", np.zeros_like(angle))[:count])
    run = runner.run(samples(runner.fit.description, angle, velocity), memory)
    return SystemCourse(runner.system, recording.start, recording.interval, dict(run.values), unused)


#: What an input can measure, by its unit: which increments, and whether they are divided by the cycle.
_UNITS = {"rad": (0, False), "rad/s": (0, True), "m/s": (1, False), "m/s^2": (1, True)}


def samples(description: Description, angle: Array, velocity: Array) -> dict[str, Array]:
    """Return samples of a system's inputs from exact increments in body axes.

    An input takes increments, or mean rates and accelerations over a cycle, by its unit. One of counts takes whole
    counts of the scale that the stage has to which it is wired, angle-counts or velocity-counts; what is left over goes
    into the next count. Where a stage compensates the errors of a measurement unit, the sensors have these errors: the
    kernel that is its inverse makes them. The navigation frame rests: an input of its rotation is zero.

    `angle, velocity` (cycles, 3): increments in rad and m/s, body axes. Returns (cycles, 3).
    """
    system = description.system
    sensed = _with_errors(description, angle, velocity)
    result = {}
    for signal in system.inputs:
        if signal.shape == (3,) and signal.frame == "n" and signal.unit in ("rad", "rad/s"):
            result[signal.name] = np.zeros_like(angle)
            continue
        unit, scale = _measured(description, signal)
        if signal.frame != "b" or signal.shape != (3,) or unit not in _UNITS:
            raise InputError(
                f"input {signal.name} (unit {signal.unit}, frame {signal.frame or 'none'}) is no gyro or "
                "accelerometer in body axes; rad, rad/s, m/s, m/s^2 or counts with a constant scale are needed"
            )
        which, divided = _UNITS[unit]
        exact = sensed[which] * (float(system.sample_hz) if divided else 1.0)
        result[signal.name] = exact if scale is None else np.rint(pulses(exact[:, None], scale)[:, 0] / scale)
    return result


def _with_errors(description: Description, angle: Array, velocity: Array) -> tuple[Array, Array]:
    """Return increments with the errors that the system compensates."""
    for stage in description.system.stages:
        if stage.kernel.startswith("imu-compensate"):
            constants = dict(description.choices[stage.name].constants)
            errors = evaluator(catalogue.choose("imu-errors", constants=constants))
            measured: tuple[Array, Array] = errors(angle, velocity)
            return measured
    return angle, velocity


def _measured(description: Description, signal: Signal) -> tuple[str, float | None]:
    """Return the unit of a measured input, and the size of a count."""
    if signal.unit != "1" or signal.over != CYCLE:
        return signal.unit, None
    for stage in description.system.stages:
        takes = any(wire.external and wire.source == signal.name for wire in stage.wires)
        scale = dict(description.choices[stage.name].constants).get("scale")
        if takes and scale is not None and len(scale) == 1:
            return description.programs[stage.name].outputs[0].signal.unit, float(scale[0])
    return signal.unit, None


def cycles_of(system: DescribedSystem, seconds: Fraction) -> int:
    """Return the cycles of the samples in a time."""
    cycles = seconds * system.sample_hz
    if cycles > checks.MOST:
        raise InputError(
            f"a duration of {float(seconds):.3g} s has too many cycles of {float(1 / system.sample_hz):g} s; "
            f"up to {checks.MOST:,} are run"
        )
    if cycles.denominator != 1 or cycles % system.cycle or not cycles:
        raise InputError(
            f"{float(seconds):g} s are no whole number of cycles of the slowest rate, "
            f"{float(system.cycle / system.sample_hz):g} s"
        )
    return int(cycles)


@dataclass(frozen=True)
class SystemRecords:
    """The outputs of a system along a recording."""

    #: Samples at the end that fill no cycle of all rates
    unused_samples: int
    time_s: Array
    #: Unit of each output
    units: dict[str, str]
    #: The outputs at each time
    outputs: dict[str, Array]

    @staticmethod
    def of(course: SystemCourse) -> SystemRecords:
        """Return the records of a course."""
        time, outputs = course.rows()
        return SystemRecords(
            course.unused, time, {name: signal.unit for name, signal in _signals(course).items()}, outputs
        )


def _signals(course: SystemCourse) -> dict[str, Signal]:
    return {name: course.system.cell(name).signal for name in course.rows()[1]}


@dataclass(frozen=True)
class SystemCourseResult(Result):
    """The outputs of a described system along an inertial recording."""

    indented = False

    settings: Mapping[str, Any] = field(metadata=entry(spread=True, kind=RunSettings))
    course: SystemCourse = field(metadata=entry(spread=True, write=SystemRecords.of, kind=SystemRecords))

    def rows(self) -> Any:
        """Return the records of the course, as their times."""
        return self.course.rows()[0]

    def table(self) -> TextTable:
        """Return the elements of all outputs at each time."""
        time, outputs = self.course.rows()
        names = [
            f"{name}_{element}" if signal.unit == "1" else f"{name}_{element}, {signal.unit}"
            for name, signal in _signals(self.course).items()
            for element in places(signal)
        ]
        values = np.column_stack([time, *(part.reshape(len(time), -1) for part in outputs.values())])
        return table_of(["time_s", *names], values.tolist())

    def text(self) -> str:
        """Return each output at most of the times that a reader looks at."""
        (time, outputs), signals = self.course.rows(), _signals(self.course)
        shown = thinned(len(time))
        lines = [settings_text({**self.settings})]
        for name, part in outputs.items():
            signal, flat = signals[name], part.reshape(len(time), -1)
            columns = [TIME_COLUMN, *(Column(p, spec=".9g", least=15, gap=1) for p in places(signal))]
            lines += ["", f"{name}, unit {signal.unit}{f', frame {signal.frame}' if signal.frame else ''}"]
            lines += TextTable(columns, np.column_stack([time, flat])[shown].tolist()).lines()
        if len(shown) < len(time):
            lines.append(f"({len(shown)} of {len(time)} rows; --format csv prints all)")
        if self.course.unused:
            lines.append(
                f"{self.course.unused} samples at the end fill no cycle of all rates and were not used"
            )
        return "\n".join(lines)
