"""Runs an algorithm many times on sensors with errors, and compares the scatter with its prediction in closed form."""

from __future__ import annotations

import math
import pathlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.specific_forces import velocity_increments
from strapgen.lab.runs import attitude, drift_between
from strapgen.lab.sensor_errors import sensor_covariance
from strapgen.lab.sensor_errors.instruments import InstrumentErrors
from strapgen.lab.sensor_errors.sensor_covariance import Path
from strapgen.lab.sensor_errors.sensors import MeasurementUnit, steady
from strapgen.results import figures
from strapgen.results.records import entry, reader_table
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.run.backends import Backend
from strapgen.run.increments import windows

Array = NDArray[np.float64]

#: Records of a run, and most numbers of the increments of runs that are propagated together.
_RECORDS, _TOGETHER = 50, 3_000_000
#: Fewest runs that tell a standard deviation.
FEWEST_RUNS = 10
#: The quantile of the normal distribution at the ends of an interval of 95 %.
_QUANTILE = 1.959963984540054
#: All causes together.
ALL = "all"

_AXES = "xyz"


@dataclass(frozen=True, eq=False)
class SensorScatter:
    """The error of the attitude that sensors cause, over many runs."""

    #: Which errors the sensors have: "all", or one of `CAUSES` alone
    cause: str
    #: 1 where all are the same
    runs: int
    #: (N,): times of the records in s, from after the start to the end
    time: Array
    #: (N, 3): mean and standard deviation over the runs in rad, reference axes; what leads is positive
    mean: Array
    deviation: Array
    #: (N, 3): interval of 95 % of the standard deviation
    low: Array
    high: Array
    #: (N, 3): mean and standard deviation in closed form, to first order
    predicted_mean: Array
    predicted: Array

    @property
    def mean_margin(self) -> Array:
        """Half the width of the interval of 95 % of the mean, (N, 3)."""
        if self.runs < 2:
            return np.zeros_like(self.mean)
        return student_quantile(self.runs - 1) * self.deviation / math.sqrt(self.runs)


