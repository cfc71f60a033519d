"""The mean rate that steps compute under tones to fourth order, against exact mean rates, and the ring of tones."""

from __future__ import annotations

import cmath
import itertools
import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy as sp

import strapgen
from strapgen import vibration
from strapgen.analysis.vibration.rectification import (
    DEGREE,
    Oscillations,
    Rectification,
    Tone,
    _Term,
    rectified,
    resonances,
)
from strapgen.catalogue import choose, choose_step
from strapgen.ir.exceptions import InputError
from strapgen.kernel.power_series import Powers

#: The angle by which a step of one increment d turns about the axis of d: d + k d^3 + ...
CUBES = {
    ("euler", "taylor1"): Fraction(-1, 12),  # 2 atan(d/2)
    ("euler", "taylor2"): Fraction(1, 24),  # 2 atan((d/2)/(1 - d^2/8))
    ("dcm", "taylor1"): Fraction(-1, 3),  # atan(d)
    ("dcm", "taylor2"): Fraction(1, 6),  # atan(d/(1 - d^2/2))
    ("euler", "coning-compressed"): Fraction(0),
}
#: A cone of angle A about z: the rates A w cos(w t) about x and A w sin(w t) about y.
HERTZ, STEP = Fraction(7), Fraction(1, 50)


def octaves(axis=(1.0, 0.0, 0.0), sizes=(0.02, 0.03), step=Fraction(1, 200)):
    """Return two tones about an axis, of which one is twice the other, and the complex amplitudes of one increment."""
    tones = [Tone(Fraction("5.4") * (k + 1), tuple(-1j * sizes[k] * x for x in axis)) for k in range(2)]
    turns = [cmath.exp(2j * math.pi * float(tone.frequency_hz * step)) - 1 for tone in tones]
    return tones, [-1j * size * turn for size, turn in zip(sizes, turns, strict=True)]


@pytest.mark.parametrize(("state", "method"), CUBES)
def test_turns_about_one_axis_rectify_the_cube_of_the_increment(state, method):
    step = Fraction(1, 200)
    tones, (one, two) = octaves()
    found = rectified(choose_step(state, method, 1), step, tones)
    for phases in ([0.0, 0.0], [0.3, 1.1], [2.0, -0.7]):
        a, b = one * cmath.exp(1j * phases[0]), two * cmath.exp(1j * phases[1])
        # The mean of the cube of Re(a z + b z^2) is 3/4 Re(a^2 b*).
        expected = float(CUBES[state, method]) * 0.75 * (a * a * b.conjugate()).real / float(step)
        assert found.at(phases) == pytest.approx([expected, 0, 0], rel=1e-9, abs=1e-15)
    if CUBES[state, method]:
        worst = abs(float(CUBES[state, method]) * 0.75 * one**2 * two) / float(step)
        assert found.worst() == pytest.approx(worst, rel=1e-5) and found.worst() >= worst
        assert found.worst(3) == found.worst()


def cone(size, gain=1.0):
    return [Tone(HERTZ, (-1j * size, -size, 0), gain)]


@pytest.mark.parametrize(
    ("method", "seen"),
    [
        ("coning-compressed", lambda d: d),
        ("taylor1", lambda d: 2 * mpmath.atan(d / 2)),
        ("taylor2", lambda d: 2 * mpmath.atan(d / 2 / (1 - d * d / 8))),
    ],
)
def test_the_second_and_the_fourth_order_of_a_cone_are_those_of_its_closed_form(method, seen):
    size = 0.03
    with mpmath.workdps(60):
        w = 2 * mpmath.pi * int(HERTZ)
        turned = w * STEP.numerator / STEP.denominator

        def error(a):
            # Steps turn by d about an axis that turns with them: the half angle of both has the cosine of a product.
            angle = seen(2 * a * mpmath.sin(turned / 2))
            half = mpmath.acos(mpmath.cos(angle / 2) * mpmath.cos(turned / 2))
            # Where the rate stands still, the body turns by w across it.
            return (2 * half - turned) * STEP.denominator / STEP.numerator - w * (mpmath.sqrt(1 + a * a) - 1)

        series = mpmath.taylor(error, 0, 4)
    found = rectified(choose_step("euler", method, 1), STEP, cone(size))
    for order in (2, 4):
        expected = float(series[order]) * size**order
        assert found.at([0.4], order) == pytest.approx([0, 0, expected], rel=1e-9, abs=1e-14), order
        assert found.worst(order) == pytest.approx(abs(expected), rel=1e-9)


