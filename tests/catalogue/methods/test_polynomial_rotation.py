"""The rotation of a rate that is a polynomial: against an accurate integration, and whatever parts it is cut into."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import accumulate
from operator import mul
from random import Random

import mpmath
import numpy as np
import pytest
import sympy as sp
from derived import turns
from peano_baker import evaluated, generic_rate, increments, true_rotation

import strapgen
from strapgen import backend, choose, derive, motion, simulate
from strapgen.catalogue import ALGORITHMS, INTEGRATORS
from strapgen.catalogue.kinematics import CAYLEY_KLEIN, DCM, EULER
from strapgen.catalogue.methods import polynomial_rotation, rate_fit
from strapgen.ir.exceptions import InputError
from strapgen.kernel import algebra
from strapgen.kernel.algebra import evaluate
from strapgen.kernel.kernel import Kernel, KernelBuilder, evaluate_stages
from strapgen.lab.motions.motions import Motion
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


ALGORITHM = pytest.mark.parametrize("algorithm", ALGORITHMS)


@pytest.mark.long
@pytest.mark.parametrize("order", [1, 4, 7])
@ALGORITHM
def test_the_series_is_the_exact_one_cut_off(algorithm, order):
    # For a rate that the increments fit exactly, power by power: equal up to the order, and nothing beyond it
    # but what is left of the step's products of the rate's own powers.
    kernel = derive(algorithm, f"taylor{order}", 2)
    rate = generic_rate(1)
    names = kernel.inputs[1].elements
    found = evaluated(kernel, dict(zip(names, increments(rate, 2, 0, order), strict=True)), kernel.transition)
    for mine, true in zip(found, true_rotation(algorithm, rate, order), strict=True):
        assert mine.coefficients == true.coefficients


@pytest.mark.long
@pytest.mark.parametrize("name", [name for name in INTEGRATORS if name.startswith("taylor")])
def test_every_order_of_the_list_is_its_series(name):
    # At a constant rate about one axis: the exponential, cut off.
    order = int(name.removeprefix("taylor"))
    kernel = derive("euler", name, 1)
    ring, x = sp.ring("x", sp.QQ)
    state, samples = kernel.inputs
    values = dict(zip(state.elements, map(ring, kernel.attitude_step.identity), strict=True))
    values |= dict(zip(samples.elements, (x, ring(0), ring(0)), strict=True))
    result = [ring(element) for element in kernel.expand(values)["next"]]
    assert result[1] == result[2] == 0
    powers = [Fraction(1, 2**n) / sp.factorial(n) for n in range(order + 1)]
    signs = [(-1) ** (n // 2) for n in range(order + 1)]
    assert result[3] == sum(
        s * p * x**n for n, (s, p) in enumerate(zip(signs, powers, strict=True)) if n % 2 == 0
    )
    assert result[0] == sum(s * p * x**n for n, (s, p) in enumerate(zip(signs, powers, strict=True)) if n % 2)


@pytest.mark.long
def test_stages_are_the_terms_of_the_series():
    kernel = derive("euler", "taylor3", 2)
    assert [stage.signal.name for stage in kernel.stages] == [
        *("half_rate_0", "half_rate_1"),
        *("term_1", "term_2", "term_3"),
        "transition",
    ]
    assert kernel.stages[0].signal.meaning == "coefficient of t^0 in half of the rate times the step"
    d1, d2 = (sp.Symbol(f"d{k}_x", real=True) for k in (1, 2))
    # w(t) h = 3 d1 - d2 + 4 (d2 - d1) t (thesis, chapter 3 A), halved.
    assert sp.expand(kernel.stages[0].expressions[0] - (3 * d1 - d2) / 2) == 0
    assert sp.expand(kernel.stages[1].expressions[0] - 2 * (d2 - d1)) == 0


@pytest.mark.long
def test_a_series_takes_no_rates_at_nodes():
    with pytest.raises(
        InputError, match=r"^method taylor4 takes increments; rates at nodes do not go with it$"
    ):
        derive("euler", "taylor4", rates=True)


def cone(frequency_hz: float) -> Motion:
    """Return a cone of half-angle 5 degrees."""
    half_angle, omega = np.radians(5), 2 * np.pi * frequency_hz
    return motion(
        "coning",
        a_rad_s=omega * np.sin(half_angle),
        b_rad_s=omega,
        g_rad_s=-omega * (1 - np.cos(half_angle)),
    )


def mpmath_transition(kernel: Kernel, samples: list[mpmath.mpf]) -> mpmath.matrix:
    """Return the elements of the transition, in many digits."""
    state = dict.fromkeys(kernel.inputs[0].elements, mpmath.mpf(0))
    signal = next(stage.signal for stage in kernel.stages if stage.signal.name == "transition")
    values = state | dict(zip(kernel.inputs[1].elements, samples, strict=True))
    known = evaluate_stages(
        kernel.stages,
        values,
        lambda number: mpmath.mpf(number.p) / number.q,
        lambda power, arguments: arguments[0] ** (mpmath.mpf(power.exp.p) / power.exp.q),
    )
    flat = [known[name] for name in signal.elements]
    return mpmath.matrix([flat[k : k + 3] for k in (0, 3, 6)] if signal.shape == (3, 3) else flat)


@pytest.mark.long
@pytest.mark.parametrize(
    ("algorithm", "order", "count", "previous"),
    [("dcm", 2, 3, 0), ("euler", 4, 1, 3), ("cayley-klein", 4, 4, 0), ("euler", 8, 5, 0)],
)
def test_three_minutes_on_a_fast_cone_end_on_a_rotation(algorithm, order, count, previous):
    # Five samples a turn of the cone.
    runner = backend(algorithm, f"taylor{order}", count, previous=previous)
    step = f"{count}/100"
    run = simulate(runner, cone(20), step, 180, record=step)
    gram = np.einsum("nik,njk->nij", run.computed, run.computed)
    assert np.abs(gram - np.eye(3)).max() < 1e-9


@pytest.mark.parametrize(
    ("order", "count", "frequency_hz", "most_deg"),
    [
        (4, 3, 5, 0.005),
        *(
            pytest.param(*more, marks=pytest.mark.long)
            for more in ((6, 4, 5, 0.0004), (4, 4, 5, 0.012), (8, 4, 20, 1.3), (8, 5, 10, 0.025))
        ),
    ],
)
def test_the_series_from_the_middle_converges_where_that_from_the_beginning_does_not(
    order, count, frequency_hz, most_deg
):
    run = simulate(
        backend("euler", f"taylor{order}", count), cone(frequency_hz), f"{count}/100", "1.2", record="1.2"
    )
    assert np.degrees(run.mean_drift) < most_deg


@pytest.mark.long
@pytest.mark.parametrize(("algorithm", "order", "count"), [("dcm", 4, 3), ("dcm", 5, 4)])
def test_time_reversed_takes_the_step_back(algorithm, order, count):
    # Hence the order is even.
    kernel, random = derive(algorithm, f"taylor{order}", count), Random(1969)
    with mpmath.workdps(60):
        samples = [mpmath.mpf(random.randint(-999, 999)) / 1000 for _ in range(3 * count)]
        back = [-samples[3 * (count - 1 - k) + axis] for k in range(count) for axis in range(3)]
        product = mpmath_transition(kernel, samples) * mpmath_transition(kernel, back)
        assert mpmath.mnorm(product - mpmath.eye(3)) < mpmath.mpf(10) ** -50


def test_a_series_on_two_samples_is_no_rotation():
    assert not derive("euler", "taylor4", 2).attitude_step.isometry
    assert not derive("euler", "taylor4", 1, previous=1).attitude_step.isometry


def test_a_series_that_leaves_out_part_of_the_rate_is_refused():
    for order, count, previous, ahead in ((3, 4, 0, 0), (1, 8, 0, 0), (4, 2, 1, 2), (20, 8, 13, 0)):
        samples = count + previous + ahead
        needed = f"taylor{samples} to taylor20 and fit-exact keep" if samples < 20 else "fit-exact keeps"
        message = (
            f"method taylor{order} leaves out part of the rate through {samples} samples, "
            f"those beside the step included; {needed} all of it"
        )
        with pytest.raises(InputError, match=f"^{message}$"):
            choose("euler", f"taylor{order}", count, previous=previous, ahead=ahead)
    assert choose("euler", "taylor20", 8, previous=12).method == "taylor20"


def test_omitted_powers_are_of_first_order():
    # Five samples: without the fourth power of time, about the middle of the step, it would not turn by their sum.
    fit, half = rate_fit.from_increments(5), sp.Rational(1, 2)
    angles = [
        sum(
            (sp.Matrix(fit.taylor(k, half)) * 2 * half ** (k + 1) / (k + 1) for k in range(0, powers, 2)),
            sp.zeros(5, 1),
        )
        for powers in (5, 4)
    ]
    assert list(angles[0]) == [1] * 5 and not set(angles[1]) & {1}
