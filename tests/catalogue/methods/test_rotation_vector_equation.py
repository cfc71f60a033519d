"""Bortz's equation derived from the quaternion's, its truncations, and what they cost."""

from __future__ import annotations

from functools import cache

import pytest
import sympy as sp

from strapgen import derive
from strapgen.catalogue.kinematics import EULER
from strapgen.catalogue.methods.runge_kutta import bortz
from strapgen.kernel import algebra
from strapgen.kernel.algebra import cross_elements

A = sp.Symbol("alpha", positive=True)
#: alpha . w, and the coefficients of the derivative of alpha along w, alpha x w and alpha.
P, X, Y, Z = sp.symbols("P X Y Z")
#: Equation (20): the bracket over the square of the angle.
BRACKET = (1 - A * sp.sin(A) / (2 * (1 - sp.cos(A)))) / A**2

#: Sine and cosine of half the angle.
SINE, COSINE = sp.symbols("s c")


def halved(expression: sp.Expr) -> sp.Expr:
    """Return an expression with the sine and cosine of the angle and of its half in those of its half."""
    functions = {
        sp.sin(A): 2 * SINE * COSINE,
        sp.cos(A): 1 - 2 * SINE**2,
        sp.sin(A / 2): SINE,
        sp.cos(A / 2): COSINE,
    }
    return expression.xreplace(functions)


def vanishes(expression: sp.Expr) -> bool:
    """Decide whether a rational function of the angle and of the functions in `halved` is zero.

    The angle and a sine of it have no algebraic relation, so that only sine and cosine of half the angle do.
    """
    numerator, _ = sp.fraction(sp.together(halved(expression)))
    assert not numerator.has(sp.sin, sp.cos)
    return bool(sp.rem(sp.Poly(numerator, COSINE), sp.Poly(COSINE**2 + SINE**2 - 1, COSINE)).is_zero)


def test_bortz_equation_is_that_of_the_codes_quaternions():
    # Component by component: the derivative of the quaternion of alpha, where alpha obeys (20), is the product h w / 2
    # of the kinematics, its order and signs included.
    alpha, w = (sp.Matrix(sp.symbols(f"{name}x {name}y {name}z")) for name in "aw")
    first = algebra.cross(alpha, w)
    rate = w + first / 2 + BRACKET * algebra.cross(alpha, first)
    f3, f4 = sp.sin(A / 2) / A, sp.cos(A / 2)
    angle_rate = algebra.dot(alpha, rate) / A
    derivative = sp.Matrix([*(sp.diff(f3, A) * angle_rate * alpha + f3 * rate), sp.diff(f4, A) * angle_rate])
    wanted = EULER.derivative(sp.Matrix([*(f3 * alpha), f4]), EULER.scale * w)
    for x, y in zip(derivative, wanted, strict=True):
        polynomial = sp.Poly(halved(x - y), *alpha, *w)
        # The square of the last component is what the others leave of the square of the angle.
        square = sp.Poly(algebra.dot(alpha, alpha) - A**2, *alpha, *w)
        rest = sp.rem(polynomial, square, alpha[2])
        assert all(map(vanishes, sp.Poly(rest, *alpha, *w).coeffs()))


@cache
def powers_of_bracket() -> sp.Expr:
    """Return the series of the bracket to the fourth power of the angle."""
    return sp.series(BRACKET, A, 0, 5).removeO()


@pytest.mark.long
def test_the_series_of_the_bracket_is_that_of_the_kernels():
    # 1/12 + alpha^2/720 + alpha^4/30240: what `bortz` has, whose coefficients are Bernoulli's numbers.
    wanted = powers_of_bracket()
    assert sp.expand(wanted - (sp.Rational(1, 12) + A**2 / 720 + A**4 / 30240)) == 0
    # alpha along x, w along y: alpha x (alpha x w) = -alpha^2 w, and so on.
    rate = bortz(sp.Matrix([A, 0, 0]), sp.Matrix([0, 1, 0]), 6)
    assert sp.expand(rate[1] - 1 + A**2 * wanted) == 0
    assert sp.expand(rate[2] - A / 2) == 0


# Truncations, on a rate that is any power series of the time

