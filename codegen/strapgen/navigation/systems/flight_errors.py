"""Errors of a navigator by those of its sensors: many runs, beside a covariance along the motion to first order.

The error equations are those of a navigator whose vertical channel is held, in wander-azimuth axes n of the truth, with
epsilon the error of C_b^n, u that of the horizontal velocity and theta the rotation of C_n^e:

    epsilon' = C dw - (Wn + rho) x epsilon - drho + theta x Wn
    u'       = epsilon x f + C df - (2 Wn + rho) x u - (2 dWn + drho) x v
    theta'   = drho - rho x theta,    drho = (-u_y, u_x, 0)/R,    dWn = -theta x Wn
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from strapgen.cli.progress import track
from strapgen.ir.exceptions import InputError
from strapgen.lab.sensor_error_study import deviation_interval
from strapgen.lab.sensor_errors.instruments import InstrumentErrors
from strapgen.lab.sensor_errors.measured_motions import measured
from strapgen.lab.sensor_errors.sensor_covariance import single_units
from strapgen.lab.sensor_errors.sensors import MeasurementUnit
from strapgen.navigation.systems.system_flight import fly, local_axes
from strapgen.navigation.systems.system_runner import SystemRunner
from strapgen.navigation.vehicle.vehicle_motion import VehicleMotion
from strapgen.results import figures
from strapgen.results.records import INTERNAL, entry, reader_table
from strapgen.results.result import Result

Array = NDArray[np.float64]

#: Causes whose covariance is known here.
CAUSES = ("bias", "scale", "misalignment", "terms", "noise", "random walk")
#: Those of them that differ from run to run even if constants are not drawn.
RANDOM = CAUSES[4:]
#: Longest interval of the covariance in s, and the largest angle of the body in one, in rad.
_LONGEST, _LARGEST = 1.0, 0.05
#: States: epsilon, u, theta, and the walking biases of gyros and accelerometers.
_STATES, _BIASES = 8, 6
#: Records of a study, at most.
_RECORDS = 50
_NAUTICAL_MILE = 1852.0
#: Rows of the result: attitude, velocity and position in axes east, north, up.
_QUANTITIES = (
    *(("attitude", axis, "deg") for axis in ("east", "north", "up")),
    *(("velocity", axis, "m/s") for axis in ("east", "north")),
    *(("position", axis, "m") for axis in ("east", "north")),
)


@dataclass(frozen=True)
class Spread:
    """Covariance of a navigator's errors by cause along a motion."""

    #: (N,): in s
    time: Array
    #: (N, 7, 7) by cause: in the order of attitude in rad, velocity in m/s and position in m, axes east, north, up
    covariances: Mapping[str, Array]

    def deviations(self, cause: str = "all") -> Array:
        """Return the standard deviations of a cause, or of all, (N, 7)."""
        parts = self.covariances.values() if cause == "all" else [self.covariances[cause]]
        return np.asarray(np.sqrt(np.diagonal(sum(parts), axis1=1, axis2=2)))


def records_of(duration: Fraction, cycle: Fraction) -> int:
    """Return the number of records of a run: the largest that divides its cycles."""
    cycles = int(duration / cycle)
    return max(count for count in range(1, _RECORDS + 1) if cycles % count == 0)


def spread(
    motion: VehicleMotion, errors: InstrumentErrors, duration: Fraction, records: int, align: bool = False
) -> Spread:
    """Return the covariance of the errors of a navigator with a held vertical channel, to first order.

    `align`: whether the vertical at the start is that of the sensors.
    """
    for cause in errors.causes:
        if cause not in CAUSES:
            raise InputError(f"errors of kind {cause} have no covariance here; {', '.join(CAUSES)} have one")
    if not {*errors.causes} & {*(CAUSES if errors.drawn else RANDOM)}:
        raise InputError(
            'the sensors are the same in every run; constants = "drawn", noise or a random walk is needed'
        )
    path = _Path(motion, duration, records)
    covariances: dict[str, Array] = {}
    for cause in errors.causes:
        alone = errors.only(cause)
        if cause in RANDOM:
            covariances[cause] = path.of_noise(alone)
        else:
            singles = single_units(alone) if errors.drawn else []
            covariances[cause] = path.of_constants(singles, align)
    return Spread(path.times, covariances)


