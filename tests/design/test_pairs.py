"""Pairs, two filters whose product is the coning response: rationals, files, generated code, what commits late."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import strapgen
from strapgen import CommitLate, choose, derive, lower, recording_attitudes
from strapgen.catalogue.methods import windows
from strapgen.catalogue.methods.sensor_response import parse
from strapgen.catalogue.methods.window import Window
from strapgen.catalogue.methods.windows import WINDOWS
from strapgen.design import family
from strapgen.design.commit_late.commit_late_sources import sources
from strapgen.design.commit_late.late_filters import LateFilters
from strapgen.design.commit_late.late_unit import SampleKind
from strapgen.design.family import FamilyBrief, commit_filters, design
from strapgen.design.filters import band_grid, exchange, responses
from strapgen.design.filters.band_grid import ONE, REAL, BandGrid, mean_points
from strapgen.design.filters.filter_taps import Shape, Unknowns, in_words, rounded
from strapgen.ir.exceptions import InputError
from strapgen.lab.runs import drift

BAND = Fraction(13, 10)
#: Taps of the pair of 8 and 6 from a second implementation, by a linear programme on a grid, whose taps are known to
#: some 1e-7; v has one in the middle. Levels of the product and of v, in the digits that are known.
U = (
    0.48400678,
    -0.19783158,
    0.083132519,
    -0.031131120,
    0.0096198434,
    -0.0022685726,
    3.6116306e-4,
    -2.9078419e-5,
)
V = (-0.17623584, 0.0057507577, -0.0012053007, 2.9276316e-4, -6.2560134e-5, 9.7248226e-6, -8.0011647e-7)
LEVELS = 1.85e-9, 5.6e-10

#: Multiplications and additions of a sample, and drifts in deg/h over 30 s at 100 Hz on cones of 1 deg at 10 and 20 Hz,
#: of 5 deg at 5 Hz and of 15 deg at 20 Hz, by another program.
TABLE = {
    "pair-1-7": (137, 137, 6.3e-6, 2.0e-4, 1.1e-4, 1.2),
    "pair-1-8": (143, 149, 3.3e-6, 3.1e-5, 1.6e-5, 1.1),
    "pair-1-9": (149, 161, 4.3e-7, 1.9e-5, 2.3e-6, 1.1),
    "pair-2-5": (65.5, 64, 2.9e-4, 4.9e-3, 4.7e-4, 190),
    "pair-2-7": (71.5, 76, 1.2e-5, 3.5e-3, 9.1e-6, 190),
}
CONES = (1, 10), (1, 20), (5, 5), (15, 20)
FAST = ("pair-1-8", "pair-2-7")
ROWS = [name if name in FAST else pytest.param(name, marks=pytest.mark.long) for name in TABLE]
PAIRS = pytest.mark.parametrize("name", ["pair-1-5", *TABLE])

#: A pair of three samples a step, with little to design.
SMALL = FamilyBrief(2, 2, BAND, taps=(3, 2), increments=3, degree=2)


def for_gyro(words: str, taps: tuple[int, int]) -> FamilyBrief:
    gyro = parse("gyro", words).at(Fraction(100))
    return FamilyBrief(max(taps), max(taps), BAND, taps=taps, gyro=gyro, degree=2)


def lever(window: Window) -> list[Fraction]:
    """Return the filter v = F_2/30 - F_0/6, the oldest sample first."""
    return [
        second / 30 - first / 6 for first, second in zip(window.filters[0], window.filters[2], strict=True)
    ]


# The design


def test_the_taps_are_those_of_another_program():
    window = WINDOWS["pair-1-8"]
    assert np.array(window.filters[1][9:], float) == pytest.approx(U, abs=1e-7)
    v = lever(window)[8:]
    assert np.array(v[:7], float) == pytest.approx(V, abs=1e-8)
    assert v[7:] == [0, 0]
    assert responses.level(window, 1) == pytest.approx(LEVELS[0], rel=2e-3)
    assert responses.level(window, 2) / 30 == pytest.approx(LEVELS[1], rel=2e-3)


@PAIRS
def test_conditions_of_both_filters_hold_exactly(name):
    window = WINDOWS[name]
    count, v = window.increments, lever(window)
    middle = Fraction(2 * window.previous + count - 1, 2)
    times = [place - middle for place in range(window.total_increments)]
    half = Fraction(1, 2)
    # Increments of the rates t^k, t from the middle of the step in samples.
    rates = [[((t + half) ** (k + 1) - (t - half) ** (k + 1)) / (k + 1) for t in times] for k in range(4)]
    sums = [
        [sum(a * b for a, b in zip(row, rate, strict=True)) for rate in rates]
        for row in (window.filters[1], v)
    ]
    assert sums[0] == [0, Fraction(count**2, 2), 0, Fraction(3 * count**4, 40)]
    assert sums[1] == [-Fraction(count, 6), 0, -Fraction(count**3, 120), 0]
    windows.verify(window)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_coning_is_the_sum_of_the_products_of_legendre_coefficients(count):
    grid = BandGrid([REAL.mpf(b) / 10 for b in (0, 1, 7, 13, 29)], 2, increments=count)
    total = [0] * 5
    for m in range(14):
        # In c_m x c_(m+1) the coefficient of odd degree is the second factor for even m.
        for place, (one, other) in enumerate(zip(grid.bessel(m), grid.bessel(m + 1), strict=True)):
            total[place] += (-1) ** (m + 1) * one * other // ONE // (2 * (2 * m + 1) * (2 * m + 3))
    assert [value / ONE for value in grid.coning()] == pytest.approx(
        [value / ONE for value in total], rel=1e-12
    )


@pytest.mark.parametrize("name", ["pair-1-8", "pair-2-7"])
def test_the_product_alternates_as_the_best_one_does(name):
    window = WINDOWS[name]
    count, v = window.increments, np.array(lever(window), float)
    b = np.linspace(1e-3, 1.3, 20001)
    times = np.arange(window.total_increments) - window.previous - (count - 1) / 2
    sinc = np.sinc(b / (2 * np.pi))
    u = sinc * (np.sin(np.outer(b, times)) @ np.array(window.filters[1], float))
    error = -(count * b - np.sin(count * b)) / (2 * b**2) - u * sinc * (np.cos(np.outer(b, times)) @ v)
    free = sum(tap != 0 for tap in window.filters[1]) // 2 - 2
    places = exchange.alternating(error.tolist(), free + 1)
    level = responses.level(window, 1)
    assert places is not None
    # Rounding is 1e-16 of numbers near 1.
    assert [abs(error[k]) for k in places] == pytest.approx([level] * (free + 1), rel=1e-5)
    assert abs(error).max() <= level * (1 + 1e-5)


@pytest.mark.parametrize("increments", [1, 3])
def test_two_grids_give_the_same_rationals(increments):
    side = 3 - increments // 2
    lever: tuple[Fraction, ...] | None = None
    for m in (2, 1):
        unknowns = Unknowns(Shape(side, side, 4, None, increments, pair=True), m)
        one, other = (
            rounded(unknowns, exchange.minimax_filter(unknowns, BAND, points, lever).taps)
            for points in (1200, 1700)
        )
        assert one == other
        lever = tuple(tap / 30 for tap in one)


@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.long) for name in TABLE])
def test_a_built_in_pair_is_designed_again_alike(name):
    window = WINDOWS[name]
    taps = [sum(tap != 0 for tap in row) // 2 for row in (window.filters[1], lever(window))]
    brief = FamilyBrief(
        window.previous, window.ahead, BAND, taps=(taps[0], taps[1]), increments=window.increments
    )
    again = design(brief)
    assert again.filters == window.filters
    for ours, theirs in ((again.one_sided, window.one_sided), (again.start, window.start)):
        assert [one.filters for one in ours] == [one.filters for one in theirs]


def test_noise_makes_the_filters_smaller():
    quiet, noisy = (design(replace(SMALL, noise=noise)) for noise in (Fraction(1, 10**6), Fraction(1)))
    best = design(SMALL)
    assert noisy.objective == "mean square"
    for m in (1, 2):
        assert responses.noise_gain(noisy, m) < responses.noise_gain(quiet, m)
        assert responses.level(best, m) < responses.level(quiet, m) < responses.level(noisy, m)


def test_the_mean_square_error_of_the_product_is_least():
    window = design(replace(SMALL, noise=Fraction(1, 10**12)))
    points = [float(b) for b in mean_points(BAND)]
    (direction,) = Unknowns(Shape(2, 2, 4, None, 3), 1).directions
    move = Unknowns(Shape(2, 2, 4, None, 3), 1).taps(direction)

    def mean(size: Fraction) -> float:
        first = tuple(tap + size * one for tap, one in zip(window.filters[1], move, strict=True))
        moved = replace(window, filters=(window.filters[0], first, window.filters[2]))
        return float(np.mean(responses.errors(moved, 1, points) ** 2))

    # The parabola has its least value in the middle of the two.
    low, middle, high = (mean(Fraction(k, 10000)) for k in (-1, 0, 1))
    assert middle < min(low, high) and abs(high - low) < 1e-4 * (high + low - 2 * middle)


# For the response of a sensor


@pytest.mark.parametrize("taps", [(4, 3), (3, 4)])
def test_conditions_hold_for_points_of_the_rate(taps):
    window = commit_filters(for_gyro("instants", taps))
    # A sample is the rate as its interval begins, times its length.
    begins = [Fraction(place - window.previous) - Fraction(1, 2) for place in range(9)]
    rows = window.filters[0], window.filters[1], lever(window)
    sums = [[sum(a * t**k for a, t in zip(row, begins, strict=True)) for k in range(4)] for row in rows]
    third = Fraction(1, 12)
    assert sums == [
        [1, 0, third, 0],
        [0, Fraction(1, 2), 0, Fraction(3, 40)],
        [-Fraction(1, 6), 0, -Fraction(1, 120), 0],
    ]
    assert [sum(tap != 0 for tap in row) for row in rows] == [9, 2 * taps[0] + 1, 2 * taps[1] + 1]
    windows.verify(window)


@pytest.mark.parametrize("noise", [0, Fraction(1, 10**5)], ids=["minimax", "mean-square"])
def test_the_product_is_that_of_coning_behind_the_response(noise):
    brief = replace(for_gyro("bessel:4:30", (4, 4)), noise=Fraction(noise))
    window, ideal = commit_filters(brief), commit_filters(replace(brief, gyro=None))
    b = np.linspace(1e-3, 1.3, 501)
    shown = np.sinc(b / (2 * np.pi)) * window.gyro.gain(b * 100 / (2 * np.pi))
    turns = np.exp(1j * np.outer(b, np.arange(9) - 4))

    def drifts(one: Window) -> float:
        u, v = (shown * (turns @ np.array(row, float)) for row in (one.filters[1], lever(one)))
        return float(np.abs((u * v.conj()).imag + (b - np.sin(b)) / (2 * b**2)).max())

    assert drifts(window) < 1.01 * responses.level(window, 1) < drifts(ideal) / 20


def test_u_makes_up_for_what_a_short_v_misses():
    window = commit_filters(for_gyro("bessel:4:30", (5, 2)))
    assert responses.level(window, 1) < 1e-5 < 1e-3 < responses.level(window, 2) / 30


def test_the_least_mean_square_error_is_the_same_on_two_grids(monkeypatch):
    brief = replace(for_gyro("butterworth:4:40", (3, 3)), noise=Fraction(1, 10**4))
    rows = []
    for points in (400, 700):
        monkeypatch.setattr(band_grid, "MEAN_POINTS", points)
        band_grid.mean_grid.cache_clear()
        rows.append(family._designed(brief, (3, 3), Fraction(0)))
    band_grid.mean_grid.cache_clear()
    assert rows[0] == rows[1]


def test_a_pair_for_a_response_is_written_and_read_back(tmp_path):
    window = design(for_gyro("bessel:3:60+delay:0.001", (3, 2)))
    (tmp_path / "w.toml").write_text(family.written(window, "a command"))
    assert windows.read(tmp_path / "w.toml") == window
    assert window.gyro.words == "bessel:3:60+delay:0.001"


def test_words_hold_a_pair_by_its_product():
    window = WINDOWS["pair-1-5"]
    words = in_words(window, 18)
    assert all((tap * 2**18).denominator == 1 for row in words.filters for tap in row)
    alone = replace(in_words(replace(window, form="legendre"), 18), form="pair")
    assert responses.level(words, 1) < responses.level(alone, 1)


# Files and the command


def test_a_file_of_a_pair_is_written_and_read_back(tmp_path):
    window = design(SMALL)
    (tmp_path / "w.toml").write_text(family.written(window, "a command"))
    again = windows.read(tmp_path / "w.toml")
    assert again == window and again.form == "pair" and {one.form for one in again.one_sided} == {"legendre"}
    assert {one.rotation for one in (*again.one_sided, *again.start)} == {"exact"} != {again.rotation}


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (
            ('\n  ["0", "0", "1", "1"', '\n  ["0"],\n  ["0", "0", "1", "1"'),
            "filters has 4 rows; a pair has 3",
        ),
        (('form = "pair"', 'form = "two"'), "form 'two' is not known; allowed: legendre, pair"),
    ],
)
def test_a_file_that_is_no_pair_is_refused(changed, message, tmp_path):
    text = family.written(design(SMALL), "a command")
    assert changed[0] in text
    (tmp_path / "w.toml").write_text(text.replace(*changed, 1))
    with pytest.raises(InputError, match=message):
        windows.read(tmp_path / "w.toml")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"increments": 4}, "increments is 4; a whole number from 1 to 3 is needed"),
        ({"taps": (1, 2)}, "u-taps is 1; a whole number at least 2 is needed"),
        ({"taps": (3, 0)}, "v-taps is 0; a whole number at least 1 is needed"),
        ({"previous": 3}, "a pair of 3 and 2 taps has 2 samples on each side of its step"),
    ],
)
def test_what_is_no_pair_is_refused(change, message):
    with pytest.raises(InputError, match=message):
        replace(SMALL, **change)


# The step


@pytest.mark.parametrize("name", ROWS)
def test_operations_and_drifts_are_those_of_the_table(name):
    count = WINDOWS[name].increments
    multiply, add, *drifts = TABLE[name]
    operations = lower(derive("euler", name)).operations
    assert (operations["multiply"] / count, operations["add"] / count) == (multiply, add)
    backend = strapgen.backend("euler", name, backend="c")
    for (angle, hertz), expected in zip(CONES, drifts, strict=True):
        cone = strapgen.motion("cone", half_angle_deg=angle, frequency_hz=hertz)
        run = strapgen.simulate(backend, cone, Fraction(count, 100), 30)
        assert drift(run) == pytest.approx(expected, rel=0.1), (angle, hertz)


def test_the_rotation_vector_has_the_product_as_its_term_of_second_order():
    window = WINDOWS["pair-2-5"]
    kernel = derive("rotation-vector", window)
    random = np.random.default_rng(1969)
    samples = random.uniform(-1e-5, 1e-5, (12, 3))
    values = dict(zip(kernel.inputs[0].elements, samples.ravel().tolist(), strict=True))
    (phi,) = kernel.expand(values).values()
    c0, u, v = (np.array(row, float) @ samples for row in (*window.filters[:2], lever(window)))
    np.testing.assert_allclose(np.array(phi, float).ravel() - c0, np.cross(u, v), rtol=0, atol=1e-15)


def test_an_exact_rotation_takes_large_cones():
    cone = strapgen.motion("cone", half_angle_deg=15, frequency_hz=20)
    drifts = [
        drift(strapgen.simulate(strapgen.backend("euler", name, backend="c"), cone, Fraction(1, 100), 10))
        for name in ("pair-1-8", "pair-1-8-exact")
    ]
    assert drifts[1] < drifts[0] / 10


def test_a_pair_gives_velocity_as_its_one_sided_filters_do():
    assert choose("velocity-position", "pair-1-8").window == WINDOWS["pair-1-8"]
    assert choose("velocity-position", "pair-1-8-9-7").window == WINDOWS["pair-1-8-9-7"]


# Committed late


def test_filters_beside_a_pair_are_those_of_a_window():
    filters = LateFilters(WINDOWS["pair-1-8"])
    assert filters.degree == 4 and {len(rows) for rows in filters.sets} == {5}
    assert filters.sets[8][3:] == ((0,) * 17,) * 2 and any(filters.sets[9][4])
    assert next(iter(sources("pair-1-8", target="c-float").files)) == "euler_late_1_8_float.h"
    with pytest.raises(InputError, match="pair-2-7 has steps of 2 samples; only steps of one sample"):
        LateFilters(WINDOWS["pair-2-7"])


@pytest.mark.parametrize("backend", ["numpy", "c", pytest.param("c-fixed32", marks=pytest.mark.long)])
def test_a_pair_is_committed_late_and_answers_now(backend):
    cone = strapgen.motion("cone", half_angle_deg=1, frequency_hz=20)
    increments = cone.samples(Fraction(1, 100), 0, 200)
    step = strapgen.backend("euler", "pair-1-8")
    unit, lossy = (CommitLate("pair-1-8", backend=backend) for _ in range(2))
    answers, committed = [], []
    for number, sample in enumerate(increments):
        unit.push(sample)
        lost = number == 100
        lossy.push(sample, SampleKind.LOST if lost else SampleKind.GOOD)
        if number == 24:
            start = unit.attitude.copy()
        if number >= 24:
            answers.append(unit.now())
            committed.append(unit.attitude.copy())

    def apart(one: np.ndarray, other: np.ndarray) -> float:
        return float((Rotation.from_quat(one).inv() * Rotation.from_quat(other)).magnitude())

    # Now is what is committed 8 samples later, within what one-sided filters err; a lost sample comes back.
    noise = 2e-8 if backend == "c-fixed32" else 0
    assert max(map(apart, answers[:-8], committed[8:])) < 1e-7 + noise
    assert apart(unit.attitude, lossy.attitude) < 2e-8 + noise
    for first in range(25 - 17 + 1, 200 - 17 + 1):
        start = step.step(start, increments[first : first + 17])
    assert apart(start, unit.attitude) < 1e-12 + 5 * noise


def test_a_recording_is_covered_from_end_to_end():
    cone = strapgen.motion("cone", half_angle_deg=1, frequency_hz=20)
    row = cone.samples(Fraction(1, 100), 0, 60)
    states = recording_attitudes("pair-1-8", row)
    unit = CommitLate("pair-1-8")
    for sample in row:
        unit.push(sample)
    unit.flush()
    np.testing.assert_allclose(states[-1], unit.attitude, atol=1e-14)
    true = cone.attitude(np.arange(61) / 100)
    apart = Rotation.from_quat(states) * Rotation.from_matrix(true[0].T @ true).inv()
    assert 1e-9 < apart.magnitude().max() < 1e-7
