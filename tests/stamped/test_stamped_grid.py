"""Stamped samples on an even grid: the same numbers from every back end, the accuracy, the ends, what is refused."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from numpy.random import default_rng
from scipy.spatial.transform import Rotation

import strapgen
from strapgen import Settings, StampedGrid, StampError, StampStatus
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.stamped import stamped_sources
from strapgen.stamped.boundary_kernels import filters
from strapgen.stamped.grid_clock import GridClock, StampScale
from strapgen.stamped.kernel_names import ROUNDS, WITH_SLOPE
from strapgen.stamped.rounds import pairs_there

#: Ticks of 1 us at a sampling rate that is nominally 200 Hz, with stamps of 32 bits.
CLOCK = (200, 1_000_000)
#: Lengths of recordings: shorter than the start, at its end, and longer than what is held.
LENGTHS = (2, 5, 9, 20, 31, 32, 33, 60, 150)


def recording(count: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return noise as samples, which excites everything, and stamps that wrap."""
    random = default_rng(seed)
    jitter = random.normal(0, 40, count + 1).clip(-200, 200)
    stamps = 5043 * np.arange(count + 1) + jitter.astype(np.int64) + 2**32 - 100_000
    return random.normal(0, 0.03, (count, 3)).clip(-0.12, 0.12), stamps % 2**32


def streamed(grid: StampedGrid, samples: np.ndarray, stamps: np.ndarray) -> np.ndarray:
    """Return the grid of samples that come one by one; the first stamp comes with a sample of no meaning."""
    parts = [grid.push(*pair) for pair in zip(np.concatenate([[[9.0] * 3], samples]), stamps, strict=True)]
    return np.concatenate([*parts, grid.flush()])


@pytest.mark.parametrize("pairs", ROUNDS)
@pytest.mark.parametrize("backend", ["numpy", "c", "c-float", "fixed-model", "c-fixed32"])
def test_samples_one_by_one_have_the_numbers_of_a_whole_recording(backend, pairs):
    grid = StampedGrid(*CLOCK, pairs, 32, backend)
    for count in LENGTHS:
        samples, stamps = recording(count)
        whole = grid.whole(samples, stamps)
        assert whole.samples.shape == (count, 3)
        assert np.array_equal(streamed(grid, samples, stamps), whole.samples), count


@pytest.mark.parametrize("pairs", ROUNDS)
@pytest.mark.parametrize(("first", "second"), [("numpy", "c"), ("fixed-model", "c-fixed32")])
def test_c_has_the_bits_of_the_functions_in_python(first, second, pairs):
    for count in LENGTHS:
        samples, stamps = recording(count, count)
        one, other = (StampedGrid(*CLOCK, pairs, 32, name).whole(samples, stamps) for name in (first, second))
        assert np.array_equal(one.samples, other.samples)


def exact(samples: list[list[int]], offsets: list[Fraction], pairs: tuple[int, int]) -> list[list[Fraction]]:
    """Return the grid of a whole recording in exact arithmetic, one axis after the other."""
    result = []
    for axis in zip(*samples, strict=True):
        estimates = list(map(Fraction, axis))
        for most in pairs:
            e = []
            for place, offset in enumerate(offsets):
                there = pairs_there(place, len(axis) - place, most)
                if not there:
                    e.append(Fraction(0))
                    continue
                rate, slope = filters(there)
                around = [(estimates[place - r - 1], estimates[place + r]) for r in range(there)]
                mean = sum(g * (old + new) for g, (old, new) in zip(rate, around, strict=True))
                if there in WITH_SLOPE:
                    mean += (
                        offset / 2 * sum(k * (new - old) for k, (old, new) in zip(slope, around, strict=True))
                    )
                e.append(offset * mean)
            estimates = [d + before - after for d, (before, after) in zip(axis, pairwise(e), strict=True)]
        result.append(estimates)
    return [list(row) for row in zip(*result, strict=True)]


