"""The thesis's claims, by simulation, on every back end.

Where a claim holds to leading order, the run is compared with the exact angle lost per step: a method of order
p multiplies a single-axis rotation by the truncated exponential of i x for direction cosines, and of i x/2 for
Euler parameters, x being the angle turned in a step.
"""

from __future__ import annotations

import cmath
import math
from fractions import Fraction

import numpy as np
import pytest
from tolerances import certified, roundoff

import strapgen
from strapgen.ir.exceptions import InputError
from strapgen.lab.runs import simulate

#: Every combination has its own number in the source.
pytestmark = pytest.mark.every_combination

ORDERS = (1, 2, 3, 4)


def lost(order: int, x: float, algorithm: str) -> float:
    """Angle lost per step at a constant rate: what the truncated exponential's argument lacks."""
    share = 1 if algorithm == "dcm" else 2
    turned = sum((1j * x / share) ** k / math.factorial(k) for k in range(order + 1))
    return x - share * cmath.phase(turned)


def final_angle(run) -> float:
    """Angle from the computed to the true frame about y, whatever the scale."""
    return math.atan2(run.drift[-1, 1], 1 + run.scale[-1, 0])


def spin(make, algorithm: str, order: int, x: float, steps: int, axes: str = "y", **options):
    """Simulate a constant rate of x rad a step on the given axes; the step is 1/8 s."""
    motion = strapgen.motion("constant", **{f"{axis}_rad_s": x * 8 for axis in axes})
    return run_within(fit(make, algorithm, order, x), motion, "0.125", steps / 8, **options)


def fit(make, algorithm: str, order: int, x: float, **rest: object):
    """Make a back end for steps of x rad, in fixed point with residuals: the claims are about truncation.

    To a power of two, so that few have to be compiled.
    """
    largest = 2.0 ** math.ceil(math.log2(x / 2))
    return make(algorithm, f"rk{order}", largest=largest, carry="full", **rest)


def run_within(backend, motion, step, duration, **options):
    """Simulate; a run that fixed point refuses must have left the range of its state in double too."""
    try:
        return simulate(backend, motion, step, duration, **options)
    except InputError as error:
        assert "refuses its input in step" in str(error)
        algorithm, method, increments = backend.kernel.rsplit("-", 2)
        double = strapgen.backend(algorithm, method, int(increments), "numpy")
        steps = round(float(duration) / float(step))
        states = double.propagate(motion.increments(Fraction(step), steps, 2))
        assert np.abs(states).max() > float(backend.interface.inputs[0].high * backend.unit)
        return None


def tolerance(backend, steps: int) -> float:
    """Bound of the rounding in a drift; in fixed point the certified one of a state, which a drift is twice off by."""
    return roundoff(backend, steps) * (1 if backend.rounding_bound(1) is None else 2)


@pytest.mark.parametrize("order", ORDERS)
def test_1_constant_rate_errors_grow_linearly(make, algorithm, order):
    steps = 50
    x = {1: 0.042, 2: 0.15, 3: 0.35, 4: 0.5}[order]
    run = spin(make, algorithm, order, x, steps)
    noise = tolerance(fit(make, algorithm, order, x), steps)
    share = run.time / run.time[-1]
    size = np.abs(run.error).max()
    allowed = size**2 + noise
    assert size < 0.05 + noise, "the claim is about small errors"
    np.testing.assert_allclose(run.drift[:, 1], run.drift[-1, 1] * share, rtol=0, atol=allowed)
    np.testing.assert_allclose(run.scale, run.scale[-1] * share[:, None], rtol=0, atol=allowed)
    np.testing.assert_allclose(run.skew, 0, atol=noise)
    assert abs(run.drift[-1, 1]) > 5 * noise or noise > 1e-3, (
        "the drift must be seen, but for words of 16 bits"
    )


