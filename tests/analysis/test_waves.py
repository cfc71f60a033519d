"""Sums of shifted oscillations as complex numbers, and kernels to second order beside SymPy's own series."""

from __future__ import annotations

import cmath
from fractions import Fraction

import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st

from strapgen import derive
from strapgen.analysis.vibration.waves import Expander, Wave, resolvent
from strapgen.ir.exceptions import InputError
from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import KernelBuilder

CYCLE = (3, 0)
shifts = st.tuples(st.integers(-5, 5), st.integers(-2, 2))
coefficients = st.fractions(-3, 3, max_denominator=4)
waves = st.builds(
    lambda terms: Wave(CYCLE, {}) + Wave(CYCLE, terms), st.dictionaries(shifts, coefficients, max_size=5)
)


def value(wave, angles=(0.37, 1.234)):
    z = cmath.exp(1j * CYCLE[0] * angles[0])
    total = 0
    for shift, c in wave.terms.items():
        total += float(c) * cmath.exp(1j * sum(a * s for a, s in zip(angles, shift, strict=True)))
    return total / (z - 1) ** wave.poles


@pytest.mark.long
@given(waves, waves, coefficients)
def test_waves_are_complex_numbers(left, right, factor):
    left, right = left.summed(), right.summed().summed()
    z = cmath.exp(1j * CYCLE[0] * 0.37)
    near = pytest.approx
    assert value(left + right) == near(value(left) + value(right), abs=1e-9)
    assert value(left * right) == near(value(left) * value(right), abs=1e-9)
    assert value(right.conjugate()) == near(value(right).conjugate(), abs=1e-9)
    assert value(left.scaled(factor)) == near(float(factor) * value(left), abs=1e-9)
    assert value(left.summed()) == near(value(left) / (z - 1), abs=1e-9)


@pytest.mark.long
@given(waves)
def test_sums_of_differences_have_no_poles(wave):
    difference = wave.shifted(CYCLE) + wave.scaled(-1)
    assert difference.summed() == wave
    assert difference.summed().poles == 0


@pytest.mark.parametrize(
    ("matrix", "zeros", "ones"),
    [
        ([[1, 0], [0, 1]], 0, 2),
        ([[1, 2], [0, 0]], 1, 1),
        ([[0, 1, 0], [0, 0, 1], [0, 0, 0]], 3, 0),
        ([[1, 0, 0], [3, 1, 0], [0, 2, 0]], 1, 2),
        ([["1/2", "1/2"], ["1/2", "1/2"]], 1, 1),
    ],
)
def test_the_resolvent_is_the_inverse(matrix, zeros, ones):
    exact = [[Fraction(x) for x in row] for row in matrix]
    powers, found_zeros, found_ones = resolvent(exact, Fraction(1))
    assert (found_zeros, found_ones) == (zeros, ones)
    z = sp.Symbol("z")
    size = len(matrix)
    adjugate = sum((z**k * sp.Matrix(power) for k, power in enumerate(powers)), sp.zeros(size, size))
    wanted = (z * sp.eye(size) - sp.Matrix(exact)).adjugate()
    assert (adjugate - wanted).applyfunc(sp.expand) == sp.zeros(size, size)


def test_other_eigenvalues_are_told():
    assert resolvent([[Fraction(1, 2)]], Fraction(1)) is None
    assert resolvent([[Fraction(0), Fraction(-1)], [Fraction(1), Fraction(0)]], Fraction(1)) is None
    # A 1 among them is divided out first.
    assert resolvent([[Fraction(1), Fraction(0)], [Fraction(5), Fraction(1, 2)]], Fraction(1)) is None
    assert resolvent([[Fraction(1), Fraction(0)], [Fraction(0), Fraction(2)]], Fraction(1)) is None


X, Y = sp.symbols("x y", real=True)


def kernel(*expressions, stages=()):
    build = KernelBuilder()
    for name in "xy":
        build.scalar(Signal.scalar(name))
    for name, expression in stages:
        build.value(name, expression)
    build.output(
        Signal("out", (len(expressions),), tuple(f"out{k}" for k in range(len(expressions)))), expressions
    )
    return build.kernel("made", "Made", "none")