def mean_of_cone(choice, size):
    """Return the error of the mean rate about z on a cone of any size, from the first step alone, in rad/s.

    Transitions follow each other turned by an angle about z: their product is a power of the first one times that turn.
    """
    kernel = strapgen.backend(choice)
    count, before, after = choice.increments, choice.previous, choice.ahead
    edges = 2 * math.pi * float(HERTZ * STEP) * np.arange(-before, count + after + 1) / count
    angles = size * np.stack([np.sin(edges), -np.cos(edges), 0 * edges], axis=-1)
    (matrix,) = kernel.matrices(kernel.propagate(np.diff(angles, axis=0)[None]))[1:]
    w = 2 * math.pi * float(HERTZ)
    turned = w * float(STEP)
    c, s = math.cos(turned), math.sin(turned)
    values = np.linalg.eigvals(matrix @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]))
    angle = max(np.angle(values))
    return (angle - turned) / float(STEP) - w * (math.sqrt(1 + size**2) - 1)


@pytest.mark.parametrize(
    ("state", "method", "samples"),
    [
        ("euler", "coning-compressed", (3,)),
        ("dcm", "coning-combined", (2, 1)),
        ("euler", "rk4", (2,)),
        ("dcm", "rk4", (1, 1)),
        ("dcm", "taylor1", (1,)),
        ("dcm", "taylor3", (2,)),
        ("euler", "magnus4", (2,)),
        ("cayley-klein", "rk4", (2,)),
        ("euler", "window-3-3", (1, 3, 3)),
    ],
)
def test_residual_error_on_a_cone_is_of_sixth_order(state, method, samples):
    names = ("increments", "previous", "ahead")
    choice = choose_step(state, method, **dict(zip(names, samples, strict=False)))
    left = []
    for size in (0.1, 0.05):
        found = rectified(choice, STEP, cone(size)).at([1.3])
        assert found[:2] == pytest.approx([0, 0], abs=1e-12)
        left.append(abs(mean_of_cone(choice, size) - found[2]))
    assert left[0] / left[1] == pytest.approx(64, rel=0.1), left


def test_an_axis_may_point_anywhere():
    rng = np.random.default_rng(3)
    choice = choose_step("euler", "coning-compressed", 2)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    angles = 0.02 * (rng.normal(size=(2, 3)) + 1j * rng.normal(size=(2, 3)))
    one, other = (
        rectified(
            choice, "0.02", [Tone(hertz, tuple(axes)) for hertz, axes in zip(("5", "10"), moved, strict=True)]
        )
        for moved in (angles, angles @ turn.T)
    )
    for order in (2, 3, 4):
        phases = [0.4, 2.0]
        assert other.at(phases, order) == pytest.approx(turn @ one.at(phases, order), rel=1e-9, abs=1e-15)


def test_orders_go_with_powers_of_the_amplitudes_and_a_later_start_changes_nothing():
    choice = choose_step("dcm", "rk4", 2)
    tones = [
        Tone("3.1", (0.01, 0.02j, 0)),
        Tone("6.2", (0.02 - 0.01j, 0.01, 0)),
        Tone("9.3", (0.01j, 0.03, 0)),
    ]
    larger = [tone._replace(angles=tuple(2 * c for c in tone.angles)) for tone in tones]
    one, other = (rectified(choice, "0.01", several) for several in (tones, larger))
    phases = np.array([0.2, 1.0, -0.5])
    for order in (2, 3, 4):
        assert other.at(phases, order) == pytest.approx(2**order * one.at(phases, order), rel=1e-9, abs=1e-16)
    later = phases + 0.37 * 2 * math.pi * np.array([3.1, 6.2, 9.3])
    assert one.at(later) == pytest.approx(one.at(phases), rel=1e-9)
    assert one.at(phases) == pytest.approx(sum(one.at(phases, order) for order in (1, 2, 3, 4)))


def test_the_phases_that_a_tone_has_of_itself_are_those_at_which_it_begins():
    choice = choose_step("euler", "coning-compressed", 2)
    tones, _ = octaves((0.6, 0.8, 0.0))
    late = [
        tone._replace(angles=tuple(c * cmath.exp(1j * (k + 0.5)) for c in tone.angles))
        for k, tone in enumerate(tones)
    ]
    plain, turned = (rectified(choice, "0.01", several) for several in (tones, late))
    assert turned.at([0.0, 0.0]) == pytest.approx(plain.at([0.5, 1.5]), rel=1e-9, abs=1e-18)


@pytest.mark.parametrize(
    ("state", "method", "increments"), [("euler", "coning-compressed", 3), ("dcm", "rk4", 2)]
)
def test_the_second_order_is_that_of_the_closed_form(state, method, increments):
    choice = choose_step(state, method, increments)
    expected = vibration.of(choice).rates(10, "0.02", theta_x="0.01", theta_y="0.02", phase="0.7").error
    tone = Tone(10, (-0.01j, -0.02j * cmath.exp(0.7j), 0))
    assert rectified(choice, "0.02", [tone]).at([0.3], 2) == pytest.approx(
        [0, 0, expected], rel=1e-6, abs=1e-15
    )


