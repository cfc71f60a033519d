"""Rate and acceleration separated: the printed inverses, determinants, noise gains, and a numeric solution beside."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp

import strapgen
from strapgen import derive, generate, lower
from strapgen.ir.exceptions import InputError
from strapgen.navigation.instruments.separation import (
    UNBALANCE,
    TwoAxisGyro,
    X,
    Y,
    Z,
    canonical_layout,
    diagonal_layout,
    measurement_matrix,
    noise_gains,
    separating_kernel,
    separation_matrix,
)
from strapgen.run.backend_names import of_sources

B = UNBALANCE
LAYOUTS = {"canonical": (canonical_layout(), -1), "45": (diagonal_layout(), 1)}
MX1, MY1, MX2, MY2, MX3, MY3 = TORQUES = sp.symbols("M_x1 M_y1 M_x2 M_y2 M_x3 M_y3", real=True)
ROOT = sp.sqrt(2)
#: The inverses as printed (canonical) and repaired (45): rates, then accelerations.
INVERSES = {
    "canonical": (
        [(MX2 - MY3) / 2, -MY1, MX1],
        [-(MX2 + MY3) / (2 * B), (MX3 + MY1) / B, (MY2 + MX1) / B],
    ),
    "45": (
        [
            ROOT / 4 * ((MX2 - MY2) - (MX3 - MY3)),
            -ROOT / 2 * (MX1 + MY1),
            ROOT / 2 * (MY1 - MX1),
        ],
        [
            ROOT / (4 * B) * ((MX2 - MY2) + (MX3 - MY3)),
            ROOT / (2 * B) * ((MX1 + MY1) - (MX2 + MY2)),
            ROOT / (2 * B) * ((MY1 - MX1) - (MX3 + MY3)),
        ],
    ),
}


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_inverse_is_the_one_of_the_source(name):
    rates, accelerations = INVERSES[name]
    kernel = derive(f"separate-{name}")
    reciprocal = sp.Symbol("unbalance_reciprocal", real=True)
    expanded = kernel.expand()
    for outputs, expected in (
        (expanded["increment"], rates),
        (expanded["velocity_increment"], accelerations),
    ):
        for one, other in zip(outputs, expected, strict=True):
            assert sp.expand(one - other.subs(B, 1 / reciprocal)) == 0


def test_the_torques_of_the_canonical_layout_are_the_printed_ones():
    wx, wy, wz, gx, gy, gz = motion = sp.symbols("w_x w_y w_z g_x g_y g_z")
    torques = measurement_matrix(canonical_layout(), -1) * sp.Matrix(motion)
    assert list(torques) == [wz, -wy, wx - B * gx, -wz + B * gz, wy + B * gy, -wx - B * gx]


@pytest.mark.long
@pytest.mark.parametrize("name", LAYOUTS)
def test_the_torques_of_a_motion_are_separated_again(name):
    first, second = derive(f"torques-{name}"), derive(f"separate-{name}")
    d = list(sp.symbols("d_x d_y d_z dv_x dv_y dv_z", real=True))
    torques = first.expand()["torque_increment"]
    values = dict(zip((str(symbol) for symbol in TORQUES), torques, strict=True))
    values["unbalance_reciprocal"] = 1 / sp.Symbol("unbalance", real=True)
    motion = [element for output in second.expand(values).values() for element in output]
    assert [sp.simplify(element) for element in motion] == d


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_determinant_is_twice_the_cube_of_the_unbalance(name):
    assert sp.simplify(sp.Abs(measurement_matrix(*LAYOUTS[name]).det())) == 2 * B**3


def test_the_spins_at_45_degrees_are_those_of_the_source():
    assert [gyro.spin for gyro in diagonal_layout()] == [-X, -Z, Y]


def test_the_determinant_for_free_unbalances():
    second, third = sp.symbols("B2 B3")
    matrix = measurement_matrix(canonical_layout(second, third), -1)
    assert sp.expand(matrix.det() + second * third * (second - third)) == 0


@pytest.mark.parametrize("unbalances", [(B, B), (0, B), (B, 0), (sp.Rational(1, 3), sp.Rational(1, 3))])
def test_a_singular_layout_is_refused_with_a_motion_that_nothing_measures(unbalances):
    gyros = canonical_layout(*unbalances)
    with pytest.raises(InputError, match="singular: no torquer measures the rate") as refusal:
        separation_matrix(gyros, -1)
    rate, acceleration = (
        sp.sympify(part, locals={"B": B})
        for part in str(refusal.value)
        .split("the rate ")[1]
        .split(";")[0]
        .split(" together with the acceleration ")
    )
    motion = sp.Matrix([*rate, *acceleration])
    assert any(motion) and sp.simplify(measurement_matrix(gyros, -1) * motion) == sp.zeros(6, 1)


@pytest.mark.parametrize(
    ("axes", "said"),
    [
        ((2 * X, Y), "length 1"),
        ((X, X), "not perpendicular"),
        ((X, (X + Y) / sp.sqrt(2)), "not perpendicular"),
    ],
)
def test_axes_that_no_gyro_has_are_refused(axes, said):
    with pytest.raises(InputError, match=said):
        TwoAxisGyro(*axes, B)


def test_a_layout_has_three_gyros_and_a_sign():
    with pytest.raises(InputError, match="2 gyros; three are needed"):
        measurement_matrix(canonical_layout()[:2], 1)
    with pytest.raises(InputError, match="sign is 0"):
        measurement_matrix(canonical_layout(), 0)


@pytest.mark.parametrize("name", LAYOUTS)
def test_the_noise_gains(name):
    assert noise_gains(*LAYOUTS[name]) == (ROOT / 2, 1, 1, ROOT / 2 / B, ROOT / B, ROOT / B)


@pytest.mark.long
def test_the_gain_of_gx_falls_with_the_difference_of_the_unbalances():
    # The rule of the source: maximise |B2 - B3|.
    second, third = sp.symbols("B2 B3", positive=True)
    gain = noise_gains(canonical_layout(second, third), -1)[3]
    assert sp.simplify(gain**2 - 2 / (second - third) ** 2) == 0


@pytest.mark.parametrize(
    "angles",
    [pytest.param((sp.pi / 6, -sp.pi / 3, sp.pi / 4), marks=pytest.mark.long), (sp.pi / 2, 0, sp.pi / 3)],
)
def test_turning_the_torquers_about_the_spin_changes_neither_determinant_nor_gains(angles):
    gyros = [gyro.turned(angle) for gyro, angle in zip(canonical_layout(), angles, strict=True)]
    assert sp.simplify(sp.Abs(measurement_matrix(gyros, 1).det())) == 2 * B**3
    assert noise_gains(gyros, 1) == noise_gains(canonical_layout(), 1)


@pytest.mark.long
def test_the_determinant_stays_for_any_angle():
    angles = sp.symbols("alpha beta gamma", real=True)
    gyros = [gyro.turned(angle) for gyro, angle in zip(canonical_layout(), angles, strict=True)]
    matrix = measurement_matrix(gyros, 1)
    # Pairs of rows turn: the Gram matrix of the columns does not.
    gram = (matrix.T * matrix).applyfunc(sp.simplify)
    straight = measurement_matrix(canonical_layout(), 1)
    assert gram == straight.T * straight


def test_the_numbers_of_the_layout_at_45_degrees(backend_name):
    half = np.sqrt(2) / 2
    torques = half * np.array([-5, 1, 3.5, -2.5, 1, -1]) / 50
    separated = strapgen.evaluator("separate-45", backend_name)
    d, dv = separated(torques, 1 / 5)
    tolerance = 1e-7 if "float" in backend_name else 1e-15
    errors = [tolerance, tolerance]
    if hasattr(separated, "interface"):
        outputs = separated.interface.outputs
        units = [float(a.unit) for a in separated.interface.inputs]
        # Rounding of the torques to their format, and of 1/B, comes to the bounds of the results.
        spread = [2 * units[0], 2 * units[0] / 5 + 4 * units[1]]
        errors = [float(max(a.errors)) + more for a, more in zip(outputs, spread, strict=True)]
    np.testing.assert_allclose(d, np.array([1, 2, 3]) / 50, rtol=0, atol=errors[0])
    np.testing.assert_allclose(dv, np.array([0.4, -0.5, 0.6]) / 50, rtol=0, atol=errors[1])


def test_the_numbers_the_other_way():
    made = strapgen.evaluator("torques-45")([1.0, 2.0, 3.0], [0.4, -0.5, 0.6], 5.0)
    np.testing.assert_allclose(made, np.sqrt(2) / 2 * np.array([-5, 1, 3.5, -2.5, 1, -1]), rtol=1e-15)


@pytest.mark.long
def test_a_layout_of_numbers_against_a_numeric_solution(rng):
    # Any description: each gyro turned, one of them with axes of its own, unbalances as exact numbers.
    gyros = (
        TwoAxisGyro(Z, -Y, sp.Rational(1, 100)).turned(sp.pi / 6),
        TwoAxisGyro(X, -Z, sp.Rational(1, 120)),
        TwoAxisGyro((3 * Y + 4 * X) / 5, (3 * X - 4 * Y) / 5, -sp.Rational(1, 90)),
    )
    kernel = separating_kernel("separate-layout", "A layout", "test", gyros, 1)
    assert [signal.name for signal in kernel.inputs] == ["torque_increment"]
    separated = of_sources(generate(lower(kernel), "numpy"))
    rows = np.array(
        [
            [*np.array(axis, float).ravel(), *(float(gyro.unbalance) * np.array(axis, float).ravel())]
            for gyro in gyros
            for axis in (gyro.x, gyro.y)
        ]
    )
    for torques in rng.normal(size=(20, 6)):
        expected = np.linalg.solve(rows, torques)
        np.testing.assert_allclose(np.concatenate(separated(torques)), expected, rtol=1e-12, atol=1e-11)


def test_drift_over_unbalance_and_the_roll_of_the_source():
    # 5 deg/h over 5 deg/s/g: printed 3e-4 g; a roll of 360 degrees with dk = 5e-4 and B = 5 deg/s/g: printed 0.4 m/s.
    assert abs(5 / 3600 / 5 - 3e-4) < 0.5e-4 and abs(5 / 3600 / 5 - 2.778e-4) < 5e-8
    layout = strapgen.evaluator("separate-45")
    true = np.array([0.0, np.radians(360), 0.0])  # a roll about y, whose scale factors dk of gyro 2 err
    unbalance = np.radians(5) / 9.81
    torques = strapgen.evaluator("torques-45")(true, np.zeros(3), unbalance)
    torques = torques * [1, 1, 1 + 5e-4, 1 + 5e-4, 1, 1]
    _, dv = layout(torques, 1 / unbalance)
    assert abs(abs(dv[1]) - 0.3532) < 5e-5
    assert abs(abs(dv[1]) - 0.4) < 0.05