@cache
def in_integers(pairs: tuple[int, int], seed: int) -> tuple[np.ndarray, list[list[Fraction]], float]:
    """Return a recording's grid in units of fixed point, by the code and exactly, and the stated bound."""
    unit = (
        2.0
        ** -stamped_sources.parts(pairs, "fixed-model", Settings())[pairs[0]].fixed.inputs[0].format.fraction
    )
    random = default_rng(seed)
    _, stamps = recording(40, seed)
    integers = random.integers(-(2**29), 2**29, (40, 3))
    clock = GridClock(StampScale.of(*CLOCK, 32))
    offsets = [Fraction(o, 2**30) for stamp in stamps.tolist() for o in clock.take(stamp)]
    grid = StampedGrid(*CLOCK, pairs, 32, "fixed-model").whole(integers * unit, stamps).samples / unit
    functions = stamped_sources.parts(pairs, "fixed-model", Settings())
    bound = float(stamped_sources.error_bound(pairs, functions) / Fraction(unit))
    return grid, exact(integers.tolist(), offsets, pairs), bound


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("pairs", ROUNDS)
def test_fixed_point_keeps_its_bound_and_the_sum(pairs, seed):
    grid, truth, bound = in_integers(pairs, seed)
    errors = np.array(
        [
            [float(Fraction(a) - b) for a, b in zip(*rows, strict=True)]
            for rows in zip(grid, truth, strict=True)
        ]
    )
    # Rounding errors of one or two units are there, and add up to nothing.
    assert bound / 4 < np.abs(errors).max() <= bound < 2
    assert np.abs(errors.cumsum(axis=0)).max() <= bound / 2
    assert np.array_equal(grid.sum(axis=0), [float(sum(column)) for column in zip(*truth, strict=True)])


def test_doubles_are_those_of_exact_arithmetic_but_for_rounding():
    samples, stamps = recording(50)
    clock = GridClock(StampScale.of(*CLOCK, 32))
    offsets = [Fraction(o, 2**30) for stamp in stamps.tolist() for o in clock.take(stamp)]
    truth = exact([[Fraction(x) for x in row] for row in samples], offsets, ROUNDS[0])
    grid = StampedGrid(*CLOCK, stamp_bits=32).whole(samples, stamps).samples
    assert np.abs(grid - np.array(truth, float)).max() < 1e-16


def test_the_sum_of_all_samples_stays():
    samples, stamps = recording(3000)
    grid = StampedGrid(*CLOCK, stamp_bits=32).whole(samples, stamps).samples
    assert np.abs(grid.sum(axis=0) - samples.sum(axis=0)).max() < 1e-14


class Motion(NamedTuple):
    """A motion whose increments between any instants are known, with the true attitude at an instant."""

    integral: object
    attitude: object


def cone(half_angle_deg: float, hertz: float) -> Motion:
    """Return a cone about z."""
    a, w = np.radians(half_angle_deg), 2 * np.pi * hertz

    def integral(t):
        return np.stack(
            [np.sin(a) * np.cos(w * t), np.sin(a) * np.sin(w * t), -w * (1 - np.cos(a)) * t], axis=-1
        )

    def attitude(t):
        half = np.sin(a / 2)
        return np.stack([half * np.cos(w * t), half * np.sin(w * t), 0 * t, np.cos(a / 2) + 0 * t], axis=-1)

    return Motion(integral, attitude)


def spinning_cone(rate_deg_s: float, half_angle_deg: float, hertz: float) -> Motion:
    """Return a cone whose axis z the body spins about, before it cones."""
    still, a, w, spin = (
        cone(half_angle_deg, hertz),
        np.radians(half_angle_deg),
        2 * np.pi * hertz,
        np.radians(rate_deg_s),
    )

    def integral(t):
        axis = np.stack(
            [np.sin(a) * np.cos(w * t) / w, np.sin(a) * np.sin(w * t) / w, np.cos(a) * t], axis=-1
        )
        return still.integral(t) + spin * axis

    def attitude(t):
        return (
            Rotation.from_rotvec(np.outer(t, [0, 0, spin])) * Rotation.from_quat(still.attitude(t))
        ).as_quat()

    return Motion(integral, attitude)