def _cross(vectors: Array) -> Array:
    """Return the matrices [v x], (N, 3, 3)."""
    return np.swapaxes(np.cross(vectors[:, None, :], np.eye(3)), 1, 2)


class _Path:
    """The error equations along a motion, in intervals whose transition matrices are constant."""

    def __init__(self, motion: VehicleMotion, duration: Fraction, records: int) -> None:
        self.records = records
        self.times = np.arange(1.0, records + 1) * float(duration) / records
        fastest = float(np.linalg.norm(motion.rate(np.linspace(0, float(duration), 2001)), axis=-1).max())
        longest = min(_LONGEST, _LARGEST / max(fastest, 1e-6))
        self.parts = math.ceil(float(duration) / records / longest)
        self.interval = duration / (records * self.parts)
        count, self.step = records * self.parts, float(self.interval)
        self.angle, self.velocity = motion.both_samples(self.interval, 0, count)
        middles = np.asarray((np.arange(count) + 0.5) * self.step, np.float64)
        self.attitudes = motion.navigation_attitude(middles)
        self.transitions = self._transitions(motion, middles)
        self.outputs = self._outputs(motion)

    def _transitions(self, motion: VehicleMotion, times: Array) -> Array:
        """Return the transition matrices of the intervals, (n, 14, 14)."""
        earth, transport = motion.frame_rates(times)
        velocity, count = motion.velocity(times), len(times)
        force = np.einsum("nij,nj->ni", self.attitudes, self.velocity) / self.step
        by_velocity = np.zeros((count, 3, 2))  # of the transport rate
        self.radius = motion.mean_radius(times)
        by_velocity[:, 0, 1], by_velocity[:, 1, 0] = -1 / self.radius, 1 / self.radius
        rates = np.zeros((count, _STATES + _BIASES, _STATES + _BIASES))
        rates[:, 0:3, 0:3] = -_cross(earth + transport)
        rates[:, 0:3, 3:5] = -by_velocity
        rates[:, 0:3, 5:8] = -_cross(earth)
        rates[:, 0:3, 8:11] = self.attitudes
        rates[:, 3:5, 0:3] = -_cross(force)[:, :2]
        turning = -_cross(2 * earth + transport)[:, :2, :2]
        rates[:, 3:5, 3:5] = turning + (_cross(velocity) @ by_velocity)[:, :2]
        rates[:, 3:5, 5:8] = 2 * (_cross(velocity) @ _cross(earth))[:, :2]
        rates[:, 3:5, 11:14] = self.attitudes[:, :2]
        rates[:, 5:8, 3:5] = by_velocity
        rates[:, 5:8, 5:8] = -_cross(transport)
        small = rates * self.step
        return np.asarray(np.eye(_STATES + _BIASES) + small + small @ small / 2)

    def _outputs(self, motion: VehicleMotion) -> Array:
        """Return the matrices from states to errors in axes east, north, up at the records, (records, 7, 8)."""
        position, velocity = motion.position(self.times), motion.velocity(self.times)
        local = local_axes(position) @ position  # from axes n
        radius = motion.mean_radius(self.times)
        inner = np.zeros((self.records, 9, _STATES))
        inner[:, range(3), range(3)] = 1
        inner[:, 2, 7] = 1
        inner[:, [3, 4], [3, 4]] = 1
        inner[:, 3, 7], inner[:, 4, 7] = -velocity[:, 1], velocity[:, 0]
        inner[:, 6, 6], inner[:, 7, 5] = radius, -radius
        turned = np.concatenate([local @ inner[:, 3 * k : 3 * k + 3] for k in range(3)], axis=1)
        return np.asarray(turned[:, [0, 1, 2, 3, 4, 6, 7]])

    def _seen(self, states: Array) -> Array:
        """Return covariances of states at the records, (records, 14, 14), as those of the errors."""
        part = states[:, :_STATES, :_STATES]
        return np.asarray(self.outputs @ part @ np.swapaxes(self.outputs, 1, 2))

    def of_noise(self, errors: InstrumentErrors) -> Array:
        """Return the covariance by white noise and by walking biases."""
        size, rows = _STATES + _BIASES, []
        state = np.zeros((size, size))
        walks = np.zeros((size, size))
        walk = np.concatenate([errors.gyro.random_walk, errors.accelerometer.random_walk])
        walks[range(_STATES, size), range(_STATES, size)] = walk**2 * self.step
        noises = np.zeros((len(self.attitudes), size, size))
        for place, variances in ((0, errors.gyro.noise**2), (3, errors.accelerometer.noise**2)):
            whole = np.einsum("nij,j,nkj->nik", self.attitudes, variances, self.attitudes) * self.step
            width = 3 if place == 0 else 2
            noises[:, place : place + width, place : place + width] = whole[:, :width, :width]
        for number, (transition, noise) in enumerate(zip(self.transitions, noises, strict=True), 1):
            state = transition @ state @ transition.T + noise + walks
            if number % self.parts == 0:
                rows.append(state)
        return self._seen(np.array(rows))

    def of_constants(self, singles: Sequence[InstrumentErrors], align: bool) -> Array:
        """Return the covariance by constants that every run draws: the squares of what each of them does."""
        if not singles:
            return np.zeros((self.records, len(_QUANTITIES), len(_QUANTITIES)))
        size, rows = _STATES + _BIASES, []
        forced = np.zeros((len(self.angle), size, len(singles)))
        for column, single in enumerate(singles):
            angle, velocity = MeasurementUnit(single, self.step)(self.angle, self.velocity)
            turned = np.einsum("nij,nj->ni", self.attitudes, angle - self.angle)
            pushed = np.einsum("nij,nj->ni", self.attitudes, velocity - self.velocity)
            forced[:, 0:3, column], forced[:, 3:5, column] = turned, pushed[:, :2]
        state = np.zeros((size, len(singles)))
        if align:
            gravity = float(np.linalg.norm(self.velocity[0]))
            state[0], state[1] = forced[0, 4] / gravity, -forced[0, 3] / gravity
        for number, (transition, push) in enumerate(zip(self.transitions, forced, strict=True), 1):
            state = transition @ state + push
            if number % self.parts == 0:
                rows.append(state)
        seen = self.outputs @ np.array(rows)[:, :_STATES]
        return np.asarray(seen @ np.swapaxes(seen, 1, 2))


