"""The error model (4.9) as compensation and as errors: the numbers of the example, orders, and a unit in NumPy."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import sympy as sp

import strapgen
from strapgen import derive
from strapgen.ir.exceptions import InputError
from strapgen.navigation.instruments.imu_errors import (
    PARAMETERS,
    imu_compensate,
    imu_errors,
    source_structure,
)
from strapgen.navigation.instruments.separation import UNBALANCE

ROWS = (1, 2, 3, 4, 5, 6, 7, 8, 9)
#: The example: for every coefficient signal its power of ten, and its integers.
EXAMPLE = {
    "rate_bias": (-4, (1, -2, 3)),
    "rate_scale": (-4, ROWS),
    "anisoinertia": (-4, (1, 2, 3)),
    "g_sensitivity": (-6, (1, 2, 3, 4, 5, 6, 7)),
    "anisoelasticity": (-7, (1, 2, 3, 4, 5)),
    "acceleration_bias": (-3, (1, -2, 3)),
    "rate_sensitivity": (-3, ROWS),
    "rate_products": (-3, (1, 2, 3)),
    "acceleration_scale": (-4, (7, 8, 9, 4, 5, 6, 1, 2, 3)),
    "acceleration_products": (-6, (1, 2, 3, 4, 5, 6)),
}
MOTION = {
    "increment": [Fraction(n, 100) for n in (2, -1, 3)],
    "velocity_increment": [Fraction(n, 10) for n in (4, -3, 2)],
    "cycle": [Fraction(1, 50)],
    "cycle_rate": [Fraction(50)],
}
RESULTS = {
    "imu-compensate": (("0.0199889", "-0.0100139", "0.0299420"), ("0.399673", "-0.300214", "0.199794")),
    "imu-compensate-2": (
        ("0.01998893298679", "-0.01001384505291", "0.02994209945506"),
        ("0.39967390163794", "-0.30021314545855", "0.19979454516795"),
    ),
}


def example(scale=1):
    """Return the inputs of the example by name as exact numbers; the coefficients are multiplied by the scale."""
    coefficients = {
        name: [Fraction(n) * Fraction(10) ** power * scale for n in numbers]
        for name, (power, numbers) in EXAMPLE.items()
    }
    return MOTION | coefficients


def exactly(kernel, values):
    """Return the outputs of a kernel in exact arithmetic, for the values of its inputs by name."""
    known = {
        element: sp.Rational(number.numerator, number.denominator)
        for signal in kernel.inputs
        for element, number in zip(signal.elements, values[signal.name], strict=True)
    }
    return list(kernel.expand(known).values())


def arrays(kernel, values):
    """Return the values of the inputs as arrays in the order of the kernel."""
    return [np.array(values[s.name], float).reshape(s.shape) for s in kernel.inputs]


def test_one_pass_gives_the_exact_decimals_of_the_example():
    outputs = exactly(derive("imu-compensate"), example())
    assert outputs == [[sp.Rational(text) for text in row] for row in RESULTS["imu-compensate"]]


def test_two_passes_give_the_numbers_of_the_example():
    for output, row in zip(
        exactly(derive("imu-compensate-2"), example()), RESULTS["imu-compensate-2"], strict=True
    ):
        for value, text in zip(output, row, strict=True):
            assert abs(value - sp.Rational(text)) <= sp.Rational(1, 2) * sp.Rational(10) ** -14


@pytest.mark.long
@pytest.mark.parametrize("name", RESULTS)
def test_every_back_end_gives_the_numbers_of_the_example(name, backend_name):
    evaluator = strapgen.evaluator(name, backend_name)
    kernel = derive(name)
    results = evaluator(*arrays(kernel, example()))
    tolerances = [1e-14, 1e-13] if evaluator.dtype == np.float64 else [1e-7, 1e-6]
    if hasattr(evaluator, "interface"):
        # Half a unit of an input, times what 1 of it may change: 1 of an increment about 1, of a coefficient an
        # increment, and of the cycle rate the sum of the products of the example.
        rounding = [float(a.unit) / 2 for a in evaluator.interface.inputs]
        changes = {"increment": 1.1, "velocity_increment": 1.1, "cycle": 0.01, "cycle_rate": 1e-5}
        spread = sum(
            changes.get(
                signal.name, 20.0 if signal.name.endswith(("products", "elasticity", "inertia")) else 1.0
            )
            * half
            for signal, half in zip(kernel.inputs, rounding, strict=True)
        )
        tolerances = [float(max(a.errors)) + 3 * spread for a in evaluator.interface.outputs]
    for result, row, tolerance in zip(results, RESULTS[name], tolerances, strict=True):
        np.testing.assert_allclose(result, np.array(row, float), rtol=0, atol=tolerance)


def residuals(scale, passes):
    """Return by how much the compensation misses what the errors started from, the largest of each output."""
    errors, compensate = imu_errors(), imu_compensate(passes)
    values = example(scale)
    measured = exactly(errors, values)
    values = values | dict(zip(("increment", "velocity_increment"), measured, strict=True))
    outputs = exactly(compensate, {k: [sp.Rational(str(n)) for n in v] for k, v in values.items()})
    return [
        max(abs(a - sp.Rational(str(b))) for a, b in zip(output, MOTION[name], strict=True))
        for output, name in zip(outputs, ("increment", "velocity_increment"), strict=True)
    ]


@pytest.mark.long
@pytest.mark.parametrize(("passes", "order"), [(1, 2), (2, 3)])
def test_compensation_error_is_of_second_order_then_third(passes, order):
    full, half = residuals(Fraction(1), passes), residuals(Fraction(1, 2), passes)
    for one, other in zip(full, half, strict=True):
        assert 2**order * 0.99 < one / other < 2**order * 1.02


# A unit of three gyros, written here from the equations and not from the kernel

AXES = np.sqrt(0.5) * np.array(
    [[[0, -1, -1], [0, -1, 1]], [[1, -1, 0], [-1, -1, 0]], [[-1, 0, 1], [1, 0, 1]]], float
)
B = np.radians(5) / 9.81
UNBALANCES = (0.0, B, -B)


def torques(W, A, errors):
    """Return the six torques in rad/s of a rate and an acceleration in body axes, (4.1) and (4.2)."""
    measured = []
    for (x, y), unbalance, e in zip(AXES, UNBALANCES, errors, strict=True):
        axes = np.stack([x, y, np.cross(x, y)])
        w, a = axes @ W, axes @ A
        m = w + (unbalance + e["dB"]) * a
        gx = e["Gbx"] + e["Vx"] * a[2] + e["dP"] * a[0] - (e["D"] * a[1] - e["E"] * a[0]) * a[2]
        gy = e["Gby"] + e["Vy"] * a[2] + e["dP"] * a[1] + (e["D"] * a[0] + e["E"] * a[1]) * a[2]
        measured += [
            (1 + e["Sx"]) * m[0] + e["J"] * w[0] * w[2] - e["ay"] * m[2] + e["xx"] * m[1] + gy,
            (1 + e["Sy"]) * m[1] + e["J"] * w[1] * w[2] + e["ax"] * m[2] - e["xy"] * m[0] - gx,
        ]
    return np.array(measured)


SIZES = {
    **dict.fromkeys(("Sx", "Sy", "ax", "ay", "xx", "xy"), 1e-4),
    **dict.fromkeys(("Gbx", "Gby"), 2e-5),
    **dict.fromkeys(("Vx", "Vy", "dP", "dB"), 1e-6),
    **dict.fromkeys(("D", "E"), 1e-8),
    "J": 1e-4,
}


def coefficients_of(errors):
    """Return the coefficients of (4.9) for the errors of three gyros, by the names of the kernel's elements."""
    forms = source_structure().forms
    symbols = [sp.Symbol(f"{name}{k}", real=True) for k in (1, 2, 3) for name in PARAMETERS]
    numbers = [e[name] for e in errors for name in PARAMETERS]
    values = sp.lambdify([UNBALANCE, *symbols], list(forms.values()))(B, *numbers)
    return dict(zip((symbol.name for symbol in forms), values, strict=True))