def random_motion(rate_deg_s: float) -> Motion:
    """Return rates that are sums of 30 cosines below a sixth of 100 Hz, and their attitude by small steps."""
    k = np.arange(1, 31)
    hertz = np.array([0.2 + (50 / 3 - 0.2) * (k * np.sqrt(a) % 1) for a in (2, 3, 5)])
    phases = 2 * np.pi * np.array([k * np.sqrt(b) % 1 for b in (7, 11, 13)])
    size, w = np.radians(rate_deg_s) * np.sqrt(2 / 30), 2 * np.pi * hertz

    def integral(t):
        return size * np.stack(
            [(np.sin(np.outer(t, x) + p) / x).sum(axis=1) for x, p in zip(w, phases, strict=True)], axis=-1
        )

    def attitude(t):
        # Each interval in 16 parts, each by the mean rate and the cross product of the two halves of the increment.
        parts = 16
        times = np.append((t[:-1, None] + np.diff(t)[:, None] * np.arange(parts) / parts).ravel(), t[-1])
        middles = integral((times[1:] + times[:-1]) / 2)
        angles = integral(times)
        first, second = middles - angles[:-1], angles[1:] - middles
        steps = Rotation.from_rotvec(first + second + 2 / 3 * np.cross(first, second))
        for _ in range(4):
            steps = steps[0::2] * steps[1::2]
        states, state = [Rotation.identity()], Rotation.identity()
        for step in steps:
            state = state * step
            states.append(state)
        return Rotation.concatenate(states).as_quat()

    return Motion(integral, attitude)


def drift(
    motion: Motion,
    pairs: tuple[int, int] | None,
    tick_hz: float,
    seed: int,
    jitter: float = 0.01,
    wander_s: float = 0.0,
) -> np.ndarray:
    """Return the drift of window-7-7 in deg/h, in 60 s at 100 Hz.

    Without pairs the samples are taken as they come, for even ones.
    """
    random = default_rng(seed)
    # So long before the 60 s the grid begins, and so long after them it ends.
    beside, count, interval = 320, 6000, 0.01
    k = np.arange(-beside, count + beside + 1)
    instants = (k + jitter * random.standard_normal(len(k)).clip(-4.5, 4.5)) * interval
    if wander_s:
        instants += 0.02 * wander_s / (2 * np.pi) * np.sin(2 * np.pi * k * interval / wander_s)
    stamps = np.round((instants - instants[0]) * tick_hz).astype(np.int64)
    samples = np.diff(motion.integral(instants), axis=0)
    boundaries = instants
    if pairs is not None:
        samples = StampedGrid(100, tick_hz, pairs).whole(samples, stamps).samples
        boundaries = instants[0] + grid_instants(stamps, StampScale.of(100, tick_hz)) / tick_hz
    backend = strapgen.backend("euler", "window-7-7")
    states = backend.propagate(strapgen.gyro.windows(samples[beside - 7 : 7 - beside], 1, 14))
    truth = Rotation.from_quat(motion.attitude(boundaries[beside : beside + len(states)]))
    error = truth.inv() * truth[0] * Rotation.from_quat(states)
    angles = np.degrees(error.as_rotvec())
    return np.polyfit(np.arange(len(angles)) * interval / 3600, angles, 1)[0]


def grid_instants(stamps: np.ndarray, scale: StampScale) -> np.ndarray:
    """Return the boundaries of the grid in ticks."""
    clock, unit = GridClock(scale), 2.0**-scale.shift
    found: list[float] = []
    for stamp in stamps.tolist():
        offsets = clock.take(stamp)
        many = [stamps[k] - o * 2.0**-30 * clock.period * unit for k, o in enumerate(offsets)]
        found += many if len(many) > 1 else [stamp - clock.ahead * unit] * len(many)
    return np.array(found)


MOTIONS = {
    "1/10": lambda: cone(1, 10),
    "1/20": lambda: cone(1, 20),
    "spin": lambda: spinning_cone(60, 0.5, 17),
    "random": lambda: random_motion(200),
}
#: Drift in deg/h, root mean square of four seeds: rows of the accuracy that is asked for, each within 1.5 times.
ACCURACY = [
    ("1/10", (7, 7), 1e9, 8.8e-6),
    ("1/10", (7, 7), 1e6, 2.2e-5),
    ("1/10", (7, 7), 1e5, 2.4e-4),
    ("1/10", (3, 5), 1e9, 2.8e-5),
    ("1/20", (7, 7), 1e9, 1.7e-4),
    ("1/20", (7, 7), 1e6, 2.0e-4),
    ("1/20", (7, 7), 1e5, 1.7e-3),
    ("1/20", (3, 5), 1e9, 8.3e-5),
    ("spin", (7, 7), 1e9, 2.4e-4),
    ("spin", (7, 7), 1e6, 2.4e-4),
    ("spin", (7, 7), 1e5, 5.3e-4),
    ("random", (7, 7), 1e9, 3.3e-4),
    ("random", (3, 5), 1e9, 5.7e-4),
]


