"""Flies the filters of this folder on motions over the earth, and draws their errors with the band of 95 %.

    python examples/kalman/flights.py gnss --runs 10 --backend c --plot out/kalman-gnss.svg

Each flight draws its initial errors, its noise and the errors of its sensors as the file of the filter states them. The
navigators of fine-alignment, zero-velocity and gnss take the corrections of their filters in.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from inertial import Array, State, increments, level

import strapgen
from strapgen.lab.sensor_errors.error_file import read as read_errors
from strapgen.lab.sensor_errors.instruments import InstrumentErrors
from strapgen.navigation.vehicle import vehicle_motions as motions
from strapgen.navigation.vehicle.course_file import read_course
from strapgen.navigation.vehicle.vehicle_motion import VehicleMotion
from strapgen.results import figures

FOLDER = Path(__file__).resolve().parent
#: Half the width of the band of 95 %, in standard deviations.
QUANTILE = 1.959963984540054
#: Points of a curve in a picture, about.
_POINTS = 150


@dataclass(frozen=True)
class Flight:
    """Errors of the states in many runs, estimate less truth, and their covariances by the filter."""

    title: str
    states: tuple[str, ...]
    #: (N,): in s
    time: Array
    #: (runs, N, n)
    errors: Array
    #: (runs, N, n, n), or (1, N, n, n) where it is the same in all
    covariances: Array

    @property
    def deviations(self) -> Array:
        """The standard deviations, (runs, N, n) or (1, N, n)."""
        return np.sqrt(np.diagonal(self.covariances, axis1=-2, axis2=-1))

    @property
    def nees(self) -> Array:
        """The normalised squared errors, (runs, N): n on the average where the covariance is right."""
        solved = np.linalg.solve(self.covariances, self.errors[..., None])[..., 0]
        return np.asarray(np.einsum("rki,rki->rk", self.errors, solved))


def fixed_gain(model: Any, steps: int, lost: Any = ()) -> Array:
    """Return the covariances of the errors with gains that were computed before, (steps + 1, n, n).

    `lost`: the steps without a measurement.
    """
    transition, noise, rows = (np.array(part, float) for part in (model.transition, model.Q, model.H))
    gains = {name: np.atleast_2d(rows) for name, rows in model.gains.items()}
    now = np.diag([float(one.deviation) ** 2 for one in model.text.states])
    found = [now]
    for k in range(1, steps + 1):
        now = transition @ now @ transition.T + noise
        for one, row in zip(model.text.measurements, rows, strict=True):
            if k not in lost:
                gain = gains[one.name][min(k, len(gains[one.name])) - 1]
                left = np.eye(len(row)) - np.outer(gain, row)
                now = left @ now @ left.T + float(one.deviation) ** 2 * np.outer(gain, gain)
        found.append(now)
    return np.array(found)


@dataclass(frozen=True)
class Case:
    """What a navigator flies with: many runs on a back end.

    `normal` draws normal numbers of a shape; `errors` are those of the sensors.
    """

    runs: int
    backend: str = "c"
    normal: Callable[[Any], Array] = field(default_factory=lambda: np.random.default_rng(47).standard_normal)
    errors: InstrumentErrors | None = None

    def noisy(self, value: Array, deviation: float) -> Array:
        """Return values with noise of a standard deviation."""
        return value + deviation * self.normal(value.shape)


def inertial(
    model: Any, case: Case, motion: VehicleMotion, hz: int, to_errors: Array, still: bool, steps: int, errors: str,
    measured: Callable[[int, State], dict[str, Array]],
) -> Flight:  # fmt: skip
    """Fly navigators in axes e, which take in what a filter of their errors finds.

    `to_errors` (15, n): errors of attitude, velocity and position in axes e and biases in body axes, of the states.
    `measured`: what the measurements of a step are, of its number and the navigator.
    """
    runs = case.runs
    names, stepper = list(model.states), model.on(case.backend)
    state, covariance = stepper.start(runs=(runs,))
    known = fixed_gain(model, steps) if covariance is None else None
    first = case.normal((runs, len(names))) * [float(one.deviation) for one in model.text.states]
    interval = float(model.text.interval)
    parts = round(interval * hz)
    angle, velocity, biases = increments(
        motion, case.errors or read_errors(FOLDER / errors), hz, steps * parts, runs
    )
    true = State.true(motion, np.zeros(1))
    navigator = true.corrected(-first @ to_errors.T)
    removed, found, covariances = np.zeros((runs, 6)), [], []
    from_errors = np.linalg.pinv(to_errors)
    for k in range(1, steps + 1):
        force, attitude = np.zeros((runs, 3)), np.zeros((runs, 3, 3))
        for sample in range((k - 1) * parts, k * parts):
            before = navigator.attitude
            force += navigator.advance(
                angle[sample] - removed[:, :3] / hz, velocity[sample] - removed[:, 3:] / hz, 1 / hz, still
            )
            attitude += (before + navigator.attitude) / 2
        force, attitude = force / parts, attitude / parts
        vectors = {"force_": force, "up_": level(navigator.position)[0][..., 2]}
        vectors |= {f"c_{axis}": attitude[:, row] for row, axis in enumerate("xyz")}
        values = {
            f"{name}{axis}": value[:, row]
            for name, value in vectors.items()
            for row, axis in enumerate("xyz")
        }
        inputs = {name: values[name] for name in model.inputs}
        state, covariance = stepper.time_update(state, covariance, inputs)
        for name, value in measured(k, navigator).items():
            state, covariance, *_ = stepper.update(name, state, covariance, value, inputs, step=k)
        correction = state @ to_errors.T
        navigator, removed, state = navigator.corrected(correction), removed + correction[:, 9:], 0 * state
        left = np.concatenate(
            [navigator.less(State.true(motion, np.array([k * interval]))), biases - removed], axis=-1
        )
        found.append(left @ from_errors.T)
        covariances.append(stepper.matrix(covariance) if known is None else known[k][None])
    time, errors = interval * np.arange(1.0, steps + 1), np.stack(found, axis=1)
    return Flight(model.text.title, tuple(names), time, errors, np.stack(covariances, axis=1))


def fine_alignment(model: Any, case: Case, latitude_deg: float = 45) -> Flight:
    """Fly an alignment of ten minutes on the spot."""
    motion = motions.great_circle(np.radians(latitude_deg), 0.0, 0.0, np.radians(30), 0.0)
    axes = motion.position(0.0) @ np.array(
        [[0.0, 1, 0], [1, 0, 0], [0, 0, -1]]
    )  # north, east, down in axes e
    body = State.true(motion, 0.0).attitude.T @ axes
    to_errors = np.zeros((15, 7))
    to_errors[0:3, 0:3], to_errors[3:6, 3:5], to_errors[9:12, 5:7] = axes, axes[:, :2], body[:, :2]

    def measured(k: int, navigator: State) -> dict[str, Array]:
        fast = case.noisy(navigator.velocity @ axes[:, :2], 0.01)
        return {"computed_north": fast[:, 0], "computed_east": fast[:, 1]}

    return inertial(model, case, motion, 1, to_errors, True, 600, "laser-gyros.toml", measured)


def zero_velocity(model: Any, case: Case) -> Flight:
    """Drive with stops."""
    motion = read_course(FOLDER / "stops.toml")
    fast = np.linalg.norm(motion.velocity(np.arange(529.0)), axis=-1)

    def measured(k: int, navigator: State) -> dict[str, Array]:
        if fast[k] > 0 or fast[k - 1] > 0:
            return {}
        seen = case.noisy(navigator.velocity, 0.01)
        return {f"still_{axis}": seen[:, row] for row, axis in enumerate("xyz")}

    return inertial(model, case, motion, 10, np.eye(15)[:, :9], False, 528, "noise.toml", measured)


def gnss(model: Any, case: Case) -> Flight:
    """Fly turns to and fro for five minutes, with a receiver once a second."""
    motion = motions.named("s-turns", {})

    def measured(k: int, navigator: State) -> dict[str, Array]:
        if k % 2:
            return {}
        true = State.true(motion, k / 2)
        errors = {
            "position": case.noisy(navigator.position - true.position, 2),
            "velocity": case.noisy(navigator.velocity - true.velocity, 0.05),
        }
        return {
            f"receiver_{name}_{axis}": value[:, row]
            for name, value in errors.items()
            for row, axis in enumerate("xyz")
        }

    return inertial(model, case, motion, 10, np.eye(15), False, 600, "sensors.toml", measured)


def wind(model: Any, case: Case) -> Flight:
    """Fly turns to and fro past a station for a quarter of an hour."""
    motion, runs, steps = motions.named("s-turns", {"height_m": 9000}), case.runs, 900
    time = np.arange(steps + 1.0)
    true = State.true(motion, time)
    axes, _ = level(true.position)
    fast = np.einsum("kij,ki->kj", axes, true.velocity)[:, [1, 0]]  # north and east
    # On the ground, 30 km to the right of the middle of the flight.
    ahead = true.position[-1] - true.position[0]
    beside = true.position[steps // 2] + 3e4 * np.cross(ahead / np.linalg.norm(ahead), axes[steps // 2, :, 2])
    there, height = level(beside)
    away = true.position - (beside - height * there[:, 2])
    slant = np.linalg.norm(away, axis=-1)
    to_station = np.einsum("kij,ki->kj", axes, -away / slant[:, None])[:, [1, 0]]
    ground, moving = (part @ there[:, [1, 0]] for part in (away, true.velocity))
    square = np.sum(ground**2, axis=-1)
    radial_rate = (ground[:, 0] * moving[:, 1] - ground[:, 1] * moving[:, 0]) / square
    # The wind of each run, and accelerations of a levelled reference whose error is white.
    walk = np.concatenate([15 * case.normal((runs, 1, 2)), 0.1 * case.normal((runs, steps, 2))], axis=1)
    air = np.cumsum(walk, axis=1)
    acceleration = case.noisy(np.tile(np.diff(fast, axis=0), (runs, 1, 1)), 0.02)
    through = case.noisy((fast - air)[:, 1:], 1.5)
    range_rate = np.einsum("ki,ki->k", true.velocity, away) / slant
    measurements = {
        "air_north": through[..., 0],
        "air_east": through[..., 1],
        "range_rate": case.noisy(np.tile(range_rate[1:], (runs, 1)), 2),
        "radial_rate": case.noisy(np.tile(radial_rate[1:], (runs, 1)), 5e-4),
    }
    inputs = {
        "acceleration_north": acceleration[..., 0],
        "acceleration_east": acceleration[..., 1],
        "station_north": to_station[1:, 0],
        "station_east": to_station[1:, 1],
        "per_distance": (slant / square)[1:],
    }
    first = np.concatenate([fast[0] + 10 * case.normal((runs, 2)), np.zeros((runs, 2))], axis=-1)
    run = model.run(measurements, inputs, backend=case.backend, initial=first)
    truth = np.concatenate([np.broadcast_to(fast, (runs, steps + 1, 2)), air], axis=-1)
    errors = (run.states - truth)[:, 1:]
    return Flight(model.text.title, tuple(model.states), time[1:], errors, run.covariances[:, 1:])


@dataclass(frozen=True)
class Limits:
    """Innovations in m above which the height alone is corrected, and up to which all is again."""

    above: float = 30.0
    below: float = 5.0


def baro_inertial(model: Any, case: Case, limits: Limits = Limits()) -> Flight:
    """Fly a climb, without the barometer from 200 s to 260 s and on another one, 80 m higher, from 400 s on.

    The error of the height is that from the barometer in use.
    """
    motion, runs, steps = motions.named("climb", {}), case.runs, 2400
    interval, limited = float(model.text.interval), np.zeros(runs)
    stepper, switch = model.on(case.backend), strapgen.evaluator("height-hysteresis", case.backend)
    time = interval * np.arange(steps + 1)
    height, climb = motion.height(time), motion.velocity(time)[:, 2]
    gradient = 2 * 9.80665 / 6378137
    acceleration = np.diff(climb) / interval - gradient * (height[1:] + height[:-1]) / 2
    source = height + np.where(time >= 400, 80.0, 0.0)
    lost = {k for k in range(steps + 1) if 200 <= time[k] < 260}
    first = case.normal((runs, 3)) * [float(one.deviation) for one in model.text.states]
    state, covariance = stepper.start(runs=(runs,))
    state = [height[0], climb[0], 0.0] + first * [1, 1, 0]
    bias, errors = -first[:, 2], []
    for k in range(1, steps + 1):
        sensed = acceleration[k - 1] + bias + 0.01 / np.sqrt(interval) * case.normal(runs)
        state, _ = stepper.time_update(state, covariance, {"acceleration": sensed})
        if k not in lost:
            seen = case.noisy(np.full(runs, source[k]), 3)
            after, _, innovation, _ = stepper.update("barometer", state, covariance, seen)
            limited = np.reshape(switch(limited, innovation, limits.above, limits.below), runs)
            state[:, 0] = after[:, 0]
            state = np.where(limited[:, None] > 0, state, after)
        bias = bias + 2e-4 * np.sqrt(interval) * case.normal(runs)
        errors.append(state - np.stack(np.broadcast_arrays(source[k], climb[k], bias), axis=-1))
    covariances = fixed_gain(model, steps, lost)[None, 1:]
    return Flight(model.text.title, tuple(model.states), time[1:], np.stack(errors, axis=1), covariances)


_DEGREES, _DEG_H, _ARCSEC = (np.degrees(1.0) * factor for factor in (1, 3600, 3600))
#: The flights by the names of their files, and what their pictures show: state, words, unit and factor from SI units.
FLIGHTS: dict[str, tuple[Callable[..., Flight], list[tuple[str, str, str, float]]]] = {
    "fine-alignment": (
        fine_alignment,
        [
            ("tilt_east", "tilt about east", "arcsec", _ARCSEC),
            ("azimuth", "azimuth", "deg", _DEGREES),
            ("gyro_north", "bias of the gyros, north", "deg/h", _DEG_H),
        ],
    ),
    "zero-velocity": (
        zero_velocity,
        [
            ("attitude_x", "attitude, x", "deg", _DEGREES),
            ("velocity_x", "velocity, x", "m/s", 1),
            ("position_x", "position, x", "m", 1),
        ],
    ),
    "gnss": (
        gnss,
        [
            ("attitude_z", "attitude, z", "deg", _DEGREES),
            ("position_x", "position, x", "m", 1),
            ("gyro_x", "bias of the gyro x", "deg/h", _DEG_H),
        ],
    ),
    "wind": (
        wind,
        [
            ("velocity_east", "velocity, east", "m/s", 1),
            ("wind_north", "wind, north", "m/s", 1),
            ("wind_east", "wind, east", "m/s", 1),
        ],
    ),
    "baro-inertial": (
        baro_inertial,
        [("height", "height", "m", 1), ("climb", "climb", "m/s", 1), ("bias", "bias", "mm/s^2", 1e3)],
    ),
}


def fly(name: str, case: Case) -> Flight:
    """Fly an example by its name."""
    return FLIGHTS[name][0](strapgen.kalman(FOLDER / f"{name}.toml"), case)


def draw(name: str, flight: Flight, path: Path) -> None:
    """Draw errors of the runs and the band of 95 % of the first one."""
    figure, grid = figures.grid_of_axes(1, 3, (11, 3.6))
    shown = slice(None, None, max(1, len(flight.time) // _POINTS))
    time = flight.time[shown]
    for axes, (state, label, unit, factor) in zip(grid[0], FLIGHTS[name][1], strict=True):
        place = flight.states.index(state)
        band = QUANTILE * factor * flight.deviations[0, shown, place]
        axes.fill_between(time, -band, band, color="0.88")
        for run in flight.errors[:, shown, place]:
            axes.plot(time, factor * run, color=figures.COLOURS[0], linewidth=0.6)
        axes.set_title(f"{label}, {unit}", loc="left", fontsize=10)
        axes.set_xlabel("time, s")
        axes.set_ylim(*(np.array([-1.6, 1.6]) * max(band[len(band) // 8 :].max(), band[-1])))
        figures.style(axes)
    figures.title(figure, f"{flight.title}: errors of {len(flight.errors)} runs, and the band of 95 %")
    path.write_bytes(figures.image(figure, path))


def main() -> None:
    """Fly an example, print how many errors lie in the band, and draw them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("name", choices=FLIGHTS)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--backend", default="c")
    parser.add_argument("--plot", type=Path)
    options = parser.parse_args()
    if options.runs < 1:
        parser.error(f"--runs is {options.runs}; at least 1 is needed")
    try:
        if options.plot is not None:
            figures.require_kind(options.plot)
        flight = fly(options.name, Case(options.runs, options.backend))
    except strapgen.InputError as error:
        parser.error(str(error))
    inside = np.mean(np.abs(flight.errors) < QUANTILE * flight.deviations, axis=(0, 1))
    print(
        f"{flight.title}, {options.runs} runs: rms errors at the end, deviation by the filter, share in the 95 % band"
    )
    for row, state in enumerate(flight.states):
        error, deviation = np.sqrt(np.mean(flight.errors[:, -1, row] ** 2)), flight.deviations[0, -1, row]
        print(f"  {state:16} {error:10.4g} {deviation:10.4g} {100 * inside[row]:6.1f} %")
    if options.plot is not None:
        draw(options.name, flight, options.plot)


if __name__ == "__main__":
    main()