def test_a_gyro_shows_the_algorithm_other_angles_than_the_true_ones():
    choice = choose_step("euler", "coning-compressed", 3)
    gain = 1 / (1 - 0.25**2 + 2j * 0.7 * 0.25)
    tones = [Tone(10, (-0.01j, -0.02j * cmath.exp(0.7j), 0), gain)]
    seen = vibration.through_gyro(vibration.of(choice), "second-order:40:0.7")
    expected = seen.rates(10, "0.02", theta_x="0.01", theta_y="0.02", phase="0.7").error
    assert rectified(choice, "0.02", tones).at([0.0], 2)[2] == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("hertz", "orders"),
    [
        (("5.4", "10.8"), [2, 3, 4]),
        (("5.4", "10.9"), [2, 4]),
        (("5.4", "10.8000000001"), [2, 4]),
        (("4", "12"), [2, 4]),  # f, f, f and 3 f
        (("5.4", "7.1", "12.5"), [2, 3, 4]),
    ],
)
def test_a_third_order_needs_a_frequency_that_is_the_sum_of_two(hertz, orders):
    tones = [Tone(one, (-0.02j, 0.01 - 0.01j, 0)) for one in hertz]
    found = rectified(choose_step("euler", "coning-compressed", 2), "0.01", tones)
    assert [order for order in (1, 2, 3, 4) if found.worst(order) > 1e-15] == orders
    with_phases = {term.order for term in found.terms if any(term.turns)}
    assert with_phases == ({3} & {*orders} or ({4} if hertz == ("4", "12") else set()))


def test_frequencies_that_are_whole_periods_together_have_a_mean_in_the_computed_rate_alone():
    choice = choose_step("euler", "coning-compressed", 1)
    tones = [Tone(40, (-0.01j, 0, 0)), Tone(60, (0, -0.02j, 0))]
    found = rectified(choice, "0.01", tones)
    # Half the cross product of an increment and the sum of those before it; of the true rate nothing has a mean.
    z = cmath.exp(0.8j * math.pi)
    x, y = -0.01j * (z - 1), -0.02j * (z.conjugate() - 1)
    for phases in ([0.0, 0.0], [0.5, 1.0]):
        a, b = x * cmath.exp(1j * phases[0]), y * cmath.exp(1j * phases[1])
        total = (a / (z - 1) * b / 2 - b / (z.conjugate() - 1) * a / 2).real / 2
        assert found.at(phases, 2) == pytest.approx([0, 0, total / 0.01], rel=1e-9)
    assert found.worst(2) == pytest.approx(
        abs(a / (z - 1) * b - b / (z.conjugate() - 1) * a) / 4 / 0.01, rel=1e-9
    )
    assert rectified(choice, "0.011", tones).worst(2) == pytest.approx(0, abs=1e-18)


def test_a_step_that_takes_whole_periods_for_a_turn_has_a_mean_of_first_order():
    # rk1 takes the first of two samples for half of the step: d_1 - d_0 is no zero where every step sees the same.
    found = rectified(choose_step("dcm", "rk1", 2), "0.1", [Tone(10, (-0.001j, 0, 0))])
    assert found.worst(1) > 1e-3
    regular = rectified(choose_step("dcm", "coning-compressed", 2), "0.1", [Tone(10, (-0.001j, 0, 0))])
    assert regular.worst(1) == pytest.approx(0, abs=1e-15)


def test_the_worst_phases_are_those_of_any_start():
    rng = np.random.default_rng(5)
    tones = [
        Tone(hertz, (-0.02j, 0.02 * cmath.exp(1j * k), 0)) for k, hertz in enumerate(("5.4", "10.8", "21.6"))
    ]
    found = rectified(choose_step("euler", "coning-compressed", 8), "0.04", tones)
    sizes = [np.linalg.norm(found.at(phases)) for phases in rng.uniform(0, 2 * math.pi, (4000, 3))]
    assert 0.98 * found.worst() < max(sizes) <= found.worst()


