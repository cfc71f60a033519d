"""Filters of the least largest error and the least sum of absolute errors: known taps, and linear programmes."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from scipy.optimize import linprog

from strapgen.design.filters import exchange
from strapgen.design.filters.band_grid import BITS, REAL
from strapgen.design.filters.exchange import Responses
from strapgen.design.filters.filter_taps import Shape, Unknowns, rounded
from strapgen.ir.exceptions import InputError, MissingExtraError

BAND = Fraction(13, 10)

#: Taps for j = 1, 2, ... of odd m, and j = 0, 1, ... of even m, with three samples on each side.
TAPS_3 = {
    1: (0.408856141152301, -0.0995849129218411, 0.0134378948971269),
    2: (-0.258512333842031, 0.147982875820792, -0.0207781675221054, 0.00205145862232925),
    3: (-0.0169274352887115, 0.0110419482309692, -0.00171882039107564),
    4: (0.00718180772925025, -0.00511288876123765, 0.00171699506165500, -0.000195010165042485),
}
TAPS_7 = {
    1: (
        *(0.4761857516436346, -0.1862571975631791, 0.07258442634001752, -0.02417759701063216),
        *(0.00622918089210463, -0.001089209752045537, 9.644379384997374e-05),
    )
}
#: Levels of m = 1, 2, ... by samples on each side and powers, with the digits that are known.
LEVELS = {
    (3, 4): ("2.160751e-03", "3.647130e-05", "3.112845e-04", "3.872884e-06"),
    (5, 4): ("1.266880e-05", "1.991528e-07", "2.009957e-06", "2.326615e-08"),
    (7, 4): ("1.111672e-07", "1.485231e-09", "1.840470e-08", "1.811489e-10"),
    (9, 7): ("1.879638e-09", "3.51190e-11", "3.184786e-10", "4.38244e-12", "1.102643e-11"),
}


@pytest.fixture(scope="module")
def designs():
    """Return a function that designs a filter once."""
    done: dict[tuple[int, int, int], exchange.Minimax] = {}

    def design(side: int, powers: int, m: int) -> exchange.Minimax:
        if (side, powers, m) not in done:
            done[side, powers, m] = exchange.minimax_filter(Unknowns(Shape(side, side, powers), m), BAND)
        return done[side, powers, m]

    return design


@pytest.mark.long
@pytest.mark.parametrize(("side", "taps"), [(3, TAPS_3), (7, TAPS_7)])
def test_taps_are_those_that_are_known(side, taps, designs):
    for m, values in taps.items():
        computed = designs(side, 4, m).taps[side + m % 2 :]
        # The last digits of the printed numbers are rounded.
        assert [float(tap) for tap in computed] == pytest.approx(values, rel=2e-14, abs=0)


@pytest.mark.long
@pytest.mark.parametrize(
    "size",
    [
        (3, 4),
        pytest.param((5, 4), marks=pytest.mark.long),
        (7, 4),
        pytest.param((9, 7), marks=pytest.mark.long),
    ],
    ids=str,
)
def test_levels_are_those_that_are_known(size, designs):
    for m, text in enumerate(LEVELS[size], 1):
        # The last printed digit is rounded or cut.
        unit = Decimal(text).as_tuple().exponent
        assert abs(float(designs(*size, m).level) - float(text)) < 10.0**unit


@pytest.mark.long
@pytest.mark.parametrize(
    ("size", "gain"),
    [((3, 4), 0.595), ((5, 4), 0.684), ((7, 4), 0.731), pytest.param((9, 7), 0.761, marks=pytest.mark.long)],
)
def test_noise_gains_are_those_that_are_known(size, gain, designs):
    taps = designs(*size, 1).taps
    assert round(float(sum(tap * tap for tap in taps)) ** 0.5, 3) == gain


@pytest.mark.long
@pytest.mark.parametrize(
    ("side", "powers", "m"), [(3, 4, 1), (7, 4, 2), pytest.param(9, 7, 5, marks=pytest.mark.long)]
)
def test_two_grids_give_the_same_rationals(side, powers, m, designs):
    unknowns = Unknowns(Shape(side, side, powers), m)
    first, second = designs(side, powers, m), exchange.minimax_filter(unknowns, BAND, 1700)
    assert max(abs(a - b) for a, b in zip(first.taps, second.taps, strict=True)) < REAL.mpf(10) ** -32
    assert rounded(unknowns, first.taps) == rounded(unknowns, second.taps)


def test_the_error_alternates_in_as_many_places_as_there_are_free_unknowns_and_one(designs):
    # The theorem of Chebyshev: so many alternations of the same height prove that no filter has a smaller level.
    b = np.linspace(1e-6, 1.3, 20001)
    taps = [float(tap) for tap in designs(3, 4, 2).taps[3:]]
    x = b / 2
    bessel = (3 / x**3 - 1 / x) * np.sin(x) - 3 / x**2 * np.cos(x)
    right = np.where(x < 0.02, x**2 / 15, bessel)
    answer = taps[0] + sum(2 * tap * np.cos(j * b) for j, tap in enumerate(taps[1:], 1))
    error = -5 * right - np.sinc(b / (2 * np.pi)) * answer
    places = exchange.alternating(error.tolist(), 3)
    level = float(designs(3, 4, 2).level)
    assert places is not None and places[-1] == len(b) - 1
    # The grid of the test leaves the extrema at 1e-7 of themselves, rounding at 1e-11.
    assert [abs(error[k]) for k in places] == pytest.approx([level] * 3, rel=1e-6)


def test_without_free_unknowns_the_conditions_give_the_filter():
    filter = exchange.minimax_filter(Unknowns(Shape(1, 1, 3), 1), BAND)
    assert [float(tap) for tap in filter.taps] == [-0.25, 0.0, 0.25]
    # At the end of the band: |sin(b) s(b)/2 - 3 j_1(b/2)|.
    b = 1.3
    s = np.sin(b / 2) / (b / 2)
    expected = abs(0.5 * np.sin(b) * s - 3 * (np.sin(b / 2) / (b / 2) ** 2 - np.cos(b / 2) / (b / 2)))
    assert float(filter.level) == pytest.approx(expected, rel=1e-12)


@pytest.mark.long
def test_a_band_that_is_too_narrow_is_refused():
    with pytest.raises(InputError, match=r"a wider band|too narrow"):
        exchange.minimax_filter(Unknowns(Shape(12, 12, 4), 1), Fraction(1, 10**7))


def test_without_scipy_the_extra_is_named(monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "scipy.optimize", None)
    with pytest.raises(MissingExtraError, match=r"needs SciPy: pip install 'strapgen\[design\]'"):
        exchange.minimax_filter(Unknowns(Shape(3, 3, 4), 1), BAND)


@pytest.mark.long
def test_the_programme_only_starts_the_exchange(designs, monkeypatch):
    # Another solver, or another machine, leaves other last digits of the programme.
    rng = np.random.default_rng(1)
    programme = exchange._programme
    calls = []

    def inexact(basis, right):
        errors = np.array(programme(basis, right))
        calls.append(len(errors))
        return (errors * (1 + 1e-3 * rng.normal(size=len(errors)))).tolist()

    monkeypatch.setattr(exchange, "_programme", inexact)
    unknowns = Unknowns(Shape(7, 7, 4), 3)
    again = exchange.minimax_filter(unknowns, BAND)
    assert calls and rounded(unknowns, again.taps) == rounded(unknowns, designs(7, 4, 3).taps)


def integers(values) -> list[int]:
    return [round(float(value) * 2**60) << (BITS - 60) for value in values]


@pytest.mark.long
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("count", [1, 3, 8])
def test_the_sum_is_that_of_a_linear_programme(count, seed):
    rng = np.random.default_rng(seed)
    matrix, right, weights = rng.normal(size=(60, count)), rng.normal(size=60), rng.uniform(1e-6, 1, 60)
    answers = Responses([integers(column) for column in matrix.T], integers(right))
    solution = exchange.least_absolute(answers, [REAL.mpf(w) for w in weights])
    errors = np.abs(right - matrix @ np.array([float(x) for x in solution]))
    ones = np.eye(60)
    best = linprog(
        np.concatenate([np.zeros(count), weights]),
        A_ub=np.block([[-matrix, -ones], [matrix, -ones]]),
        b_ub=np.concatenate([-right, right]),
        bounds=[(None, None)] * count + [(0, None)] * 60,
    )
    # The tolerance of the programme is 1e-7 for each of its constraints.
    assert weights @ errors == pytest.approx(best.fun, abs=60 * 1e-7)
    # At a vertex as many errors as there are unknowns are zero, but for the rounding of the solution to double.
    assert (errors < 1e-12).sum() == count


def test_one_unknown_is_the_weighted_median():
    answers = Responses([integers([1] * 5)], integers([5, 1, 2, 9, 3]))
    (plain,) = exchange.least_absolute(answers, [1] * 5)
    (weighted,) = exchange.least_absolute(answers, [1, 1, 1, 5, 1])
    assert (float(plain), float(weighted)) == (3, 9)


def test_fewer_points_than_unknowns_are_refused():
    with pytest.raises(InputError, match="1 lines do not determine 2 coefficients"):
        exchange.least_absolute(Responses([integers([1]), integers([2])], integers([3])), [1])
