"""Power series in a small quantity: arithmetic that agrees with SymPy's own series."""

from __future__ import annotations

import pytest
import sympy as sp

from strapgen.kernel import algebra
from strapgen.kernel.power_series import Powers, function

RING, X, Y = sp.ring("x y", sp.QQ)
TOP = 5
H = sp.Symbol("h")
x, y = sp.symbols("x y")


def number(value: sp.Rational) -> Powers:
    return Powers(RING, {0: RING(RING.domain.from_sympy(sp.sympify(value)))}, TOP)


def evaluated(expression: sp.Expr) -> sp.Expr:
    """Return an expression of a = h x and b = h^2 y as a series."""
    values = {"a": Powers(RING, {1: X}, TOP), "b": Powers(RING, {2: Y}, TOP)}
    made = algebra.evaluate(expression, values, number, function)
    assert isinstance(made, Powers)
    return sum(part.as_expr() * H**power for power, part in made.parts.items())


def expected(expression: sp.Expr) -> sp.Expr:
    replaced = expression.subs({sp.Symbol("a", real=True): H * x, sp.Symbol("b", real=True): H**2 * y})
    if replaced.has(sp.sinc):  # SymPy has no series of it
        (argument,) = {part.args[0] for part in replaced.atoms(sp.sinc)}
        replaced = sp.sin(argument).series(H, 0, TOP + 2).removeO() / argument
    return sp.series(sp.expand(replaced), H, 0, TOP + 1).removeO()


a, b = sp.symbols("a b", real=True)


@pytest.mark.long
@pytest.mark.parametrize(
    "expression",
    [
        a * b - 3 * a**2 + sp.Rational(1, 7),
        (1 + a) ** 5,
        1 / (1 + a - b),
        (2 + b) / (3 - a) ** 2,
        sp.sqrt(4 + a),
        1 / sp.sqrt(1 + a**2 + b),
        sp.cos(a + b),
        sp.sin(a) * (1 + b),
        sp.sinc(a / 2),
        sp.asin(a - b) + sp.atan2(a, 1 + b),
        (4 + a) ** sp.Rational(3, 2),
        sp.Max(a**2, 1) + sp.Piecewise((b, a > 1), (a, True)),
    ],
    ids=str,
)
def test_expressions_give_their_series(expression):
    wanted = a - a + (1 + a if expression.has(sp.Max) else 0)
    wanted = expected(wanted if expression.has(sp.Max) else expression)
    assert sp.expand(evaluated(expression) - wanted) == 0


def test_even_functions_of_a_root_are_series():
    angle = sp.sqrt(a**2 + b**2)
    made = evaluated(sp.cos(angle / 2) + sp.sinc(angle))
    square = (H * x) ** 2 + (H**2 * y) ** 2
    wanted = sum(
        sp.Rational((-1) ** k) * (square / 4) ** k / sp.factorial(2 * k)
        + sp.Rational((-1) ** k) * square**k / sp.factorial(2 * k + 1)
        for k in range(5)
    )
    cut = sum(sp.expand(wanted).coeff(H, power) * H**power for power in range(TOP + 1))
    assert sp.expand(made - cut) == 0


@pytest.mark.parametrize(
    ("expression", "says"),
    [
        (1 / a, "begins with 0"),
        (sp.sqrt(2 + a), "no series as its root"),
        (sp.sqrt(a**2 + b) + a, "root of a series that begins with 0"),
        (sp.sqrt(a**2 + b) + sp.sqrt(a), "root of a series that begins with 0"),
        (sp.sqrt(a**2 + b) * sp.sqrt(b), "root of a series that begins with 0"),
        (sp.sin(sp.sqrt(a)), "root of a series that begins with 0"),
        ((a**2 + b) ** sp.Rational(3, 2), "an odd power of it"),
        (a ** sp.Rational(1, 3), "the power 1/3"),
        (sp.cos(1 + a), "no series with rational coefficients"),
        (sp.sin(1 + a), "sin is no power series"),
        (sp.acos(a), "acos is no power series"),
        (sp.pi * a, "pi is no root of a polynomial"),
        (sp.atan2(a, b), "does not begin on the first axis"),
        (sp.atan2(1 + a, b), "atan2 is no power series"),
        (sp.Max(a, b), "at its very limit"),
        (sp.Piecewise((1, a > 0), (2, True)), "at its very limit"),
    ],
    ids=str,
)
def test_what_has_no_series_says_so(expression, says):
    with pytest.raises(ArithmeticError, match=says):
        evaluated(expression)


def test_an_odd_power_of_a_root_is_no_series():
    root = function(sp.sqrt(sp.Symbol("square")), [Powers(RING, {2: X * X}, TOP)])
    assert (root**2).parts == {2: X**2}
    with pytest.raises(ArithmeticError, match="odd power"):
        root**3