@pytest.mark.parametrize("x", [0.3, 0.6])
@pytest.mark.parametrize("order", ORDERS)
def test_2_drift_of_euler_parameters_and_direction_cosines(make, order, x):
    steps = 20
    runs = {a: spin(make, a, order, x, steps) for a in ("dcm", "euler")}
    noise = tolerance(fit(make, "dcm", order, x), steps)
    angle = {a: final_angle(run) for a, run in runs.items() if run is not None}
    assert len(angle) == 2 or order < 3, "only low orders grow out of a format"
    for algorithm, value in angle.items():
        wanted = math.remainder(steps * lost(order, x, algorithm), 2 * math.pi)
        assert value == pytest.approx(wanted, abs=2 * noise)
    # To leading order the ratio is 1/4 or 1/16; its next term is below x^2/2 of it.
    if order > 1 and len(angle) == 2:  # first order has turned too far here for a ratio of final angles
        leading = 1 / 4 if order == 2 else 1 / 16
        allowed = 4 * noise / abs(angle["dcm"])
        assert angle["euler"] / angle["dcm"] == pytest.approx(leading, rel=x**2 / 2, abs=allowed)


def test_2_first_order_at_a_small_angle(make):
    steps, x = 200, 0.05
    runs = [spin(make, a, 1, x, steps) for a in ("dcm", "euler")]
    if None in runs:
        return
    dcm, euler = map(final_angle, runs)
    noise = 4 * tolerance(fit(make, "dcm", 1, x), steps) / dcm
    assert euler / dcm == pytest.approx(1 / 4 + 9 * x**2 / 80, abs=noise + x**4)


@pytest.mark.parametrize("algorithm", ["dcm", "euler"])
@pytest.mark.parametrize(("high", "low", "ratio"), [(2, 1, -1 / 2), (4, 3, -1 / 4)])
def test_3_even_orders_drift_the_other_way(make, algorithm, high, low, ratio):
    steps, x = 100, (0.1 if low == 1 else 0.4)
    runs = [spin(make, algorithm, order, x, steps) for order in (high, low)]
    if None in runs:
        return
    upper, lower = map(final_angle, runs)
    noise = 4 * tolerance(fit(make, "dcm", low, x), steps) / abs(lower)
    assert upper / lower == pytest.approx(ratio, rel=x**2, abs=noise)


def test_4_three_equal_rates(make):
    # Orthonormalized at each step, since the scale of first order would hide the ratio; by the nearest rotation,
    # which keeps the axis of a constant rate exactly.
    steps, x = 20, 0.3
    motion = {axes: {f"{axis}_rad_s": x * 8 for axis in axes} for axes in ("y", "xyz")}
    angles = {}
    for axes, settings in motion.items():
        for order in (1, 4):
            backend = fit(make, "dcm", order, x, orthonormalization="dcm-orthonormalize-optimal")
            turning = strapgen.motion("constant", **settings)
            run = run_within(backend, turning, "0.125", steps / 8, orthonormalize="0.125")
            if run is None:
                assert order == 1, "only first order grows out of a format"
                return
            angles[axes, order] = math.asin(np.linalg.norm(run.drift[-1])) / math.sqrt(len(axes))
            wanted = steps * lost(order, x * math.sqrt(len(axes)), "dcm") / math.sqrt(len(axes))
            noise = tolerance(backend, steps) + certified(backend, 0, steps)
            # Twice the bound: the orthonormalization rounds too. The sine of angles up to 0.6 rad is inverted.
            assert angles[axes, order] == pytest.approx(abs(wanted), abs=4 * noise)
    ratio = angles["xyz", 4] / angles["xyz", 1] / (angles["y", 4] / angles["y", 1])
    assert ratio == pytest.approx(3, rel=x**2 + 8 * noise / angles["y", 4])


def test_4_at_the_thesis_rate(backend_name, make):
    if make("dcm").unit > 1e-15:
        # In single precision and in fixed point round-off hides the fourth order at this rate: the claim on it is the
        # test of the tables.
        assert tolerance(make("dcm"), 1440) > 1440 * lost(4, math.radians(10) / 8, "dcm")
        return
    x = math.radians(10) / 8
    ratios = []
    for axes in ("y", "xyz"):
        first, fourth = (
            abs(spin(make, "dcm", o, x, 40, axes, orthonormalize=5).drift[-1, 1]) for o in (1, 4)
        )
        ratios.append(fourth / first)
    # The specified figure has six digits; five seconds are too short for the second order of drift to matter.
    assert ratios[1] / ratios[0] == pytest.approx(3.00069, rel=5e-4)