def runs(
    runner: SystemRunner,
    motion: VehicleMotion,
    errors: InstrumentErrors,
    duration: Fraction,
    records: int,
    count: int,
    align: bool = False,
) -> Array:
    """Return what the errors of sensors add in many runs, (runs, records, 7), in the order of `Spread`."""
    record = duration / records
    ideal = fly(runner, motion, duration, record)
    parts = []
    for number in track(range(count), "running", count):
        flight = fly(runner, measured(motion, errors, number), duration, record, align=align).less(ideal)
        parts.append(
            np.column_stack(
                [flight.attitude_error, flight.velocity_error[:, :2], flight.position_error[:, :2]]
            )
        )
    return np.array(parts)


@dataclass(frozen=True)
class FlightErrorRow:
    """Standard deviation of an error at the end of the runs, with its interval of 95 %, and as predicted."""

    quantity: str = field(metadata=entry("", align="<"))
    axis: str = field(metadata=entry("axis", align="<"))
    unit: str = field(metadata=entry("unit", align="<"))
    mean: float = field(metadata=entry("mean", ".4g"))
    deviation: float = field(metadata=entry("runs", ".4g", group="standard deviation"))
    low: float = field(metadata=entry("from", ".4g", group="standard deviation"))
    high: float = field(metadata=entry("to", ".4g", group="standard deviation"))
    predicted: float = field(metadata=entry("predicted", ".4g", group="standard deviation"))


@dataclass(frozen=True)
class CauseDeviation:
    """Predicted standard deviations at the end by a cause: attitude, velocity and position, all axes together."""

    cause: str = field(metadata=entry("cause", align="<"))
    level_deg: float = field(metadata=entry("level, deg", ".4g"))
    heading_deg: float = field(metadata=entry("heading, deg", ".4g"))
    velocity_m_s: float = field(metadata=entry("velocity, m/s", ".4g"))
    position_m: float = field(metadata=entry("position, m", ".4g"))
    nmi_h: float = field(metadata=entry("nmi/h", ".4g", unit="nmi/h"))

    @staticmethod
    def of(cause: str, deviations: Array, hours: float) -> CauseDeviation:
        """Return the row of a cause."""
        level, speed, place = (float(np.hypot(*deviations[first : first + 2])) for first in (0, 3, 5))
        nmi_h = place / _NAUTICAL_MILE / hours
        return CauseDeviation(
            cause, math.degrees(level), math.degrees(float(deviations[2])), speed, place, nmi_h
        )