def rms_drift(name: str, *arguments: object, **rest: float) -> float:
    """Return the drift of four seeds, of a cone that about its axis."""
    drifts = np.array([drift(MOTIONS[name](), *arguments, seed, **rest) for seed in range(4)])
    drifts = drifts if name == "random" else drifts[:, 2:]
    return float(np.sqrt((drifts**2).sum(axis=1).mean()))


@pytest.mark.parametrize(
    ("name", "pairs", "tick_hz", "stated"),
    [
        row if place in (0, 3) else pytest.param(*row, marks=pytest.mark.long)
        for place, row in enumerate(ACCURACY)
    ],
)
def test_the_drift_is_that_of_even_samples(name, pairs, tick_hz, stated):
    assert rms_drift(name, pairs, tick_hz) < 1.5 * stated


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("1/10", 0.079),
        *(
            pytest.param(*row, marks=pytest.mark.long)
            for row in (("1/20", 0.63), ("spin", 0.097), ("random", 0.089))
        ),
    ],
)
def test_without_a_grid_the_drift_is_that_of_the_jitter(name, found):
    assert rms_drift(name, None, 1e9) == pytest.approx(found, rel=0.15)


@pytest.mark.long
@pytest.mark.parametrize(("name", "most"), [("1/10", 4e-5), ("random", 1.5 * 7.8e-4)])
def test_a_wandering_clock_costs_nothing(name, most):
    assert rms_drift(name, (7, 7), 1e6, jitter=0.005, wander_s=200) < most


@pytest.mark.long
def test_an_hour_at_a_rate_that_is_not_the_nominal_one():
    count = 198 * 3600
    t = np.arange(count + 1) / 198.3
    t += default_rng(5).normal(0, 0.01 / 198.3, len(t)).clip(-0.045 / 198.3, 0.045 / 198.3)
    stamps = np.round(t * 1e6).astype(np.int64) + 2**31
    phases = 2 * np.pi * np.array([7.0, 11.0, 16.0]) * t[:, None]
    samples = np.diff(np.sin(phases) / 50, axis=0)
    whole = StampedGrid(*CLOCK, stamp_bits=32).whole(samples, stamps % 2**32)
    assert 1 / whole.interval == pytest.approx(198.3, rel=1e-7)
    assert whole.halves == pytest.approx((198.3, 198.3), rel=1e-7)
    instants = grid_instants(stamps, StampScale.of(*CLOCK, 32)) / 1e6
    # The stamps leave 0.3 us, 5e-5 of a sample; samples as they come are off by 1 % of themselves and more.
    inner = slice(1, count)
    even = np.diff(
        np.sin(2 * np.pi * np.array([7.0, 11.0, 16.0]) * (instants[:, None] - 2**31 / 1e6)) / 50, axis=0
    )
    assert (
        np.abs(whole.samples[inner] - even[inner])[10:-10].max()
        < 1e-2 * np.abs(samples[inner] - even[inner]).max()
    )


def test_the_grid_is_at_the_mean_rate_with_its_drift():
    samples, stamps = recording(400)
    whole = StampedGrid(*CLOCK, stamp_bits=32).whole(samples, stamps)
    steps = np.diff(stamps) % 2**32
    assert 1 / whole.interval == pytest.approx(400e6 / steps.sum(), rel=1e-12)
    assert whole.halves == pytest.approx((200e6 / steps[:200].sum(), 200e6 / steps[200:].sum()), rel=1e-12)
    assert (
        f"{1 / whole.interval:.6g} Hz, by halves {whole.halves[0]:.6g} and {whole.halves[1]:.6g} Hz"
        in repr(whole)
    )