ORDER = 5
RING, *SYMBOLS = sp.ring(" ".join(f"w{k}{axis}" for k in range(ORDER) for axis in "xyz"), sp.QQ)
#: The rate and its derivatives at the start.
W = [SYMBOLS[3 * k : 3 * k + 3] for k in range(ORDER)]
ZERO = [RING(0)] * 3
Series = list[list]


def product(left: Series, right: Series) -> Series:
    """Return the cross product of two vectors by powers of the time, to the order."""
    total = [list(ZERO) for _ in range(ORDER + 1)]
    for j, a in enumerate(left):
        for k, b in enumerate(right[: ORDER + 1 - j]):
            total[j + k] = [x + y for x, y in zip(total[j + k], cross_elements(a, b), strict=True)]
    return total


def add(*terms: tuple[sp.Rational | int, Series]) -> Series:
    return [
        [sum((x * factor for factor, series in terms for x in [series[n][k]]), RING(0)) for k in range(3)]
        for n in range(ORDER + 1)
    ]


def integral(series: Series) -> Series:
    return [list(ZERO)] + [[x / (n + 1) for x in series[n]] for n in range(ORDER)]


#: w_k t^k / k!
RATE: Series = [[x / sp.factorial(k) for x in vector] for k, vector in enumerate(W)] + [list(ZERO)]


def solved(coefficients: list[sp.Rational]) -> Series:
    """Return alpha of D alpha = sum of coefficients times nested products alpha x (alpha x ... w), by Picard."""
    alpha = [list(ZERO) for _ in range(ORDER + 1)]
    for _ in range(ORDER):
        terms, nested = [], RATE
        for coefficient in coefficients:
            terms.append((coefficient, nested))
            nested = product(alpha, nested)
        alpha = integral(add(*terms))
    return alpha


HALF, TWELFTH = sp.Rational(1, 2), sp.Rational(1, 12)
#: (20) to fifth order in alpha: every other coefficient beyond the first is zero.
WHOLE = [sp.S.One, HALF, TWELFTH, sp.S.Zero, -sp.Rational(1, 720)]


def second() -> Series:
    """Return phi of (22): beta, and the integral of beta x w / 2."""
    beta = integral(RATE)
    return add((1, beta), (HALF, integral(product(beta, RATE))))


@cache
def exact() -> Series:
    return solved(WHOLE)


def difference(approximate: Series, power: int) -> list:
    return [a - b for a, b in zip(approximate[power], exact()[power], strict=True)]


def combination(*terms) -> list:
    return [sum((vector[k] * factor for factor, vector in terms), RING(0)) for k in range(3)]


def test_the_coefficients_are_those_of_the_bracket():
    # alpha x (alpha x (alpha x (alpha x w))) is -alpha^2 alpha x (alpha x w): the sign of 1/720 turns over.
    series = powers_of_bracket()
    assert [series.coeff(A, 0), -series.coeff(A, 2)] == [WHOLE[2], WHOLE[4]]


TIMED, TIME = sp.ring("T", RING.to_domain())


@cache
def recursion(cycles: int) -> Series:
    """Return phi of (26) after so many fast cycles, the increment before the first one known."""
    turned = integral(RATE)

    def angle(k: int) -> list:
        end = sp.Rational(k, cycles)
        return [
            sum((TIME**n * (x[axis] * end**n) for n, x in enumerate(turned)), TIMED(0)) for axis in range(3)
        ]

    def given(kernel, state) -> dict:
        values = {name: x for s in kernel.inputs for name, x in zip(s.elements, state[s.name], strict=True)}
        return {name: list(map(TIMED, x)) for name, x in kernel.expand(values).items()}

    fast, zero = derive("coning-fast"), [TIMED(0)] * 3
    increments = [[b - a for a, b in zip(angle(k - 1), angle(k), strict=True)] for k in range(cycles + 1)]
    state = {"angle_sum": zero, "coning": zero, "previous_increment": increments[0]}
    for increment in increments[1:]:
        made = given(fast, state | {"increment": increment})
        state = {name: made[output] for output, name in fast.recursion.inputs.items()}
    phi = given(derive("coning-slow"), state)["rotation_vector"]
    return [[x.coeff(TIME**n) for x in phi] for n in range(ORDER + 1)]