class SensorStudy:
    """Runs of an algorithm on sensors with errors."""

    def __init__(self, backend: Backend, path: Path, errors: InstrumentErrors) -> None:
        if not any(errors.causes):
            raise InputError("the sensors have no errors, so that all runs are the same")
        if errors.needs_acceleration and not any(path.force):
            raise InputError("the errors of the gyros depend on acceleration; a specific force is needed")
        backend.need_increments()
        self._backend, self._path, self._errors = backend, path, errors
        count, beside = path.steps * backend.increments, (backend.previous, backend.ahead)
        self._before = beside[0]
        interval = path.step / backend.increments
        self._interval = float(interval)
        self._angle = path.motion.samples(interval, -beside[0], count + beside[1])
        self._velocity = np.zeros_like(self._angle)
        if any(path.force):
            forward = velocity_increments(path.motion.attitude, path.force, interval, count + beside[1])
            self._velocity[beside[0] :] = forward
        self._reference = self._attitudes(self._angle[None])[0]

    def rows(self, runs: int) -> Iterator[SensorScatter]:
        """Yield the scatter of all causes together, and of each alone if there are several."""
        causes = [*self._errors.causes]
        spread = sensor_covariance.covariances(self._path, self._errors)
        for cause in [ALL, *(causes if len(causes) > 1 else [])]:
            alone = self._errors if cause == ALL else self._errors.only(cause)
            of_cause = spread.values() if cause == ALL else [spread[cause]]
            predicted = sum(np.diagonal(each, axis1=1, axis2=2) for each in of_cause)
            yield self._scatter(cause, alone, runs, np.sqrt(predicted))

    def _scatter(self, cause: str, errors: InstrumentErrors, runs: int, predicted: Array) -> SensorScatter:
        same = {*sensor_covariance.STEADY} - ({*sensor_covariance.DRAWN} if errors.drawn else set())
        count = 1 if {*errors.causes} <= same else runs
        drifts = self._drifts(cause, errors, count)
        mean = drifts.mean(axis=0)
        deviation = drifts.std(axis=0, ddof=1) if count > 1 else np.zeros_like(mean)
        low, high = deviation_interval(count - 1) if count > 1 else (1.0, 1.0)
        path = self._path
        time = np.arange(1, path.records + 1) * float(path.step * path.steps) / path.records
        expected = sensor_covariance.error_mean(path, errors)
        return SensorScatter(
            cause, count, time, mean, deviation, low * deviation, high * deviation, expected, predicted
        )

    def _drifts(self, cause: str, errors: InstrumentErrors, count: int) -> Array:
        """Return the errors of the attitude of all runs, (runs, records, 3) in rad.

        Pulses alone would be no noise where the body turns by whole ones: they are what they add to white noise.
        """
        noise = self._errors.only("noise")
        if cause == "pulses" and any(noise.causes):
            both = self._errors.only("noise", "pulses")
            pairs = zip(self._runs(both, count), self._runs(noise, count), strict=True)
            return np.concatenate([one - other for one, other in pairs])
        return np.concatenate([*self._runs(errors, count)])

    def _runs(self, errors: InstrumentErrors, count: int) -> Iterator[Array]:
        """Yield the errors of the attitude of some runs at a time, (runs, records, 3) in rad."""
        together = max(1, _TOGETHER // self._angle.size)
        for first in range(0, count, together):
            rows = [self._measure(errors, run) for run in range(first, min(count, first + together))]
            computed = self._attitudes(np.stack(rows))
            # The drift is positive where the computed frame lags.
            yield -drift_between(computed, self._reference)

    def _measure(self, errors: InstrumentErrors, run: int) -> Array:
        """Return the increments of a run; those from before it have the steady errors alone."""
        unit, before = MeasurementUnit(errors, self._interval, run), self._before
        row, _ = unit(self._angle[before:], self._velocity[before:])
        if not before:
            return row
        history = MeasurementUnit(steady(unit.errors), self._interval)
        return np.concatenate([history(self._angle[:before], self._velocity[:before])[0], row])

    def _attitudes(self, rows: Array) -> Array:
        """Return the attitudes of runs at the records, (runs, records, 3, 3)."""
        backend, beside = self._backend, self._backend.previous + self._backend.ahead
        cut: Any = np.stack([windows(row, backend.increments, beside) for row in rows])
        states = backend.propagate(cut, self._path.steps // self._path.records)
        return attitude(backend, states)[:, 1:]


def records_of(steps: int) -> int:
    """Return the number of records of a run: the largest up to 50 that divides its steps."""
    return max(count for count in range(1, _RECORDS + 1) if steps % count == 0)


def reach(path: Path, errors: InstrumentErrors) -> float:
    """Return a range for the increments of all runs in rad: twice the largest element of the first run."""
    interval = path.step / path.choice.increments_per_step
    angle = path.motion.samples(interval, 0, path.steps * path.choice.increments_per_step)
    velocity = velocity_increments(path.motion.attitude, path.force, interval, len(angle))
    row, _ = MeasurementUnit(errors, float(interval))(angle, velocity)
    return 2 * float(np.abs(row).max())


def student_quantile(degrees: int) -> float:
    """Return the upper end of Student's distribution of so many degrees of freedom that leaves 2.5 % above.

    It is the expansion by Fisher and Cornish, to 0.1 % from five degrees of freedom on.

    >>> round(student_quantile(9), 3), round(student_quantile(99), 3)
    (2.262, 1.984)
    """
    z = _QUANTILE
    terms = (
        (z**3 + z) / 4,
        (5 * z**5 + 16 * z**3 + 3 * z) / 96,
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384,
    )
    return float(z + sum(term / degrees ** (k + 1) for k, term in enumerate(terms)))


def deviation_interval(degrees: int) -> tuple[float, float]:
    """Return the ends of the interval of 95 % of a standard deviation, as factors of the one that was measured.

    The quantiles of chi-square are those of Wilson and Hilferty, to 0.5 % from nine degrees of freedom on.

    >>> [round(end, 2) for end in deviation_interval(99)]
    [0.88, 1.16]
    """
    spread = 2 / (9 * degrees)
    low, high = ((1 - spread + sign * _QUANTILE * math.sqrt(spread)) ** -1.5 for sign in (1, -1))
    return low, high


@dataclass(frozen=True)
class SensorErrorRow:
    """The error of the attitude on one axis at the end of the runs, positive if ahead of perfect sensors."""

    #: Which errors the sensors have: "all", or one kind alone
    cause: str
    #: 1 where all are the same
    runs: int
    axis: str = field(metadata=entry("axis"))
    mean_deg: float = field(metadata=entry("runs", ".4g", group="mean, deg"))
    #: Half the width of the interval of 95 % of the mean
    mean_margin_deg: float = field(metadata=entry("+-", ".4g", group="mean, deg"))
    #: Mean in closed form, to first order
    predicted_mean_deg: float = field(metadata=entry("predicted", ".4g", group="mean, deg"))
    #: Standard deviation over the runs
    deviation_deg: float = field(metadata=entry("runs", ".4g", group="standard deviation, deg"))
    #: Lower end of its interval of 95 %
    low_deg: float = field(metadata=entry("from", ".4g", group="standard deviation, deg"))
    #: Upper end of that interval
    high_deg: float = field(metadata=entry("to", ".4g", group="standard deviation, deg"))
    #: Standard deviation in closed form, to first order
    predicted_deg: float = field(metadata=entry("predicted", ".4g", group="standard deviation, deg"))


@dataclass(frozen=True)
class SensorErrorResult(Result):
    """The errors of the attitude that sensors cause, over many runs and in closed form."""

    drawn_by: ClassVar[str] = f"{__name__}:sensor_image"
    indented = False

    #: The study, with what the errors are along the runs
    scatter: Sequence[SensorScatter] = field(
        metadata=entry(key="rows", write=lambda rows: _rows(rows), kind=list[SensorErrorRow])
    )
    #: File of the sensor errors
    errors: str
    algorithm: str
    method: str | None
    backend: str
    motion: str
    step_s: str = field(metadata=entry(unit="s"))

    def rows(self) -> Sequence[SensorErrorRow]:
        """Return a row for each cause and axis."""
        return _rows(self.scatter)

    def text(self) -> str:
        """Return the table with its head."""
        rows = self.rows()
        causes = [
            f"{row.cause}, {row.runs} runs"
            if row.axis == "x" and row.runs > 1
            else row.cause * (row.axis == "x")
            for row in rows
        ]
        table = reader_table(rows, SensorErrorRow)
        cells = [[cause, *row] for cause, row in zip(causes, table.rows, strict=True)]
        facts = {name: one for name, one in self.as_dict().items() if name != "rows"}
        return "\n".join(
            [
                ", ".join(f"{key} {value}" for key, value in facts.items()),
                f"errors of the attitude after {self.scatter[0].time[-1]:g} s in reference axes, positive if ahead of "
                "a run with perfect sensors;",
                "+-, from and to are intervals of 95 %; predicted to first order, in closed form",
                "",
                *TextTable([Column("", "<"), *table.columns], cells).lines(),
            ]
        )


def _rows(scatter: Sequence[SensorScatter]) -> list[SensorErrorRow]:
    return [
        SensorErrorRow(
            one.cause, one.runs, axis, *(float(np.degrees(part[-1, place])) for part in _parts(one))
        )
        for one in scatter
        for place, axis in enumerate(_AXES)
    ]


def _parts(one: SensorScatter) -> tuple[Array, ...]:
    """Return the parts of a row in rad, (N, 3) each."""
    means = (one.mean, one.mean_margin, one.predicted_mean)
    return *means, one.deviation, one.low, one.high, one.predicted


def sensor_image(result: SensorErrorResult, path: str | pathlib.Path) -> bytes:
    """Return the standard deviations over time with their intervals, and the predicted ones as lines."""
    rows = result.scatter
    whole, parts = rows[0], [row for row in rows[1:] if row.predicted.any() or row.deviation.any()]
    figure, grid = figures.grid_of_axes(1, 3, (11.0, 4.2), sharey=True)
    colours = figures.several_colours(1 + len(parts))
    for place, axes in enumerate(grid[0]):
        for row, colour in zip([whole, *parts], colours, strict=True):
            axes.plot(row.time, np.degrees(row.predicted[:, place]), "-", color=colour, label=row.cause)
            axes.plot(row.time, np.degrees(row.deviation[:, place]), ".", color=colour, markersize=4)
        low, high = np.degrees(whole.low[:, place]), np.degrees(whole.high[:, place])
        axes.fill_between(whole.time, low, high, color=colours[0], alpha=0.2, linewidth=0)
        axes.set_title(f"axis {_AXES[place]}", loc="left", fontsize=10)
        axes.set_xlabel("time, s")
        figures.style(axes)
    grid[0][0].set_ylabel("standard deviation, deg")
    figures.common_legend(figure, [grid[0][0]], loc="outside right center")
    figures.title(figure, "errors of the attitude by sensors: lines predicted, dots of the runs")
    return figures.image(figure, path)