def test_the_interval_is_the_nominal_one_until_the_grid_begins():
    samples, stamps = recording(40)
    for backend in ("numpy", "c"):
        grid = StampedGrid(*CLOCK, stamp_bits=32, backend=backend)
        assert grid.interval == 0.005
        streamed_so_far = [len(grid.push(*pair)) for pair in zip(samples, stamps[1:], strict=True)]
        assert streamed_so_far == [0] * 31 + [23] + [1] * 8
        assert grid.interval == pytest.approx(0.005043, rel=1e-3)
        assert grid.rate_hz == 1 / grid.interval
        grid.reset()
        assert grid.interval == 0.005


def test_the_first_stamp_may_be_missing():
    samples, stamps = recording(60)
    grid = StampedGrid(*CLOCK, stamp_bits=32)
    assert np.array_equal(
        grid.whole(samples[1:], stamps[1:]).samples, grid.whole(samples, stamps[1:]).samples
    )


@pytest.mark.parametrize("backend", ["numpy", "fixed-model", "c", "c-fixed32"])
def test_a_sample_that_is_refused_changes_nothing(backend):
    samples, stamps = recording(60)
    grid = StampedGrid(*CLOCK, stamp_bits=32, backend=backend)
    whole = grid.whole(samples, stamps).samples
    parts = [grid.push(samples[0], stamps[0])]
    for sample, before, stamp in zip(samples, stamps, stamps[1:], strict=False):
        for wrong in (before, before + 20_000):
            with pytest.raises(StampError) as refusal:
                grid.push(sample, wrong % 2**32)
            assert refusal.value.status == StampStatus.GAP
        if "fixed" in backend:
            with pytest.raises(StampError, match="chosen for at most") as refusal:
                grid.push([0, 0.2, 0], stamp)
            assert refusal.value.status == StampStatus.RANGE
        parts.append(grid.push(sample, stamp))
    assert np.array_equal(np.concatenate([*parts, grid.flush()]), whole)


def test_a_refusal_names_the_place_of_the_stamp():
    samples, stamps = recording(60)
    stamps = stamps + 0
    stamps[50] += 400
    for backend in ("numpy", "c"):
        with pytest.raises(StampError, match=r"^stamp 51: an instant lies .*5 %") as refusal:
            StampedGrid(*CLOCK, stamp_bits=32, backend=backend).whole(samples, stamps)
        assert refusal.value.status == StampStatus.OFFSET
        assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: StampedGrid(*CLOCK, pairs=(5, 5)), "pairs is 5,5; 3,5 or 7,7 is needed"),
        (lambda: StampedGrid(*CLOCK, pairs=3), "pairs is 3"),
        (lambda: StampedGrid(*CLOCK, backend="octave"), "these take stamped samples: numpy, c, c-float"),
        (lambda: StampedGrid(*CLOCK, backend="cc"), "backend"),
        (lambda: StampedGrid(*CLOCK, settings=Settings()), "takes no fixed-point settings"),
        (lambda: StampedGrid(*CLOCK, backend="fixed-model", settings=Settings(16)), "words of 32 bits"),
        (
            lambda: StampedGrid(
                *CLOCK, backend="c-fixed32", settings=Settings.of(sample_hz=200, lsb="0.0175dps")
            ),
            "shifted up to it",
        ),
        (lambda: StampedGrid(*CLOCK).push([0, 0], 1), "sample has shape"),
        (lambda: StampedGrid(*CLOCK).push([0, 0, 0], 1.5), "whole numbers of ticks"),
        (lambda: StampedGrid(*CLOCK).push([[0, 0, 0]], 1), "sample has shape"),
        (lambda: StampedGrid(*CLOCK).whole(np.zeros((9, 3)), np.arange(8)), "N stamps, at least 3"),
        (lambda: StampedGrid(*CLOCK).whole(np.zeros((1, 3)), np.arange(2)), "N stamps, at least 3"),
    ],
)
def test_wrong_arguments_are_refused_in_one_line(make, reason):
    with pytest.raises((InputError, InputTypeError), match=reason) as refusal:
        make()
    assert "\n" not in str(refusal.value)