@dataclass(frozen=True)
class FlightErrorsResult(Result):
    """Errors of a navigator by those of its sensors, in many runs and in closed form."""

    rows_in = "deviations"
    drawn_by: ClassVar[str] = f"{__name__}:flight_errors_image"

    system: str
    errors: str
    motion: str
    duration_s: float
    runs: int
    deviations: list[FlightErrorRow]
    causes: list[CauseDeviation]
    #: (runs, records, 7) and the prediction, for the plot
    measured: Array = field(metadata=INTERNAL)
    predicted: Spread = field(metadata=INTERNAL)

    @staticmethod
    def of(
        facts: Mapping[str, str], duration: Fraction, measured: Array, predicted: Spread
    ) -> FlightErrorsResult:
        """Return the result of runs and their prediction."""
        count = len(measured)
        deviation, mean = measured.std(axis=0, ddof=1)[-1], measured.mean(axis=0)[-1]
        low, high = deviation_interval(count - 1)
        expected = predicted.deviations()[-1]
        rows = []
        for place, (quantity, axis, unit) in enumerate(_QUANTITIES):
            scale = math.degrees(1) if unit == "deg" else 1.0
            values = (
                *(mean[place], deviation[place], low * deviation[place], high * deviation[place]),
                expected[place],
            )
            rows.append(FlightErrorRow(quantity, axis, unit, *(float(scale * value) for value in values)))
        hours = float(duration) / 3600
        names = ["all", *(list(predicted.covariances) if len(predicted.covariances) > 1 else [])]
        causes = [CauseDeviation.of(name, predicted.deviations(name)[-1], hours) for name in names]
        return FlightErrorsResult(
            **facts, duration_s=float(duration), runs=count, deviations=rows, causes=causes,
            measured=measured, predicted=predicted,
        )  # fmt: skip

    def text(self) -> str:
        """Return both tables."""
        return "\n".join(
            [
                f"{self.system} with {self.errors}, {self.motion}, {self.duration_s:g} s, {self.runs} runs",
                "errors at the end less those on ideal sensors; from and to are intervals of 95 %; predicted to first",
                "order in closed form",
                "",
                *reader_table(self.deviations, FlightErrorRow).lines(),
                "",
                "predicted by cause, both horizontal axes together",
                "",
                *reader_table(self.causes, CauseDeviation).lines(),
            ]
        )


def flight_errors_image(result: FlightErrorsResult, path: str | Path) -> bytes:
    """Return the standard deviations of runs as points, with the predicted ones as lines, against time."""
    figure, grid = figures.grid_of_axes(1, 3, (11, 4))
    time, predicted = result.predicted.time, result.predicted.deviations()
    deviation = result.measured.std(axis=0, ddof=1)
    for axes, (name, unit) in zip(
        grid[0], (("attitude", "deg"), ("velocity", "m/s"), ("position", "m")), strict=True
    ):
        scale = math.degrees(1) if unit == "deg" else 1.0
        places = [place for place, (quantity, *_) in enumerate(_QUANTITIES) if quantity == name]
        for place, colour in zip(places, figures.several_colours(3), strict=False):
            label = _QUANTITIES[place][1]
            axes.plot(time, scale * predicted[:, place], color=colour, label=label)
            axes.plot(time, scale * deviation[:, place], ".", color=colour, markersize=5)
        axes.set_title(f"{name}, standard deviation in {unit}", loc="left", fontsize=10)
        axes.set_xlabel("time, s")
        axes.set_ylim(bottom=0)
        axes.legend(fontsize=8, frameon=False)
        figures.style(axes)
    figures.title(
        figure, f"{result.system} with {result.errors}, {result.motion}: {result.runs} runs and covariance"
    )
    return figures.image(figure, path)