def missed(scale, passes, seed, ramp=0.0):
    """Return by how much compensated increments miss true ones, for gyros whose errors are scaled.

    Rate and acceleration change by the part `ramp` of their range over the cycle.
    """
    rng = np.random.default_rng(seed)
    T, parts = 0.02, 64
    errors = [{name: scale * SIZES[name] * rng.uniform(-1, 1) for name in PARAMETERS} for _ in range(3)]
    W0, A0 = rng.uniform(-2, 2, size=3), rng.uniform(-30, 30, size=3)
    W1, A1 = ramp * rng.uniform(-2, 2, size=3), ramp * rng.uniform(-30, 30, size=3)
    times = (np.arange(parts) + 0.5) / parts - 0.5  # midpoints: exact for the integral of a ramp
    summed = sum(torques(W0 + W1 * t, A0 + A1 * t, errors) for t in times) * T / parts
    rows = [[*axis, *(u * axis)] for pair, u in zip(AXES, UNBALANCES, strict=True) for axis in pair]
    measured = np.linalg.solve(np.array(rows), summed)
    coefficients = coefficients_of(errors)
    inputs = {"increment": measured[:3], "velocity_increment": measured[3:], "cycle": T, "cycle_rate": 1 / T}
    arguments = [
        inputs[s.name] if s.name in inputs else np.array([coefficients[e] for e in s.elements])
        for s in derive("imu-compensate").inputs
    ]
    d, dv = strapgen.evaluator("imu-compensate" + ("" if passes == 1 else "-2"))(*arguments)
    return np.array([d - W0 * T, dv - A0 * T])


