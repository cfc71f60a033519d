"""A unit with errors on a table with a vertical axis, on the earth: what a calibration of it finds in simulated runs.

For every measurement the unit is fastened in a position; the table stands, turns, or has a heading. True increments are
those of a vehicle that stands and turns, and sensors with errors measure them in one session for each run.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.exceptions import InputError
from strapgen.ir.units import STANDARD_GRAVITY
from strapgen.lab.sensor_errors.instruments import InstrumentErrors
from strapgen.lab.sensor_errors.sensor_covariance import single_units
from strapgen.lab.sensor_errors.sensors import MeasurementUnit
from strapgen.navigation.calibration import (
    PER_DEGREE,
    Calibration,
    HeadingRow,
    PositionsFile,
)
from strapgen.navigation.frame.frame_rates import Earth
from strapgen.navigation.vehicle.controls import Controls, Pulse
from strapgen.navigation.vehicle.vehicle_motions import over_earth

Array = NDArray[np.float64]

#: Causes of errors that a session can have: others change from sample to sample in a way that has no covariance here.
CAUSES = ("bias", "scale", "misalignment", "terms", "warm-up", "heating", "noise")
#: Time between samples in s, which is that of the units too.
_INTERVAL = 1
#: Longest session in s.
_LONGEST = 2_000_000
#: deg/h of a rad/s, and micro-g of a m/s^2.
_DEG_H, _MICRO_G = math.degrees(3600), 1e6 / STANDARD_GRAVITY
#: From SI units to those of coefficients, by the letters of their names.
_FROM_SI = {
    **{"D0": _DEG_H, "B": _DEG_H * STANDARD_GRAVITY, "E": _DEG_H * STANDARD_GRAVITY**2, "K": 1e6, "V0": 1e6},
    **{"A0": _MICRO_G, "M": 1e6, "N": 1e6 * STANDARD_GRAVITY, "G": _MICRO_G * math.radians(1)},
}


def coefficients(errors: InstrumentErrors) -> dict[str, float]:
    """Return the errors of a unit as coefficients in the units of a calibration, by name."""
    si: dict[str, float] = {}
    for triad, bias, linear in ((errors.gyro, "D0", "K"), (errors.accelerometer, "A0", "M")):
        scales = np.diag(triad.scale_plus + triad.scale_minus) / 2 + triad.misalignment
        si |= {f"{bias}_{axis}": value for axis, value in zip("xyz", triad.bias, strict=True)}
        si |= {
            f"{linear}_{'xyz'[row]}{'xyz'[column]}": value for (row, column), value in np.ndenumerate(scales)
        }
        si |= triad.terms
    odd = (errors.gyro.scale_plus - errors.gyro.scale_minus) / 2
    si |= {f"V0_{axis}": value for axis, value in zip("xyz", odd, strict=True)}
    known = ((name, _FROM_SI.get(name.partition("_")[0]), value) for name, value in si.items())
    return {name: float(value * factor) for name, factor, value in known if factor is not None}


@dataclass(frozen=True)
class SimulatedRun:
    """What one run estimates."""

    #: By coefficient, and what of it is not that of the unit
    estimates: dict[str, float]
    errors: dict[str, float]
    #: Errors of the heading in rad, by the first heading and by all; empty without headings
    headings: tuple[float, ...]


class Session:
    """A session at a table with units that have errors, and others that come in by a degree of temperature."""

    def __init__(
        self, file: PositionsFile, errors: InstrumentErrors, per_degree: InstrumentErrors | None = None
    ) -> None:
        per_degree = per_degree or InstrumentErrors()
        for unit, causes, where in (
            (errors, CAUSES, "go with a calibration"),
            (per_degree, CAUSES[:4], "come in by a degree"),
        ):
            for cause in unit.causes:
                if cause not in causes:
                    raise InputError(f"errors of kind {cause} do not {where}; {', '.join(causes)} do")
        self.file, self.drawn = file, errors
        self.per_degree = replace(per_degree, seed=per_degree.seed + 1)  # drawn by themselves
        self.finders = heading_finders(file)
        axes = np.eye(3)
        states = [(np.array(row, float), 0.0, 0.0) for row in file.scheme.positions]
        states += [(axes[axis], float(rate), 0.0) for axis, rate in file.scheme.turns]
        #: Number of measurements whose errors are those of coefficients: positions and turns
        self.measured = len(states)
        states += [(axes[2], 0.0, math.radians(heading)) for heading in file.headings_deg]
        parts, edges = [], [0]
        known: dict[tuple[float, float, int], Array] = {}
        for up, rate, heading in states:
            turns = max(1, round(abs(rate) * file.duration_s / 360))
            seconds = round(turns * 360 / abs(rate)) if rate else file.duration_s
            for asked in ((0.0, heading, file.pause_s), (rate, heading, seconds)):
                if asked not in known:
                    known[asked] = self._increments(*asked)
                parts.append((known[asked].reshape(-1, 2, 3) @ _mounting(up).T).reshape(-1, 6))
                edges.append(edges[-1] + asked[2])
                if edges[-1] * max(1, len(file.temperatures_c)) > _LONGEST:
                    raise InputError(f"the measurements take more than {_LONGEST} s at all temperatures")
        self._true, self._edges = np.concatenate(parts), np.array(edges)
        self._seconds = np.diff(self._edges)[1::2, None] * float(_INTERVAL)

    def _increments(self, rate: float, heading: float, seconds: int) -> Array:
        """Return increments of a table that turns at a rate in deg/s, axes forward, right and down, (seconds, 6)."""
        pulse = (Pulse(-1.0, math.inf, 1.0, -math.radians(rate)),) if rate else ()
        controls = Controls(heading=heading, flat_turns=pulse)
        motion = over_earth("table", math.radians(self.file.latitude_deg), 0.0, 0.0, controls)
        return np.hstack(motion.both_samples(Fraction(_INTERVAL), 0, seconds))

    def _errors(self, unit: MeasurementUnit, times: int = 1) -> Array:
        """Return the mean errors in each measurement, in deg/h and micro-g, of a session some times, (times, N, 6)."""
        true = np.tile(self._true, (times, 1))
        error = (np.hstack(unit(true[:, :3], true[:, 3:])) - true).reshape(times, -1, 6)
        sums = np.add.reduceat(error, self._edges[:-1], axis=1)[:, 1::2]
        return np.asarray(sums / self._seconds * np.repeat([_DEG_H, _MICRO_G], 3))

    @property
    def variances(self) -> dict[str, Array]:
        """The variances of the means by noise, by quantity in squares of its unit, (N, 3)."""
        noises = {
            "rate": self.drawn.gyro.noise * _DEG_H,
            "acceleration": self.drawn.accelerometer.noise * _MICRO_G,
        }
        return {quantity: noise**2 / self._seconds for quantity, noise in noises.items()}

    def heading_rows(self, runs: Sequence[SimulatedRun]) -> list[HeadingRow]:
        """Return the errors of headings in runs, beside those to first order."""
        singles = single_units(self.drawn) if self.drawn.drawn else []
        constants = [self._errors(MeasurementUnit(one, _INTERVAL))[0, self.measured :, :2] for one in singles]
        variances, rows = self.variances["rate"][self.measured :, :2], []
        for place, finder in enumerate(self.finders):
            found = np.degrees([run.headings[place] for run in runs])
            deviation = math.degrees(finder.deviation(variances, constants))
            rows.append(HeadingRow(finder.count, deviation, float(found.mean()), float(found.std(ddof=1))))
        return rows

    def run(self, several: Sequence[Calibration], number: int) -> SimulatedRun:
        """Return what a run estimates; its number decides on the random numbers."""
        unit = MeasurementUnit(self.drawn, _INTERVAL, number)
        slopes = MeasurementUnit(self.per_degree, _INTERVAL, number)
        warmer = np.subtract(self.file.temperatures_c or (0.0,), (self.file.temperatures_c or (0.0,))[0])
        found = self._errors(unit, len(warmer)) + warmer[:, None, None] * self._errors(slopes)
        gained = {f"{name}{PER_DEGREE}": value for name, value in coefficients(slopes.errors).items()}
        truth = coefficients(unit.errors) | gained
        estimates: dict[str, float] = {}
        for one in several:
            first = 0 if one.quantity == "rate" else 3
            estimates |= one.solved(found[:, : self.measured, first : first + 3])
        off = {name: value - truth.get(name, 0.0) for name, value in estimates.items()}
        headings = tuple(finder.error(found[0, self.measured :, :2]) for finder in self.finders)
        return SimulatedRun(estimates, off, headings)


def _mounting(up: Array) -> Array:
    """Return the rotation from axes forward, right and down of the table to those of a unit by its vertical, (3, 3)."""
    beside = np.eye(3)[int(np.argmin(np.abs(up)))]
    forward = beside - up * (beside @ up)
    forward /= np.linalg.norm(forward)
    return np.stack([forward, np.cross(-up, forward), -up], axis=1)


class HeadingFinder:
    """The least squares of a heading from the rates about the level axes, forward and left, with biases if turned."""

    def __init__(self, headings: Array, latitude: float) -> None:
        self.count, self._heading = len(headings), float(headings[0])
        c, s = np.cos(headings - self._heading), np.sin(headings - self._heading)
        ones, zeros = np.ones_like(c), np.zeros_like(c)
        pairs = ((c, s), (-s, c), (ones, zeros), (zeros, ones))[: 4 if self.count > 1 else 2]
        # From rates to the horizontal rate of the earth in axes of the unit at the first heading
        self._inverse = np.linalg.pinv(np.stack([np.ravel(pair) for pair in pairs], axis=1))[:2]
        horizontal = float(Earth.wgs84().rate) * _DEG_H * math.cos(latitude)
        self._rates = horizontal * np.ravel((np.cos(headings), np.sin(headings)))

    def error(self, errors: Array) -> float:
        """Return the error of the heading in rad by errors of the rates in deg/h, (N or more, 2)."""
        ahead, left = self._inverse @ (self._rates + self._rows(errors))
        return math.remainder(math.atan2(left, ahead) - self._heading, math.tau)

    def deviation(self, variances: Array, constants: Sequence[Array] = ()) -> float:
        """Return the standard deviation in rad by variances of the rates, and by errors that runs draw."""
        ahead, left = self._inverse @ self._rates
        weights = (ahead * self._inverse[1] - left * self._inverse[0]) / (ahead**2 + left**2)
        square = sum(
            (float(weights @ self._rows(one)) ** 2 for one in constants), weights**2 @ self._rows(variances)
        )
        return math.sqrt(square)

    def _rows(self, values: Array) -> Array:
        return np.ravel(values[: self.count].T)


def heading_finders(file: PositionsFile) -> list[HeadingFinder]:
    """Return that for the first heading and that for all; none without headings."""
    headings = np.radians(file.headings_deg)
    counts = (1, len(headings)) if len(headings) else ()
    return [HeadingFinder(headings[:count], math.radians(file.latitude_deg)) for count in counts]


def noise_rows(file: PositionsFile) -> list[HeadingRow]:
    """Return the errors of headings by the noise of a file alone."""
    variances = np.full((len(file.headings_deg), 2), file.rate_sigma_deg_h**2)
    return [
        HeadingRow(one.count, math.degrees(one.deviation(variances)), None, None)
        for one in heading_finders(file)
    ]