@pytest.mark.parametrize("cycles", [1, 2, 3])
def test_the_recursion_compares_with_third_order(cycles):
    # (26) against (20), on any rate: nothing up to the third power, as of a method of third order. The fourth has what
    # a ramp leaves of a curved rate, -w0 x w2 / 24, by the cube of the number of cycles. (21) begins with the sixth
    # power, (22) with the fifth: more cycles bring the recursion to (22).
    made = recursion(cycles)
    assert all(difference(made, power) == ZERO for power in range(4))
    w0, _, w2 = W[:3]
    wanted = combination((-sp.Rational(1, 24 * cycles**3), cross_elements(w0, w2)))
    assert difference(made, 4) == wanted != ZERO


def test_the_recursion_leaves_the_fifth_power_of_two_integrals():
    # What stands in the fifth power for any number N of cycles is that of (22), and terms in 1/N^2 and less of two
    # vectors only: (26) has the products of three and four that (22) has.
    for cycles in (1, 2):
        found, wanted = difference(recursion(cycles), 5), difference(second(), 5)
        assert [sum((RING({m: c}) for m, c in x.terms() if sum(m) > 2), RING(0)) for x in found] == wanted


ANGLE = sp.Symbol("x", positive=True)


def across(products: int) -> list[sp.Expr]:
    """Return Bortz's series where the rotation vector is x about z and the rate 1 about x."""
    return [sp.expand(e) for e in bortz(sp.Matrix([0, 0, ANGLE]), sp.Matrix([1, 0, 0]), products)]


@pytest.mark.long
def test_the_coefficients_of_bortz_are_bernoulli_s():
    # phi x w is x about y, phi x (phi x w) is -x^2 about x: each product has a power of its own.
    along, beside, none = across(4)
    assert none == 0
    found = [sp.Poly(beside, ANGLE).coeff_monomial(ANGLE), -sp.Poly(along, ANGLE).coeff_monomial(ANGLE**2)]
    found += [
        -sp.Poly(beside, ANGLE).coeff_monomial(ANGLE**3),
        sp.Poly(along, ANGLE).coeff_monomial(ANGLE**4),
    ]
    assert found == [sp.Rational(1, 2), sp.Rational(1, 12), 0, -sp.Rational(1, 720)]
    # (-1)^k B_k/k! with B_1 = -1/2, which SymPy gives either sign by its release.
    numbers = [-sp.Rational(1, 2), *(sp.bernoulli(k) for k in (2, 3, 4))]
    assert found == [(-1) ** k * b / sp.factorial(k) for k, b in enumerate(numbers, 1)]


@pytest.mark.long
def test_the_series_is_that_of_bortz_s_closed_form():
    # w + phi x w/2 + (1 - (x/2) cot(x/2))/x^2 phi x (phi x w).
    along, beside, _ = across(10)
    closed = sp.series(ANGLE / 2 * sp.cot(ANGLE / 2), ANGLE, 0, 12).removeO()
    assert sp.expand(along - closed) == 0
    assert beside == ANGLE / 2


@pytest.mark.long
@pytest.mark.parametrize("products", [0, 1, 2])
def test_the_series_solves_the_equation_of_rotation(products):
    # The rotation vector p t + q t^2 turns at the rate w with dR/dt = R skew(w): its series has that derivative.
    t = sp.Symbol("t")
    p, q = sp.Matrix([1, 2, -1]) / 3, sp.Matrix([2, -1, 1]) / 5
    phi = p * t + q * t**2

    def skew(v: sp.Matrix) -> sp.Matrix:
        return sp.Matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])

    K, R, power = skew(phi), sp.eye(3), sp.eye(3)
    for n in range(1, 7):
        power = (power * K).applyfunc(sp.expand) / n
        R += power
    W = (R.T * R.diff(t)).applyfunc(sp.expand)  # skew(w) up to t^5
    w = sp.Matrix([W[2, 1], W[0, 2], W[1, 0]])
    left = (bortz(phi, w, products) - phi.diff(t)).applyfunc(sp.expand)
    lowest = min(min(m[0] for m in sp.Poly(e, t).monoms()) for e in left if e != 0)
    # Of p t + q t^2 the first product with its own derivative is t^2 p x q, every further one brings a power.
    assert lowest == products + 2 if products < 2 else lowest >= 5