def test_the_worst_of_a_sum_adds_terms_of_equal_phase_and_the_lengths_of_others():
    def term(order, turns, *rate):
        return _Term(order, turns, np.array(rate, complex))

    constant = term(2, (0, 0), 0, 0, 3), term(4, (0, 0), 0, 0, -1)
    assert Rectification(constant).worst() == pytest.approx(2)
    assert Rectification(constant).worst(4) == pytest.approx(1)
    same = term(2, (1, -1), 0, 0, 1j), term(4, (1, -1), 0, 0, 2j)
    assert Rectification((*constant, *same)).worst() == pytest.approx(5)
    other = term(4, (3, -1), 0, 0, 1)
    assert Rectification((*constant, *same, other)).worst() == pytest.approx(6)
    # An ellipse with half axes 4 and 1, and a line across it: the first alone is attained along x.
    ellipse, line = term(3, (2, -1), 4, 1j, 0), term(3, (0, 2), 0, 1, 0)
    assert Rectification((ellipse,)).worst() == pytest.approx(4, rel=1e-5)
    both = Rectification((ellipse, line)).worst()
    angles = np.linspace(0, math.pi, 100_000)
    assert both == pytest.approx(
        (np.hypot(4 * np.cos(angles), np.sin(angles)) + np.sin(angles)).max(), rel=1e-5
    )
    assert Rectification((*constant, ellipse)).worst() == pytest.approx(math.hypot(2, 4), rel=1e-5)
    assert Rectification((ellipse,)).at([math.pi / 2, 0]) == pytest.approx([-4, 0, 0])
    assert Rectification((ellipse,)).at([0, math.pi / 2]) == pytest.approx([0, 1, 0])


@pytest.mark.parametrize(
    ("choice", "tones", "said"),
    [
        (choose("euler"), [], "tones is empty"),
        (choose("euler"), [Tone(0, (1, 0, 0))], "frequency-hz"),
        (choose_step("euler", "rk4", rates=True), [Tone(1, (1, 0, 0))], "takes rates"),
        (choose("euler-normalize"), [Tone(1, (1, 0, 0))], "no attitude step"),
    ],
)
def test_motions_without_mean_rate_are_refused(choice, tones, said):
    with pytest.raises(InputError, match=said):
        rectified(choice, "0.01", tones)


def searched(shares):
    """Return the resonances by trying all products."""
    periods = [sign * share for share in shares for sign in (1, -1)]
    return [
        product
        for degree in range(1, 5)
        for product in itertools.combinations_with_replacement(range(len(periods)), degree)
        if sum(periods[k] for k in product).denominator == 1
    ]


@pytest.mark.parametrize(
    "shares",
    [
        ["0.1"],
        ["0.027", "0.054", "0.108"],
        ["0.027", "0.0541", "0.108"],
        ["0.4", "0.6"],  # whole periods together
        ["1", "0.3"],  # whole periods alone
        ["0.25", "1/3"],
        ["0.1", "0.1", "0.3"],  # the same frequency twice, and three times it
    ],
)
def test_resonances_are_those_of_all_products(shares):
    exact = [Fraction(share) for share in shares]
    assert resonances(exact) == searched(exact)


def test_a_sum_that_is_nearly_zero_is_no_resonance():
    near = Fraction(54, 1000) + Fraction(1, 10**15)
    assert len(resonances([Fraction(27, 1000), Fraction(54, 1000)])) > len(
        resonances([Fraction(27, 1000), near])
    )


def test_products_that_divide_a_resonance_are_kept_and_no_others():
    ring = Oscillations([Fraction("0.1"), Fraction("0.23")])
    assert [len(products) for products in ring.products] == [1, 4, 10, 8, 3]
    assert (0, 0, 2) not in ring.places[3], "it divides no product of four with a mean"
    assert (0, 0, 1) in ring.places[3] and (0, 1, 2) in ring.places[3]


@pytest.mark.parametrize("seed", range(3))
def test_products_of_polynomials_are_those_of_symbols(seed):
    rng = np.random.default_rng(seed)
    ring = Oscillations([Fraction(1, 9), Fraction(2, 9)])
    symbols = sp.symbols("a:4")
    elements = []
    for _ in range(3):
        amplitudes = rng.integers(-3, 4, 2) + 1j * rng.integers(-3, 4, 2)
        halves = [half for c in amplitudes for half in (complex(c) / 2, complex(c).conjugate() / 2)]
        number = int(rng.integers(1, 4))
        element = Powers(ring, {0: ring(number), 1: ring.oscillating(amplitudes)}, DEGREE)
        elements.append(
            (element, number + sum(sp.nsimplify(h) * s for h, s in zip(halves, symbols, strict=True)))
        )
    (a, x), (b, y), (c, z) = elements
    found = (a * b + c) * a * c - b
    expected = sp.Poly(sp.expand((x * y + z) * x * z - y), *symbols)
    for degree in range(DEGREE + 1):
        for product, value in zip(ring.products[degree], found.parts[degree].values, strict=True):
            exponents = [product.count(k) for k in range(4)]
            assert abs(value - complex(expected.coeff_monomial(exponents))) < 1e-12, product


def test_functions_of_a_length_are_series_in_its_square():
    ring = Oscillations([Fraction(1, 9)])
    small = Powers(ring, {1: ring.oscillating([0.2 - 0.1j])}, DEGREE)
    unit = (1 + small * small).root()
    difference = unit * unit - 1 - small * small
    assert all(np.abs(part.values).max() < 1e-15 for part in difference.parts.values())
    assert ((1 + small).inverse() * (1 + small)).start.LC == 1