def sinusoid(make, algorithm: str, order: int, turn: float, periods: int = 2):
    """Simulate a = b with b h = turn, over whole periods of steps of 1 s as nearly as they divide."""
    steps = round(2 * math.pi / turn) * periods
    b = 2 * math.pi * periods / steps
    motion = strapgen.motion("sinusoidal", a_rad_s=b, b_rad_s=b)
    return run_within(fit(make, algorithm, order, b), motion, 1, steps), steps // periods


@pytest.mark.parametrize("algorithm", ["dcm", "euler"])
@pytest.mark.parametrize(("order", "power"), [(1, 1), (2, 2), (3, 4), (4, 4)])
def test_5_sinusoid_drift_is_bounded_periodic_and_grows_as_a_power(make, algorithm, order, power):
    # Order 3 grows as b^4 as order 4 does: the thesis guesses b^3 and is wrong.
    # 0.1 in double, 0.37 in single, 0.27 and 0.55 in fixed point: truncation stays above round-off.
    turn = make("dcm").unit ** (1 / 16)
    angles = []
    for size in (turn, turn / 2):
        run, period = sinusoid(make, algorithm, order, size)
        if run is None:
            assert order < 3, "only low orders grow out of a format"
            return
        angle = np.arctan2(run.drift[:, 1], 1 + run.scale[:, 0])
        noise = tolerance(fit(make, "dcm", order, size), len(run.time))
        np.testing.assert_allclose(angle[period:], angle[: period + 1], rtol=0, atol=2 * noise)
        angles.append(np.abs(angle).max())
    if noise > angles[1] / 2 and make("dcm").unit > 1e-5:
        return  # words of 16 bits do not show it
    # Two neighbouring terms of the series in (b h)^2, and the round-off of the smaller drift.
    allowed = 0.2 + turn**2 + 2 * min(1, noise / angles[1])
    assert math.log2(angles[0] / angles[1]) == pytest.approx(power, abs=allowed)


def test_6_orthonormalization_removes_scale_and_skew_and_leaves_drift(make, algorithm):
    motion = strapgen.motion("coning", a_deg_s=40, b_deg_s=40, g_deg_s=40)
    backend = fit(make, algorithm, 2, math.radians(15))
    plain = simulate(backend, motion, "0.125", 10)
    restored = simulate(backend, motion, "0.125", 10, 10)
    size = np.abs(plain.error).max()
    noise = tolerance(backend, 80) + certified(backend, 0, 1)
    assert np.abs(restored.scale[-1]).max() <= size**2 + noise
    assert np.abs(restored.skew[-1]).max() <= size**2 + noise
    np.testing.assert_allclose(restored.drift[-1], plain.drift[-1], rtol=0, atol=size**2 + noise)
    seen = np.abs(plain.drift[-1]).max() > 10 * (size**2 + noise)
    assert seen or noise > 1e-3, "the drift that is left must be seen, but for words of 16 bits"


def test_6_with_a_large_scale_error_it_improves_drift(make):
    motion = strapgen.motion("constant", x_deg_s=10, y_deg_s=10, z_deg_s=10)
    backend = fit(make, "dcm", 1, math.radians(10) / 8)
    plain, restored = (
        run_within(backend, motion, "0.125", 180, orthonormalize=every, record=5) for every in (None, 5)
    )
    if plain is not None:
        noise = math.degrees(3 * tolerance(backend, 1440))
        assert math.degrees(plain.drift_by_axis.max()) == pytest.approx(2.391, abs=5e-4 + noise)
    noise = math.degrees(tolerance(backend, 1440) + certified(backend, 0, 36))
    assert math.degrees(restored.drift_by_axis.max()) == pytest.approx(0.856, abs=5e-4 + noise)


@pytest.mark.parametrize("order", ORDERS)
def test_7_cayley_klein_equals_euler_bit_for_bit(make, order, rng):
    increments = rng.normal(scale=0.02, size=(3, 100, 2, 3))
    euler = make("euler", f"rk{order}").propagate(increments, orthonormalize_every=40)
    klein = make("cayley-klein", f"rk{order}").propagate(increments, orthonormalize_every=40)
    np.testing.assert_array_equal(np.roll(klein, -1, axis=-1), euler)