SEEDS = range(3)


@pytest.mark.long
def test_a_unit_without_errors_needs_no_compensation():
    for seed in SEEDS:
        assert np.abs(missed(0, 1, seed)).max() < 1e-13


@pytest.mark.long
def test_the_errors_of_a_unit_integrated_in_numpy_are_compensated_to_second_order():
    for seed in SEEDS:
        full, half = missed(1, 1, seed), missed(0.5, 1, seed)
        np.testing.assert_allclose(*(np.linalg.norm(x, axis=1) for x in (full, 4 * half)), rtol=0.01)
        again = missed(1, 2, seed)
        assert np.all(np.linalg.norm(again, axis=1) < 0.5 * np.linalg.norm(full, axis=1))


@pytest.mark.long
def test_ramp_within_a_cycle_leaves_the_error_of_mean_products():
    # The mean of a product of two ramps exceeds the product of means by a twelfth of the product of their changes:
    # for changes of the rate of 2 rad/s and of the acceleration of 30 m/s^2 at most, times J and D, E, thrice each.
    T, sizes = 0.02, SIZES
    products = 3 * T / 12 * (sizes["J"] * 2**2 + (sizes["D"] + sizes["E"]) * 30**2)
    for seed in SEEDS:
        more = missed(1, 1, seed, ramp=1.0) - missed(1, 1, seed)
        assert 0 < np.abs(more[0]).max() < products
        assert 0 < np.abs(more[1]).max() < 2 * products / B


# Constants in place of inputs


@pytest.mark.long
def test_constants_take_the_place_of_inputs():
    names = {s.name: value for s in source_structure().forms for value in [Fraction(1, 10**5)]}
    kernel = imu_compensate(constants={**names, "cycle": Fraction(1, 50)})
    assert [signal.name for signal in kernel.inputs] == ["increment", "velocity_increment"]
    zeros = imu_compensate(constants=dict.fromkeys(names, Fraction(0)))
    d = [sp.Symbol(f"d_{axis}", real=True) for axis in "xyz"]
    assert zeros.expand()["compensated_increment"] == d
    # And with one constant the others of its signal stay inputs.
    some = imu_errors(constants={"K_xx": Fraction(1, 1000)})
    assert dict((s.name, s.size) for s in some.inputs)["rate_scale"] == 8


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"passes": 3}, "passes is 3; 1 or 2 is needed"),
        ({"constants": {"J_xx": Fraction(1)}}, "no coefficient J_xx"),
        ({"constants": {"cycle": Fraction(0)}}, "cycle is 0 s"),
    ],
)
def test_other_kernels_than_error_models_are_refused(arguments, said):
    with pytest.raises(InputError, match=said):
        imu_compensate(**arguments)


def test_the_bounds_are_ten_times_the_example():
    for signal in derive("imu-compensate").inputs:
        if signal.name in EXAMPLE:
            power, numbers = EXAMPLE[signal.name]
            assert signal.bound == 10 * max(map(abs, numbers)) * Fraction(10) ** power
