"""Irrational constants become rational to many digits, once, and nothing else changes."""

from __future__ import annotations

from fractions import Fraction
from random import Random

import derived
import mpmath
import pytest
import sympy as sp

from strapgen import derive
from strapgen.catalogue import Choice, choose
from strapgen.ir.program import Constant, walk
from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import DIGITS, Kernel, KernelBuilder, rationalize

#: Exact series of many methods: with the long tests.
pytestmark = pytest.mark.long

#: Kernels with roots in their coefficients.
IRRATIONAL = {
    "euler-cooper-verner8-2": ("euler", "cooper-verner8", 2, False),
    "dcm-cooper-verner8-rates": ("dcm", "cooper-verner8", None, True),
    "euler-magnus4-rates": ("euler", "magnus4", None, True),
    "dcm-magnus6-rates": ("dcm", "magnus6", None, True),
}


def chosen(name: str) -> Choice:
    algorithm, method, increments, rates = IRRATIONAL[name]
    return choose(algorithm, method, increments, rates)


def kernel(name: str) -> Kernel:
    return derived.kernel(chosen(name))


def one(expression: sp.Expr) -> sp.Expr:
    """Return what an expression becomes."""
    build = KernelBuilder()
    build.input(Signal.vector("v", "v"))
    build.output(Signal.scalar("y"), [expression])
    return rationalize(build.kernel("one", "One", "this test")).outputs[0].expressions[0]


@pytest.mark.parametrize("name", IRRATIONAL)
def test_a_rationalized_kernel_is_the_kernel_to_70_digits(name):
    exact, random = kernel(name), Random(1969)
    rounded = rationalize(exact)
    names = [element for signal in exact.inputs for element in signal.elements]
    with mpmath.workdps(100):
        values = {n: mpmath.mpf(random.randint(-999, 999)) / 1000 for n in names}
        found = [derived.precisely(made, values) for made in (exact, rounded)]
        for name in exact.outputs[0].signal.elements:
            # Some hundreds of constants below 100 in size, each off by 1e-80 of itself.
            assert abs(found[0][name] - found[1][name]) < mpmath.mpf(10) ** -70


@pytest.mark.parametrize("name", IRRATIONAL)
def test_no_irrational_number_is_left_and_a_note_says_so(name):
    rounded = rationalize(kernel(name))
    for stage in (*rounded.stages, *rounded.outputs):
        for expression in stage.expressions:
            assert not any(p.is_number and not p.is_Rational for p in expression.atoms(sp.Pow))
            assert not expression.has(sp.Float)
    (note,) = set(rounded.notes) - set(kernel(name).notes)
    assert note.startswith(f"Irrational constants are rounded to {DIGITS} digits")
    assert note in derived.program(chosen(name)).notes


@pytest.mark.parametrize("name", IRRATIONAL)
def test_programs_hold_fractions_near_the_constants(name):
    program = derived.program(chosen(name))
    constants = [n.value for a in program.body for n in walk(a.value) if isinstance(n, Constant)]
    assert constants and all(isinstance(value, Fraction) for value in constants)


@pytest.mark.parametrize("words", [("euler", "rk4", 2), ("dcm", "magnus6", 4), ("dcm", "butcher6", 3)])
def test_a_rational_kernel_is_left_as_it_is(words):
    made = derive(*words)
    assert rationalize(made) is made


def test_roots_of_variables_stay():
    made = derive("euler-normalize")
    assert rationalize(made) is made
    x, y, _ = sp.symbols("v_x v_y v_z", real=True)
    assert one(sp.sqrt(x) * sp.Rational(1, 3)) == sp.sqrt(x) / 3
    mixed = one(sp.sqrt(2) * sp.sqrt(x**2 + y**2) + sp.sqrt(3))
    assert mixed.has(sp.sqrt(x**2 + y**2)) and not mixed.has(sp.sqrt(2)) and not mixed.has(sp.sqrt(3))


def test_numbers_that_are_multiplied_become_one_constant():
    x, y, _ = sp.symbols("v_x v_y v_z", real=True)
    found = one(sp.sqrt(21) / 14 * x * y)
    coefficient, rest = found.as_coeff_Mul()
    assert rest == x * y and coefficient.is_Rational
    assert abs(coefficient - sp.N(sp.sqrt(21) / 14, 100)) < sp.Rational(1, 10) ** 79
    # sqrt(2) sqrt(3) is one root before it is rounded.
    assert one(sp.sqrt(2) * sp.sqrt(3) * x).as_coeff_Mul()[0] == one(sp.sqrt(6) * x).as_coeff_Mul()[0]