def polynomial(expander, expansion):
    """Return an expansion as SymPy's expression."""
    total = expander.domain.to_sympy(expansion.constant)
    for name, c in expansion.linear.items():
        total += expander.domain.to_sympy(c) * sp.Symbol(name, real=True)
    for pair, c in expansion.square.items():
        total += expander.domain.to_sympy(c) * sp.Mul(*(sp.Symbol(name, real=True) for name in pair))
    return sp.expand(total)


def expanded(expression, stages=()):
    made = kernel(expression, stages=stages)
    expander = Expander([made])
    (result,) = expander(made, {name: expander.variable(name) for name in "xy"})["out"]
    return polynomial(expander, expander.expansion(result))


def truncated(expression):
    """Return Taylor's polynomial of second order by SymPy's derivatives; of a sinc, which has none at 0, the series."""
    e = sp.Symbol("e", positive=True)
    scaled = expression.replace(sp.sinc, lambda angle: 1 - angle**2 / 6)
    scaled = scaled.subs({X: e * X, Y: e * Y}, simultaneous=True)
    return sp.expand(sum(scaled.diff(e, k).subs(e, 0) / sp.factorial(k) for k in range(3)))


R = sp.sqrt(X**2 + 2 * Y**2)


@pytest.mark.parametrize(
    "expression",
    [
        (1 + X - 3 * Y) * (2 - X * Y + Y),
        (2 + X) ** 3 / (1 - Y),
        sp.sqrt(4 + X + Y**2) / 3,
        1 / sp.sqrt(1 + X - Y),
        sp.sin(X + Y) * sp.cos(X) + sp.asin(Y),
        sp.sinc(X - Y) * (1 + Y),
        sp.atan2(X + Y, 1 + X),
        sp.sqrt(3) * X / (1 + sp.sqrt(3) * Y),
    ],
    ids=str,
)
def test_expansions_are_those_of_sympy(expression):
    assert sp.expand(expanded(expression) - truncated(expression)) == 0


@pytest.mark.parametrize(
    ("expression", "wanted"),
    [
        (sp.sinc(R / 2), 1 - (X**2 + 2 * Y**2) / 24),
        (sp.cos(2 * R), 1 - 2 * (X**2 + 2 * Y**2)),
        (R**2 * (1 + X), X**2 + 2 * Y**2),
        (sp.Max(1, X**2) * Y, Y),
        (sp.Piecewise((X, Y**2 > 1), (Y, True)), Y),
        (sp.pi * X, None),
    ],
    ids=str,
)
def test_roots_and_branches(expression, wanted):
    if wanted is None:  # what is not algebraic is rounded to many digits
        assert abs(sp.N(expanded(expression).coeff(X) - sp.pi, 90)) < sp.Rational(1, 10) ** 75
    else:
        assert expanded(expression) == sp.expand(wanted)


@pytest.mark.parametrize(
    ("expression", "said"),
    [
        (1 / X, "a series that begins with 0 has no inverse"),
        (R + X, "the square root of a series that begins with 0 is no series"),
        (sp.cos(1 + X), "is no series with rational coefficients"),
    ],
    ids=str,
)
def test_functions_without_expansion_are_refused(expression, said):
    with pytest.raises(InputError, match="kernel made has no expansion to second order") as caught:
        expanded(expression)
    assert said in str(caught.value)


def test_kernels_of_the_catalogue_are_their_polynomials_cut_off():
    made = derive("dcm", "rk4", 2)
    expander = Expander([made])
    names = [name for signal in made.inputs for name in signal.elements]
    result = expander(made, {name: expander.variable(name) for name in names})["next"]
    for ours, whole in zip(result, made.polynomials()["next"], strict=True):
        wanted = sp.S.Zero
        for powers, c in whole.terms():
            if sum(powers) <= 2:
                factors = (sp.Symbol(n, real=True) ** p for n, p in zip(names, powers, strict=True))
                wanted += c * sp.Mul(*factors)
        assert polynomial(expander, expander.expansion(ours)) == sp.expand(wanted)
