"""Coning coefficients for a band or a spectrum: published values, best by other programmes, exact conditions."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import linprog

import strapgen
from strapgen.analysis.vibration import Spectrum
from strapgen.catalogue.methods import coning_drift, shaped_coning
from strapgen.catalogue.methods.coning_coefficients import Design
from strapgen.catalogue.methods.coning_drift import ConingShape
from strapgen.catalogue.methods.sensor_response import Response
from strapgen.catalogue.methods.shaped_coning import SHAPES, ShapedConing
from strapgen.design import coning_design
from strapgen.design.coning_design import ConingBrief, Lines, annulling, design, of_spectrum, written
from strapgen.design.filters.band_grid import REAL
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motions import IntegratedMotion
from strapgen.lab.motions.rate_profiles import CosineSum, ReferenceAttitude
from strapgen.lab.runs import steady_drift

BAND = Fraction(13, 10)
GYRO = Response(frequency_hz=Fraction(40), damping=Fraction(7071, 10000), sample_hz=Fraction(100))
#: Frequencies in Hz of the published designs; sampling is at 100 Hz.
HERTZ = np.linspace(0.25, 49.75, 400)


def lines(density: NDArray[np.float64]) -> Lines:
    """Return a spectrum of products of amplitudes, normalized to the square of 0.1 deg, as lines."""
    products = density / density.sum() * math.radians(0.1) ** 2
    return Lines(
        tuple(HERTZ.tolist()), tuple(products.tolist()), tuple((2 * products).tolist()), Fraction(100)
    )


PEAKS = lines(
    sum(a * np.exp(-0.5 * ((HERTZ - c) / (0.04 * c)) ** 2) for a, c in [(1, 12), (0.3, 24), (0.1, 36)])
)
FLAT = lines(((HERTZ >= 2) & (HERTZ <= 40)).astype(float))


def worst_drift(shape: ConingShape, coefficients: tuple[Fraction, ...], of: Lines) -> float:
    """Return the drift for the worst phases in deg/h."""
    errors = coning_drift.errors(shape, coefficients, of.radians)
    total = sum(w * abs(float(e)) for w, e in zip(of.products, errors, strict=True))
    return math.degrees(total / (shape.increments / float(of.sample_hz))) * 3600


@pytest.mark.long
@pytest.mark.parametrize(
    ("of", "samples", "previous", "before", "after"),
    [
        (PEAKS, 4, 0, 3.41, 0.445),
        (PEAKS, 3, 3, 1.92, 0.0673),
        (PEAKS, 1, 8, 0.930, 5.41e-3),
        (FLAT, 4, 0, 5.12, 1.16),
        (FLAT, 3, 3, 2.93, 0.259),
        (FLAT, 1, 8, 1.47, 0.0306),
    ],
    ids=lambda value: {id(PEAKS): "peaks", id(FLAT): "flat"}.get(id(value), str(value)),
)
def test_drift_under_a_spectrum_is_as_published(of, samples, previous, before, after):
    brief = ConingBrief(samples, previous, "worst", lines=of)
    shape = brief.shape
    assert worst_drift(shape, annulling(shape), of) == pytest.approx(before, rel=0.02)
    assert worst_drift(shape, design(brief).coefficients, of) == pytest.approx(after, rel=0.02)


@pytest.fixture(scope="module")
def shaped() -> ShapedConing:
    return design(ConingBrief(1, 8, "band", BAND))


@pytest.mark.long
def test_built_in_file_is_the_output_of_its_command(shaped):
    built_in = SHAPES["coning-shaped-8"]
    assert replace(built_in, name=shaped.name) == shaped
    path = shaped_coning._BUILT_IN.files["coning-shaped-8"]
    schema, text = path.read_text().split("\n", 1)
    command, figures = text.splitlines()[:2]
    assert schema.startswith("#:schema ")
    assert written(shaped, command.removeprefix("# Designed by: "), [figures.removeprefix("# ")]) == text


@pytest.mark.long
@pytest.mark.parametrize(
    ("shape", "powers", "band"),
    [
        (ConingShape(1, 8), 0, BAND),
        (ConingShape(1, 5), 2, Fraction(2)),
        (ConingShape(3, 3), 1, Fraction(1)),
        (ConingShape(2, 2, GYRO), 0, BAND),
        (ConingShape(1, 6, GYRO), 2, BAND),
    ],
    ids=str,
)
def test_no_coefficients_have_a_smaller_largest_drift(shape, powers, band):
    """A linear programme on another grid, in the same unknowns, reaches no lower level."""
    result = design(
        ConingBrief(shape.increments, shape.previous, "band", band, powers=powers, gyro=shape.gyro)
    )
    level = coning_drift.largest(shape, result.coefficients, band)
    for row, right in coning_drift.powers(shape, powers):
        assert sum(a * c for a, c in zip(row, result.coefficients, strict=True)) == right
    problem = coning_design.ConingProblem(shape, powers)
    points = [REAL.mpf(b) for b in np.linspace(0, float(band), 701)[1:]]
    basis, rest = coning_design.exchange.orthonormal(problem.answers(points))
    matrix, target = np.array(basis).T, np.array(rest)
    ones = np.ones((len(target), 1))
    best = linprog(
        np.append(np.zeros(matrix.shape[1]), 1.0),
        A_ub=np.block([[-matrix, -ones], [matrix, -ones]]),
        b_ub=np.concatenate([-target, target]),
        bounds=(None, None),
    )
    # The programme's numbers are by the largest of what the columns leave of the right side.
    unit = _unit(problem, points)
    assert best.fun * unit == pytest.approx(level, rel=1e-3)
    assert best.fun * unit <= level * (1 + 1e-6)


def _unit(problem: coning_design.ConingProblem, points: list) -> float:
    """Return the largest error of the least squares, which `orthonormal` scales to 1."""
    answers = problem.answers(points)
    matrix = [[REAL.ldexp(REAL.mpf(x), -320) for x in column] for column in answers.columns]
    right = [REAL.ldexp(REAL.mpf(x), -320) for x in answers.right]
    normal = REAL.matrix([[REAL.fdot(a, b) for b in matrix] for a in matrix])
    solution = REAL.lu_solve(normal, REAL.matrix([REAL.fdot(a, right) for a in matrix]))
    return max(
        abs(float(y - REAL.fsum(solution[k] * matrix[k][i] for k in range(len(matrix)))))
        for i, y in enumerate(right)
    )


@pytest.mark.long
@pytest.mark.parametrize("objective", ["worst", "random"])
@pytest.mark.parametrize("powers", [0, 2])
def test_no_coefficients_nearby_are_better_for_a_spectrum(objective, powers):
    brief = ConingBrief(1, 4, objective, lines=FLAT, powers=powers)
    best = design(brief).coefficients
    problem = coning_design.ConingProblem(brief.shape, powers)

    def cost(coefficients) -> float:
        errors = coning_drift.errors(brief.shape, coefficients, FLAT.radians)
        weights = FLAT.worst_weights if objective == "worst" else FLAT.square_weights
        power = 1 if objective == "worst" else 2
        return REAL.fsum(w * abs(e) ** power for w, e in zip(weights, errors, strict=True))

    least = cost(best)
    for direction in problem.directions:
        for size in (Fraction(1, 10**6), Fraction(-1, 10**6)):
            assert cost([c + size * d for c, d in zip(best, direction, strict=True)]) > least


@pytest.mark.long
def test_random_phases_and_noise_are_weighed_by_their_mean_squares():
    """A sum of lines and noise, both drawn many times: the mean square of the drift is what the design minimizes."""
    noise = Fraction(1, 10**5)
    quiet, noisy = (
        design(ConingBrief(1, 4, "random", lines=FLAT, noise=value)).coefficients for value in (0, noise)
    )
    assert sum(c * c for c in noisy) < sum(c * c for c in quiet)
    shape, interval = ConingShape(1, 4), 0.01
    spacing = HERTZ[1] - HERTZ[0]

    def mean_square(coefficients) -> float:
        """Return the mean square of the drift rate over the time 1/spacing, in rad^2/s^2, from its definition."""
        errors = [float(e) for e in coning_drift.errors(shape, coefficients, FLAT.radians)]
        of_lines = sum((w * e / interval) ** 2 / 2 for w, e in zip(FLAT.products, errors, strict=True))
        increments = sum(
            2 * w * 2 * math.sin(math.pi * f * interval) ** 2
            for w, f in zip(FLAT.products, HERTZ, strict=False)
        )
        of_a_step = float(noise) ** 2 * sum(float(c) ** 2 for c in coefficients) * increments
        return of_lines + of_a_step / interval**2 * interval * spacing

    assert mean_square(noisy) < mean_square(quiet)
    for k in range(4):
        for size in (Fraction(1, 1000), Fraction(-1, 1000)):
            assert mean_square([c + size * (j == k) for j, c in enumerate(noisy)]) > mean_square(noisy)


def test_pulses_are_weighed_by_the_differences_of_neighbours():
    """Pulses of one increment are taken back in the next: equal neighbouring coefficients pass on none of them."""

    def differences(coefficients) -> Fraction:
        row = [Fraction(0), *coefficients, Fraction(0)]
        return sum((b - a) ** 2 for a, b in itertools.pairwise(row))

    brief = ConingBrief(1, 4, "random", lines=FLAT)
    without, with_pulses, coarse = (
        design(replace(brief, pulse=Fraction(pulse))).coefficients for pulse in ("0", "1e-4", "1e-3")
    )
    assert differences(without) > differences(with_pulses) > differences(coarse)


@dataclass(frozen=True)
class SumOfCones(IntegratedMotion):
    """Lines about x and y, a quarter period apart; the direction of each is that in which its drift adds up."""

    hertz: NDArray[np.float64]
    sizes: NDArray[np.float64]
    signs: NDArray[np.float64]

    @cached_property
    def profile(self) -> CosineSum:
        omega = 2 * math.pi * self.hertz
        phases = 2 * math.pi * (np.sqrt(7) * np.arange(1, len(omega) + 1) % 1)
        return CosineSum(
            np.stack([omega * self.sizes, omega * self.sizes, 0 * omega]),
            np.broadcast_to(omega, (3, len(omega))),
            np.stack([phases, phases + self.signs * math.pi / 2, phases]),
        )

    @cached_property
    def _reference(self) -> ReferenceAttitude:
        return ReferenceAttitude(self.profile.rate, 16)

    def attitude(self, time):
        return self._reference(time)


@pytest.mark.long
@pytest.mark.parametrize(("samples", "previous"), [(4, 0), (1, 8)])
@pytest.mark.parametrize("designed", [False, True], ids=["annulling", "designed"])
def test_a_simulated_sum_of_cones_drifts_as_predicted(samples, previous, designed):
    """Twenty cones together have the square of 0.1 deg; below 1e-3 deg/h terms of fourth order in the angle rule.

    No sum or difference of two frequencies is a multiple of 25 Hz: steps of 0.04 s would take it for a drift.
    """
    hertz = 2.13 + 1.97 * np.arange(20)
    product = math.radians(0.1) ** 2 / len(hertz)
    of = Lines(tuple(hertz), (product,) * len(hertz), (2 * product,) * len(hertz), Fraction(100))
    brief = ConingBrief(samples, previous, "worst", lines=of, title="of the test")
    shape = design(brief)
    if not designed:
        shape = replace(shape, coefficients=annulling(brief.shape))
    errors = coning_drift.errors(brief.shape, shape.coefficients, of.radians)
    signs = np.array([1.0 if e > 0 else -1.0 for e in errors])
    motion = SumOfCones("sum of cones", {}, hertz, np.full(len(hertz), math.sqrt(product)), signs)
    backend = strapgen.backend("euler", shape, backend="c")
    run = strapgen.simulate(backend, motion, Fraction(samples, 100), 60)
    assert steady_drift(run) == pytest.approx(
        worst_drift(brief.shape, shape.coefficients, of), rel=0.05, abs=1e-3
    )


def test_lines_have_the_mean_squares_of_their_spectrum():
    """E[n^2] is the integral of the density over frequency, here 4e-8 times 10 Hz; a sine has half its square."""
    spectrum = Spectrum(
        lambda f: 4e-8 + 0 * f,
        {"angle_x": lambda f: 2 + 0 * f, "angle_y": lambda f: 1j + 0 * f},
        (10.0, 20.0),
    )
    of = of_spectrum(spectrum, Fraction(100))
    # A line stands for the band between the middles to its neighbours: 400 of them for 399 distances.
    share = 400 / 399
    assert sum(of.squares) / 2 == pytest.approx((4 + 1) * 4e-7 * share)
    assert sum(of.products) / 2 == pytest.approx(2 * 4e-7 * share)
    b = 2 * math.pi * np.array(of.hertz) / 100
    expected = (np.array(of.squares) / 2 * np.abs(np.exp(1j * b) - 1) ** 2).sum()
    assert of.increment_square(None) == pytest.approx(expected)
    through = (
        np.array(of.squares) / 2 * np.abs((np.exp(1j * b) - 1) * _butterworth(np.array(of.hertz))) ** 2
    ).sum()
    # 0.7071 is not quite the root of 1/2.
    assert of.increment_square(GYRO) == pytest.approx(through, rel=1e-4)


def _butterworth(hertz: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the response of the filter of second order by its poles, on a circle of 40 Hz."""
    first, second = 40 * np.exp(1j * np.pi * np.array([3, 5]) / 4)
    return 40**2 / ((1j * hertz - first) * (1j * hertz - second))


