"""Constant rate: the thesis's claims 1 to 4 as series in the angle a step, from the kernels themselves."""

from functools import cache
from random import Random

import derived
import numpy as np
import pytest
import sympy as sp
from sympy.polys.ring_series import rs_integrate, rs_mul, rs_series_inversion
from sympy.polys.rings import PolyElement

from strapgen.catalogue import MOST_INCREMENTS, STANDARD_METHODS, choose
from strapgen.catalogue.methods.tableaux import TABLEAUX

X = sp.Symbol("x", positive=True)
RING, x = sp.ring("x", sp.QQ)
STEP_NAMES = ("dcm", "euler")
TERMS = 11


@cache
def transition(algorithm: str, method: str, axes: str, increments: int = 2) -> sp.Matrix:
    """Return the step of the identity at the angle x about each of the axes, in equal increments."""
    step = derived.kernel(choose(algorithm, method, increments))
    state, d = step.inputs
    values = dict(zip(state.elements, map(RING, step.attitude_step.identity), strict=True))
    values |= {element: x / increments if element[-1] in axes else RING(0) for element in d.elements}
    result = [RING(element).as_expr(X) for element in step.expand(values)["next"]]
    return sp.Matrix(*(state.shape if len(state.shape) == 2 else (4, 1)), result)


