"""The rotation of a rate that is a polynomial: against an accurate integration, and whatever parts it is cut into."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import accumulate
from operator import mul

import numpy as np
import pytest
import sympy as sp
from derived import turns

import strapgen
from strapgen.catalogue.kinematics import CAYLEY_KLEIN, DCM, EULER
from strapgen.catalogue.methods import polynomial_rotation
from strapgen.kernel import algebra
from strapgen.kernel.algebra import evaluate
from strapgen.kernel.kernel import KernelBuilder
from strapgen.lab.motions.rate_profiles import KNOT, ReferenceAttitude

#: Legendre coefficients of a rate times the step in rad, the largest of about 1 rad.
COEFFICIENTS = np.array(
    [[0.5, -0.7, 0.4], [-0.3, 0.1, 0.6], [0.2, 0.3, -0.1], [0.05, -0.1, 0.08], [-0.02, 0.03, 0.04]]
)


def numbers(build: KernelBuilder, expressions: sp.Matrix) -> np.ndarray:
    """Return expressions as numbers, through the stages of what is under construction."""
    values: dict[str, float] = {}
    for stage in build.stages:
        for name, expression in zip(stage.signal.elements, stage.expressions, strict=True):
            values[name] = number(expression, values)
    return np.array([number(expression, values) for expression in expressions])


def number(expression: sp.Expr, values: dict[str, float]) -> float:
    return float(evaluate(expression, values, float, lambda e, arguments: arguments[0] ** float(e.exp)))


def transition(kinematics, order: int, parts: int = 1) -> np.ndarray:
    """Return the transition of the coefficients as numbers."""
    build = KernelBuilder()
    vectors = [sp.Matrix([sp.Rational(str(x)) for x in row]) for row in COEFFICIENTS]
    return numbers(build, polynomial_rotation.rotation(build, kinematics, vectors, order, parts))


def reference() -> np.ndarray:
    """Return the attitude after one step, integrated in small substeps of time."""
    legendre = np.polynomial.legendre.Legendre

    def rate(time: np.ndarray) -> np.ndarray:
        return np.stack([legendre(column)(2 * time / KNOT - 1) for column in COEFFICIENTS.T], -1) / KNOT

    return ReferenceAttitude(rate, 256)(KNOT)


@pytest.mark.long
@pytest.mark.parametrize("parts", [1, 3])
def test_the_rotation_is_that_of_the_polynomial(parts):
    computed = transition(DCM, 24, parts).reshape(3, 3)
    np.testing.assert_allclose(computed, reference(), atol=1e-13)


@pytest.mark.long
def test_all_parameters_are_of_the_same_rotation():
    euler, cayley_klein = transition(EULER, 8), transition(CAYLEY_KLEIN, 8)
    np.testing.assert_allclose(cayley_klein, [euler[3], *euler[:3]], atol=1e-15)
    matrix = algebra.quaternion_matrix(sp.Matrix(euler))
    np.testing.assert_allclose(np.array(matrix, float), transition(DCM, 8).reshape(3, 3), atol=1e-15)


def test_a_constant_rate_about_an_axis_is_an_exponential():
    build = KernelBuilder()
    turn = sp.Matrix([0, 0, sp.Rational(1, 2)])
    rotation = polynomial_rotation.rotation(build, EULER, [turn], 20)
    half = numbers(build, rotation)
    assert half == pytest.approx([0, 0, math.sin(0.25), math.cos(0.25)], abs=1e-16)


@pytest.mark.long
@pytest.mark.parametrize(("increments", "previous"), [(1, 1), (3, 0)])
def test_the_exact_rotation_of_a_fit_is_the_limit_of_the_methods_that_use_it(increments, previous):
    """A Taylor series of high order on few increments is the same polynomial."""
    motion = strapgen.motion("coning", a_rad_s=2, b_rad_s=3, g_rad_s=1)
    samples = motion.increments(Fraction(1, 10), 30, increments, previous)
    fit, series = (
        accumulate(turns(strapgen.choose("euler", method, increments, previous=previous), samples), mul)
        for method in ("fit-exact", "taylor12")
    )
    for one, other in zip(fit, series, strict=True):
        np.testing.assert_allclose(one.as_quat(), other.as_quat(), atol=1e-14)


def test_the_exact_rotation_of_a_fit_takes_increments():
    with pytest.raises(strapgen.InputError, match="method fit-exact takes increments"):
        strapgen.choose("euler", "fit-exact", rates=True)