def test_a_spectrum_that_does_not_cone_is_refused():
    one = Spectrum(lambda f: 1e-8 + 0 * f, {"angle_x": np.ones_like}, (1.0, 20.0))
    with pytest.raises(InputError, match="does not turn about y; angle_y_rad is needed for coning"):
        of_spectrum(one, Fraction(100))
    apart = Spectrum(
        lambda f: 1e-8 + 0 * f,
        {"angle_x": lambda f: 1.0 * (f < 10), "angle_y": lambda f: 1.0 * (f > 10)},
        (1.0, 20.0),
    )
    with pytest.raises(InputError, match="there is no coning"):
        of_spectrum(apart, Fraction(100))


@pytest.mark.long
def test_products_of_powers_of_time_are_integrated_exactly():
    """The degree is that of the page on coefficients, which counts what a step of them integrates exactly."""
    plain, exact = (design(ConingBrief(1, 5, "band", BAND, products=n)) for n in (0, 2))
    degrees = [Design("shaped", 1, 5, dict(shape.pairs)).degree for shape in (plain, exact)]
    assert degrees == [0, 2]
    assert exact.level > plain.level
    shaped_coning.verify(exact)
    # Products of degree 1 say what the first power of the frequency says: both together are one condition.
    assert coning_design.ConingProblem(ConingShape(1, 5), 1, 1).free == 4
    assert coning_design.ConingProblem(ConingShape(1, 5), 1, 2).free == 3


def test_conditions_that_contradict_each_other_are_refused():
    with pytest.raises(
        InputError, match="the conditions on 8 coefficients contradict each other; fewer powers or"
    ):
        coning_design.ConingProblem(ConingShape(1, 8), 0, 3)
    with pytest.raises(InputError, match="products of powers of time go with an ideal gyro"):
        coning_design.ConingProblem(ConingShape(1, 8, GYRO), 0, 1)


def test_one_sample_alone_has_no_coefficients():
    with pytest.raises(InputError, match="samples 1 and previous 0 have no pairs of samples"):
        design(ConingBrief(1, 0, "band", BAND))


def test_with_all_powers_annulled_nothing_is_left_to_design():
    brief = ConingBrief(1, 3, "band", BAND, powers=3)
    assert design(brief).coefficients == annulling(brief.shape)
    assert design(replace(brief, objective="worst", band=None, lines=FLAT)).coefficients == annulling(
        brief.shape
    )
    assert design(replace(brief, objective="random", band=None, lines=FLAT)).coefficients == annulling(
        brief.shape
    )