def cosine_and_sine(
    algorithm: str, method: str, axes: str, increments: int
) -> tuple[PolyElement, PolyElement]:
    """Return length times cosine and sine of the angle that a step turns by; of half of it for "euler".

    The sine is that part of it which is about each of the axes.
    """
    turn = transition(algorithm, method, axes, increments)
    if algorithm == "euler":
        vector, cosine = turn[:3, :], turn[3]
    else:
        # A = n n' + cosine (I - n n') + sine skew(n)
        cosine = (turn.trace() - 1) / 2
        vector = sp.Matrix([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
    along = [vector["xyz".index(axis)] for axis in axes]
    assert len(set(along)) == 1 and vector.dot(vector).expand() == (len(axes) * along[0] ** 2).expand()
    return RING(sp.Poly(cosine, X).as_expr().subs(X, x.as_expr())), RING(along[0].subs(X, x.as_expr()))


@cache
def lost(algorithm: str, method: str, axes: str = "y", increments: int = 2) -> sp.Expr:
    """Return the angle lost in a step about each of the axes, as a series in x, the angle about each."""
    cosine, sine = cosine_and_sine(algorithm, method, axes, increments)
    factor = 2 if algorithm == "euler" else 1
    # The derivative of the angle is rational, so its series needs no root and no branch.
    length = rs_series_inversion(cosine**2 + len(axes) * sine**2, x, TERMS)
    rate = rs_mul(sine.diff(x) * cosine - sine * cosine.diff(x), length, x, TERMS)
    return (x - factor * rs_integrate(rate, x)).as_expr(X)


def leading(series: sp.Expr) -> tuple[sp.Expr, int]:
    """Return the coefficient and the power of the lowest term."""
    power = min(m[0] for m in sp.Poly(series, X).monoms())
    return sp.Poly(series, X).coeff_monomial(X**power), power


def ratio(above: sp.Expr, below: sp.Expr, terms: int) -> sp.Expr:
    """Return the first terms of a quotient of two series, up to the power `terms` - 1."""
    lowest = leading(below)[1]
    numerator, denominator = (
        RING.from_expr(sp.expand(series / X**lowest).subs(X, x.as_expr())) for series in (above, below)
    )
    return rs_mul(numerator, rs_series_inversion(denominator, x, terms), x, terms).as_expr(X)


@pytest.mark.parametrize("method", STANDARD_METHODS)
def test_the_loss_is_that_of_a_truncated_exponential(method):
    # A step of order p multiplies cos + i sin by the powers of exp(ix) up to p, of exp(ix/2) for Euler parameters.
    for algorithm, angle in (("dcm", X), ("euler", X / 2)):
        cosine, sine = (part.as_expr(X) for part in cosine_and_sine(algorithm, method, "y", 2))
        powers = [(sp.I * angle) ** k / sp.factorial(k) for k in range(int(method[2:]) + 1)]
        assert sp.expand(cosine + sp.I * sine - sum(powers)) == 0


@pytest.mark.parametrize(
    ("method", "printed"),
    [
        ("rk1", sp.Rational(1, 4) + 9 * X**2 / 80),
        ("rk2", sp.Rational(1, 4) + 9 * X**2 / 160),
        ("rk3", sp.Rational(1, 16)),
        ("rk4", sp.Rational(1, 16)),
    ],
)
def test_claim_2_drift_of_euler_parameters_against_direction_cosines(method, printed):
    terms = 3 if printed.has(X) else 1
    assert ratio(lost("euler", method), lost("dcm", method), terms) == printed


@pytest.mark.parametrize("axes", ["y", "xyz"])
@pytest.mark.parametrize("method", STANDARD_METHODS)
def test_claim_2_the_ratio_is_of_a_half_step(method, axes):
    # 2 delta(x/2)/delta(x), whatever the axis: Euler parameters see half the angle.
    delta = lost("dcm", method, axes)
    assert sp.expand(lost("euler", method, axes) - 2 * delta.subs(X, X / 2)) == 0


@pytest.mark.parametrize("algorithm", STEP_NAMES)
@pytest.mark.parametrize(("low", "high", "expected"), [(1, 2, (-1, 2)), (3, 4, (-1, 4))])
def test_claim_3_orders_in_pairs(algorithm, low, high, expected):
    # Second order loses -1/2 of first, fourth -1/4 of third (McKern): of one power, of opposite signs.
    first, second = leading(lost(algorithm, f"rk{low}")), leading(lost(algorithm, f"rk{high}"))
    assert first[1] == second[1]
    assert second[0] / first[0] == sp.Rational(*expected)


@pytest.mark.parametrize("algorithm", STEP_NAMES)
def test_claim_3_the_powers(algorithm):
    assert [leading(lost(algorithm, method))[1] for method in STANDARD_METHODS] == [3, 3, 5, 5]


@pytest.mark.parametrize("algorithm", STEP_NAMES)
def test_claim_4_three_equal_axes_against_one(algorithm):
    ratios = {
        axes: ratio(lost(algorithm, "rk4", axes), lost(algorithm, "rk1", axes), 7) for axes in ("y", "xyz")
    }
    assert ratio(ratios["xyz"], ratios["y"], 1) == 3


def test_claim_4_at_the_rate_of_the_thesis():
    # 10 deg/s and steps of 1/8 s: what the series leave out is below x^8.
    angle = float(sp.rad(10)) / 8
    value = {
        (axes, method): float(lost("dcm", method, axes).subs(X, angle))
        for axes in ("y", "xyz")
        for method in ("rk1", "rk4")
    }
    ratios = {axes: value[axes, "rk4"] / value[axes, "rk1"] for axes in ("y", "xyz")}
    assert ratios["xyz"] / ratios["y"] == pytest.approx(3.00069, abs=5e-6)


def parts(computed: sp.Matrix, truth: sp.Matrix) -> dict[str, list]:
    """Return the error matrix's parts, from its kernel."""
    kernel = derived.kernel(choose("error-matrix"))
    names = [name for signal in kernel.inputs for name in signal.elements]
    return kernel.expand(dict(zip(names, [*computed, *truth], strict=True)))


def true_turn(steps: int = 1, terms: int = TERMS) -> sp.Matrix:
    """Return the true attitude after some steps, its series in x up to a number of terms."""
    angle = steps * X
    cosine = sum((-1) ** k * angle ** (2 * k) / sp.factorial(2 * k) for k in range(terms))
    sine = sum((-1) ** k * angle ** (2 * k + 1) / sp.factorial(2 * k + 1) for k in range(terms))
    return sp.Matrix([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])


@pytest.mark.long
@pytest.mark.parametrize("method", STANDARD_METHODS)
def test_claim_1_on_one_axis(method):
    """There is no skew; drift and scale grow linearly.

    After n steps they are n times the error of one, to leading order in the angle of a step.
    """
    turn, computed, order = transition("dcm", method, "y"), sp.eye(3), int(method[2:])
    found = []
    for steps in range(1, 5):
        computed = (computed * turn).expand()
        errors = parts(computed, true_turn(steps, order + 3))
        assert [sp.expand(element) for element in errors["skew"]] == [0, 0, 0]
        assert errors["drift"][0] == errors["drift"][2] == 0
        found.append([leading(sp.expand(errors[k][1 if k == "drift" else 0])) for k in ("drift", "scale")])
    one = found[0]
    assert {one[0][1], one[1][1]} == {order + 1, order + 2}
    for n, row in enumerate(found, 1):
        assert [(n * coefficient, power) for coefficient, power in one] == row


@pytest.mark.parametrize("method", STANDARD_METHODS)
def test_drift_is_positive_where_angle_is_lost(method):
    # Of one step, to leading order: the drift about the axis is the angle lost.
    errors = parts(transition("dcm", method, "y"), true_turn())
    assert leading(sp.expand(errors["drift"][1])) == leading(lost("dcm", method))


# More samples, and other methods


def turn_at_a_constant_rate(algorithm: str, method: str, increments: int, previous: int = 0) -> list:
    """Return the step of the identity as polynomials of the angles that it turns by, in equal increments."""
    step = derived.kernel(choose(algorithm, method, increments, previous=previous))
    state, d = step.inputs
    ring, *angles = sp.ring("x y z", sp.QQ)
    values = dict(zip(state.elements, map(ring, step.attitude_step.identity), strict=True))
    share = [angle * sp.QQ(1, increments) for angle in angles]
    values |= dict(zip(d.elements, share * (increments + previous), strict=True))
    return [ring(element) for element in step.expand(values)["next"]]


def truncated_exponential(algorithm: str, order: int) -> list:
    """Return the powers of the generator up to an order, divided by their factorials."""
    ring, x, y, z = sp.ring("x y z", sp.QQ)
    if algorithm == "dcm":
        K = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    else:
        K = [[0, z, -y, x], [-z, 0, x, y], [y, -x, 0, z], [-x, -y, -z, 0]]
    scale = sp.QQ(1, 1 if algorithm == "dcm" else 2)
    K = np.array([[ring(element) * scale for element in row] for row in K], object)
    total = power = np.array([[ring(int(j == k)) for k in range(len(K))] for j in range(len(K))], object)
    for n in range(1, order + 1):
        power = power @ K * sp.QQ(1, n)
        total = total + power
    return list(total.flat if algorithm == "dcm" else total[:, 3])


#: The others have polynomials of hundreds of terms; that equal increments give a constant rate is proved for all.
RATIONAL = [name for name in TABLEAUX if TABLEAUX[name].rational and TABLEAUX[name].order < 7]


@pytest.mark.long
@pytest.mark.parametrize(
    "method",
    [
        *STANDARD_METHODS,
        *(pytest.param(m, marks=pytest.mark.long) for m in RATIONAL if m not in STANDARD_METHODS),
    ],
)
@pytest.mark.parametrize("algorithm", STEP_NAMES)
def test_no_number_of_increments_changes_a_step_at_a_constant_rate(algorithm, method):
    # On any axis: the same polynomial, so that all of the above holds for every count.
    one = turn_at_a_constant_rate(algorithm, method, 1)
    for increments in range(2, MOST_INCREMENTS + 1):
        assert turn_at_a_constant_rate(algorithm, method, increments) == one
    for increments, previous in ((1, 1), (1, 3), (2, 2), (3, 1), (8, 3)):
        assert turn_at_a_constant_rate(algorithm, method, increments, previous) == one


@pytest.mark.long
@pytest.mark.parametrize("method", [*STANDARD_METHODS, "taylor2", "taylor5", "taylor8"])
@pytest.mark.parametrize("algorithm", STEP_NAMES)
def test_at_a_constant_rate_a_step_is_the_exponential_cut_off(algorithm, method):
    # A Taylor series on one and two samples; on more it starts at the middle of the step.
    order = int(method.removeprefix("taylor").removeprefix("rk"))
    expected = truncated_exponential(algorithm, order)
    samples = ((1, 0), (2, 0), (1, 1)) if method.startswith("taylor") else ((1, 0), (3, 0), (8, 0), (2, 1))
    for increments, previous in samples:
        assert turn_at_a_constant_rate(algorithm, method, increments, previous) == expected


def halves_cut_off_and_normalized(algorithm: str, order: int, angles: list[sp.Rational]) -> list[sp.Rational]:
    """Return the turn of the cut exponentials of two half steps, divided by their length.

    Parameters
    ----------
    angles : list of Rational
        What the whole step turns by about each axis.
    """
    half = [element(*(angle / 2 for angle in angles)) for element in truncated_exponential("euler", order)]
    *vector, scalar = map(sp.Rational, map(str, half))
    vector = sp.Matrix(vector)
    square = scalar**2 + vector.dot(vector)
    # The square of a quaternion: its length is the square of the length, so that no root is left.
    whole = [*(2 * scalar * vector / square), (scalar**2 - vector.dot(vector)) / square]
    if algorithm == "euler":
        return whole
    x, y, z, s = whole
    skew = sp.Matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return list(sp.eye(3) + 2 * s * skew + 2 * skew**2)


@pytest.mark.long
@pytest.mark.parametrize("method", ["taylor2", "taylor5", "taylor8"])
@pytest.mark.parametrize("algorithm", STEP_NAMES)
def test_at_a_constant_rate_a_centred_step_is_two_half_exponentials_cut_off_and_normalized(algorithm, method):
    # Rational functions of degree up to 32 that agree in exact arithmetic at arguments drawn from 10^6 of them.
    random = Random(1969)
    order = int(method.removeprefix("taylor"))
    for increments, previous in ((3, 0), (max(order, 3), 0), (2, 1)):
        step = derived.kernel(choose(algorithm, method, increments, previous=previous))
        state, d = step.inputs
        for _ in range(3):
            angles = [sp.Rational(random.randint(-(10**6), 10**6), 10**6) for _ in "xyz"]
            values = dict(zip(state.elements, step.attitude_step.identity, strict=True))
            share = [angle / increments for angle in angles]
            values |= dict(zip(d.elements, share * (increments + previous), strict=True))
            expected = halves_cut_off_and_normalized(algorithm, order, angles)
            assert step.expand(values)["next"] == expected


@pytest.mark.parametrize("method", ["taylor2", "taylor5", "taylor8"])
@pytest.mark.parametrize("algorithm", STEP_NAMES)
def test_a_centred_step_loses_the_angle_of_two_half_steps_at_a_constant_rate(algorithm, method):
    # Of even order, whatever the order of the series: 2 delta(x/2) for the half steps of Euler parameters.
    order = int(method.removeprefix("taylor"))
    powers = [(x / 4) ** k / sp.factorial(k) for k in range(order + 1)]
    cosine = sum(((-1) ** (k // 2) * power for k, power in enumerate(powers) if k % 2 == 0), RING(0))
    sine = sum(((-1) ** (k // 2) * power for k, power in enumerate(powers) if k % 2), RING(0))
    length = rs_series_inversion(cosine**2 + sine**2, x, TERMS)
    rate = rs_mul(sine.diff(x) * cosine - sine * cosine.diff(x), length, x, TERMS)
    loss = (x - 4 * rs_integrate(rate, x)).as_expr(X)
    assert leading(loss)[1] == order + 1 + order % 2
    angle = sp.Rational(1, 10)
    kernel = derived.kernel(choose(algorithm, method, 3))
    values = dict(zip(kernel.inputs[0].elements, kernel.attitude_step.identity, strict=True))
    values |= {name: angle / 3 if name[-1] == "y" else sp.Integer(0) for name in kernel.inputs[1].elements}
    turn = kernel.expand(values)["next"]
    computed = 2 * sp.atan2(turn[1], turn[3]) if algorithm == "euler" else sp.atan2(turn[2], turn[0])
    # Of the series of the loss the terms above x^11 are left out, at x = 1/10.
    assert (angle - computed).evalf(60) / loss.subs(X, angle) == pytest.approx(1, abs=1e-3)
