"""Where windows do not help: prints the tables of limits of docs/windows.md, each from runs of 60 s at 100 Hz.

Run it with ``python benchmarks/window_limits.py``; it takes some minutes, most of them for the design of filters for
wider bands and for a gyro.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

import strapgen
from strapgen.catalogue.methods.sensor_response import Response
from strapgen.catalogue.methods.window import Window
from strapgen.catalogue.methods.windows import WINDOWS
from strapgen.design.family import FamilyBrief, design
from strapgen.design.filters import responses
from strapgen.lab.motions.motions import IntegratedMotion, Motion
from strapgen.lab.runs import Run, angles, attitude, drift, drift_between, steady_drift
from strapgen.run.backends import Backend
from strapgen.run.increments import pulses

INTERVAL = Fraction(1, 100)
BAND = Fraction(13, 10)
#: The algorithms beside which windows stand: method, samples of a step, samples from before it.
COMBINED, TWO_SAMPLES = ("coning-combined", 3, 3), ("coning-compressed", 1, 1)
#: Seeds of the runs with noise, whose drifts are averaged as root mean squares.
SEEDS = range(8)
Rows = Iterator[tuple[str, ...]]
Array = NDArray[np.float64]


@cache
def stepper(method: str | Window, count: int = 1, previous: int | None = None) -> Backend:
    """Return a step as C in double precision."""
    increments = None if previous is None else count
    return strapgen.backend("euler", method, increments, "c", previous=previous)


@cache
def window(band: str, gyro_hz: str = "") -> Window:
    """Return a window of seven samples on each side for a band in rad a sample, and for a gyro."""
    gyro = (
        Response(frequency_hz=Fraction(gyro_hz), damping=Fraction(7071, 10000), sample_hz=Fraction(100))
        if gyro_hz
        else None
    )
    if band == "1.3" and gyro is None:
        return WINDOWS["window-7-7"]
    brief = FamilyBrief(7, 7, Fraction(band), conditions=2 if gyro else 4, gyro=gyro)
    return replace(design(brief), file="designed here")


@cache
def cone(angle: float, hertz: float) -> Motion:
    """Return a cone of a half-angle in degrees at a frequency."""
    return strapgen.motion("cone", half_angle_deg=angle, frequency_hz=hertz)


@dataclass(frozen=True)
class Measured(Motion):
    """A motion whose samples are measured with errors.

    Parameters
    ----------
    name, parameters
        As of the motion.
    motion : Motion
    measure : callable
        ``measure(interval, first, stop)`` returns what the gyro makes of the samples.
    """

    motion: Motion
    measure: Callable[[Fraction, int, int], Array]

    def samples(self, interval: Fraction, first: int, stop: int) -> Array:
        """Return what is measured of some sampling intervals."""
        return self.measure(interval, first, stop)

    def attitude(self, time: Any) -> Array:
        """Return the true attitude."""
        return self.motion.attitude(time)


def run(
    backend: Backend, motion: Motion, measure: Callable[[Fraction, int, int], Array] | None = None
) -> Run:
    """Run a step on a motion, whose samples may be measured with errors."""
    if measure is not None:
        motion = Measured(motion.name, motion.parameters, motion, measure)
    return strapgen.simulate(backend, motion, INTERVAL * backend.increments, 60)


def at_end(run: Run) -> float:
    """Return the angle from the true attitude at the end of a run, divided by its duration, in deg/h."""
    return float(np.degrees(angles(run)[-1]) / run.time[-1] * 3600)


def shown(value: float) -> str:
    """Return a number as the page shows it."""
    return f"{value:.2g}"


def outside() -> Rows:
    """Cones of 1 degree above the band."""
    for hertz in (22, 24, 30, 40, 45):
        drifts = (
            drift(run(stepper(*method), cone(1, hertz)))
            for method in (("window-7-7",), COMBINED, TWO_SAMPLES)
        )
        yield f"{hertz} Hz", *map(shown, drifts)


def wider_bands() -> Rows:
    """Cones of 1 degree by windows for wider bands than they need."""
    for band in ("1.3", "2", "2.6"):
        chosen = window(band)
        drifts = (drift(run(stepper(chosen), cone(1, hertz))) for hertz in (10, 2))
        yield band, shown(responses.level(chosen, 1)), *map(shown, drifts)


def slow_cones() -> Rows:
    """Slow cones of 1 degree."""
    for hertz in (2, 5):
        methods = (("window-7-7",), ("window-9-9",), COMBINED)
        yield f"{hertz} Hz", *(shown(drift(run(stepper(*method), cone(1, hertz)))) for method in methods)


def noise() -> Rows:
    """White noise on a body at rest, and pulses on a cone."""
    walk = np.radians(0.1) / 60 * np.sqrt(float(INTERVAL))
    still = strapgen.motion("constant", z_deg_s=0)

    def noisy(seed: int) -> Callable[[Fraction, int, int], Array]:
        return lambda _, first, stop: np.random.default_rng(seed).normal(0, walk, (stop - first, 3))

    methods = (("window-7-7",), COMBINED, TWO_SAMPLES)
    spread = (
        np.sqrt(np.mean([at_end(run(stepper(*method), still, noisy(seed))) ** 2 for seed in SEEDS]))
        for method in methods
    )
    yield "white noise of 0.1 °/√h, at rest", *map(shown, spread)
    for arcsec in (5, 0.1):
        size = np.radians(arcsec / 3600)

        def counted(*place: Any, size: float = size) -> Array:
            return pulses(cone(1, 20).samples(*place)[:, None], size)[:, 0]

        drifts = (steady_drift(run(stepper(*method), cone(1, 20), counted)) for method in methods)
        yield f'pulses of {arcsec}", cone of 1° at 20 Hz', *map(shown, drifts)


def jitter() -> Rows:
    """Move the sampling instants by a part of the interval."""
    random = strapgen.motion("random", rate_deg_s=200)
    for motion, name in (
        (cone(1, 10), "cone of 1° at 10 Hz"),
        (cone(1, 20), "cone of 1° at 20 Hz"),
        (random, "random, 200 °/s"),
    ):
        for part in (0.01, 0.001):
            drifts = (
                np.sqrt(np.mean([_jittered(stepper(*method), motion, part, seed) ** 2 for seed in SEEDS]))
                for method in (("window-7-7",), COMBINED)
            )
            yield name, f"{part:.1%}", *map(shown, drifts)


def _jittered(backend: Backend, motion: Motion, part: float, seed: int) -> float:
    def measure(interval: Fraction, first: int, stop: int) -> Array:
        instants = np.arange(first, stop + 1) * float(interval)
        instants += np.random.default_rng(seed).normal(0, part * float(interval), instants.shape)
        if isinstance(motion, IntegratedMotion):
            return np.diff(motion.profile.angle(instants), axis=0)
        middles, widths = (instants[1:] + instants[:-1]) / 2, np.diff(instants)
        return strapgen.evaluator("coning-increments")(middles, widths, *motion.parameters.values())

    return steady_drift(run(backend, motion, measure))  # what an instant alone is off by is no drift


def gyro() -> Rows:
    """Show a vibration of 0.1 degrees to a gyro of 40 Hz."""
    motion = strapgen.motion("vibration", angle_deg=0.1, gyro_hz=40)
    for name, method in (
        ("for the gyro of 40 Hz", (window("1.9", "40"),)),
        ("for one of 40.4 Hz", (window("1.9", "40.4"),)),
        ("for one of 42 Hz", (window("1.9", "42"),)),
        ("for an ideal gyro", ("window-7-7",)),
        ("coning-combined 3+3", COMBINED),
    ):
        yield name, shown(steady_drift(run(stepper(*method), motion)))


def start() -> Rows:
    """Begin a recording with filters of the start that are designed for several noises."""
    cone_attitude = cone(1, 20).attitude(np.arange(6001) / 100)
    for noise in ("0", "1e-5", "3e-4"):
        chosen = replace(
            window("1.3"), start=design(FamilyBrief(7, 7, BAND, start_noise=Fraction(noise))).start
        )
        samples = cone(1, 20).samples(INTERVAL, 0, 6000)
        whole = attitude(stepper("window-7-7"), strapgen.recording_attitudes(chosen, samples, backend="c"))
        off = drift_between(cone_attitude[0] @ whole[:-7], cone_attitude[:-7])
        pulsed = np.sqrt(np.mean([_left_by_pulses(chosen, seed) ** 2 for seed in SEEDS]))
        gain = responses.noise_gain(chosen.start[0], 1)
        yield noise, *map(shown, (gain, np.linalg.norm(off, axis=1).max(), pulsed))


def _left_by_pulses(chosen: Window, seed: int) -> float:
    """Return what a start on pulses of 5 arcsec, in a turn, is off from the run that has samples before it, in rad."""
    turn, size = strapgen.motion("constant", x_deg_s=20, y_deg_s=7, z_deg_s=300), np.radians(5 / 3600)
    samples = turn.samples(INTERVAL, -7, 47)
    samples[0] += np.random.default_rng(seed).uniform(0, size, 3)
    counted = pulses(samples[:, None], size)[:, 0]
    step = stepper("window-7-7")
    before = step.propagate(np.lib.stride_tricks.sliding_window_view(counted, 15, axis=0).swapaxes(1, 2))
    begun = strapgen.recording_attitudes(chosen, counted[7:], backend="c")
    return float(np.linalg.norm(drift_between(attitude(step, begun[40]), attitude(step, before[40]))))


TABLES = {
    "Above the band": (("cone of 1°", "window-7-7", "coning-combined 3+3", "coning-compressed 1+1"), outside),
    "A band wider than needed": (("band, rad", "level of c₁", "cone at 10 Hz", "cone at 2 Hz"), wider_bands),
    "Slow cones": (("cone of 1°", "window-7-7", "window-9-9", "coning-combined 3+3"), slow_cones),
    "Noise": (("", "window-7-7", "coning-combined 3+3", "coning-compressed 1+1"), noise),
    "Jitter": (("motion", "rms of an instant", "window-7-7", "coning-combined 3+3"), jitter),
    "Gyro": (("designed", "drift"), gyro),
    "Start, in rad in place of": (
        ("noise", "noise gain of c₁", "cone of 1° at 20 Hz", 'pulses of 5", turn of 300 °/s'),
        start,
    ),
}


def main() -> None:
    """Print all tables as Markdown."""
    for title, (columns, rows) in TABLES.items():
        print(f"\n{title}, drift in °/h\n")
        print(f"| {' | '.join(columns)} |\n|{'---|' * len(columns)}")
        for row in rows():
            print(f"| {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main()
