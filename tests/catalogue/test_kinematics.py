"""Kinematics: the derived differential equations are the printed ones (thesis, chapter 2)."""

import pytest
import sympy as sp

from strapgen import derive
from strapgen.catalogue import ALGORITHMS
from strapgen.catalogue.kinematics import CAYLEY_KLEIN, DCM, EULER, KINEMATICS
from strapgen.kernel.kernel import symbols

WX, WY, WZ = W = sp.symbols("wx wy wz", real=True)
RATE = sp.Matrix(W)
E = sp.Matrix(sp.symbols("e1:5", real=True))
A = sp.Matrix(sp.symbols("a1:5", real=True))
C = sp.Matrix(3, 3, sp.symbols("c11:14 c21:24 c31:34", real=True))
SKEW = sp.Matrix([[0, -WZ, WY], [WZ, 0, -WX], [-WY, WX, 0]])


def zero(matrix: sp.Matrix) -> bool:
    return matrix.expand() == sp.zeros(*matrix.shape)


def derivative(kinematics, x):
    return kinematics.derivative(x, kinematics.scale * RATE)


def attitude(name: str, state: sp.Matrix) -> sp.Matrix:
    """Return the direction cosine matrix of a state, by its kernel."""
    kernel = derive(name)
    values = dict(zip(kernel.inputs[0].elements, state, strict=True))
    return sp.Matrix(3, 3, kernel.expand(values)["attitude"])


def test_every_algorithm_has_its_kinematics():
    assert list(KINEMATICS) == list(ALGORITHMS)


def test_the_direction_cosine_matrix_obeys_equation_2_1():
    assert zero(derivative(DCM, C) - C * SKEW)


def test_euler_parameters_obey_the_printed_equation():
    printed = sp.Matrix([[0, WZ, -WY, WX], [-WZ, 0, WX, WY], [WY, -WX, 0, WZ], [-WX, -WY, -WZ, 0]])
    assert zero(derivative(EULER, E) - printed * E / 2)


def test_cayley_klein_parameters_obey_the_printed_equation():
    printed = sp.Matrix([[0, -WX, -WY, -WZ], [WX, 0, WZ, -WY], [WY, -WZ, 0, WX], [WZ, WY, -WX, 0]])
    assert zero(derivative(CAYLEY_KLEIN, A) - printed * A / 2)


def test_cayley_klein_parameters_obey_the_complex_equations():
    # alpha = a1 + i a4, beta = -a3 + i a2
    def complex_form(a):
        return a[0] + sp.I * a[3], -a[2] + sp.I * a[1]

    alpha, beta = complex_form(A)
    alpha_rate, beta_rate = complex_form(derivative(CAYLEY_KLEIN, A))
    half_i = sp.I / 2
    assert sp.expand(alpha_rate - half_i * (WZ * alpha + (WX - sp.I * WY) * beta)) == 0
    assert sp.expand(beta_rate - half_i * ((WX + sp.I * WY) * alpha - WZ * beta)) == 0


def test_dcm_from_euler_parameters_is_the_printed_matrix():
    e1, e2, e3, e4 = E
    printed = sp.Matrix(
        [
            [e1**2 - e2**2 - e3**2 + e4**2, 2 * (e1 * e2 - e3 * e4), 2 * (e1 * e3 + e2 * e4)],
            [2 * (e1 * e2 + e3 * e4), -(e1**2) + e2**2 - e3**2 + e4**2, 2 * (e2 * e3 - e1 * e4)],
            [2 * (e1 * e3 - e2 * e4), 2 * (e2 * e3 + e1 * e4), -(e1**2) - e2**2 + e3**2 + e4**2],
        ]
    )
    assert zero(attitude("dcm-from-euler", E) - printed)


def test_dcm_from_cayley_klein_parameters_is_the_printed_matrix():
    a1, a2, a3, a4 = A
    printed = sp.Matrix(
        [
            [a1**2 + a2**2 - a3**2 - a4**2, 2 * (-a1 * a4 + a2 * a3), 2 * (a1 * a3 + a2 * a4)],
            [2 * (a1 * a4 + a2 * a3), a1**2 - a2**2 + a3**2 - a4**2, 2 * (a3 * a4 - a1 * a2)],
            [2 * (-a1 * a3 + a2 * a4), 2 * (a3 * a4 + a1 * a2), a1**2 - a2**2 - a3**2 + a4**2],
        ]
    )
    assert zero(attitude("dcm-from-cayley-klein", A) - printed)


@pytest.mark.parametrize(
    ("kinematics", "state"), [(EULER, E), (CAYLEY_KLEIN, A)], ids=["euler", "cayley-klein"]
)
def test_the_matrix_of_a_turning_state_turns_by_equation_2_1(kinematics, state):
    # d/dt C(x) by the chain rule along dx/dt; every state of one rotation gives C skew(w).
    matrix, turning = attitude(kinematics.attitude, state), derivative(kinematics, state)
    rate = sum((matrix.diff(x) * x_rate for x, x_rate in zip(state, turning, strict=True)), sp.zeros(3, 3))
    assert zero(rate - matrix * SKEW)


@pytest.mark.parametrize("kinematics", [EULER, CAYLEY_KLEIN], ids=["euler", "cayley-klein"])
def test_the_length_of_a_turning_state_stays(kinematics):
    x = symbols(kinematics.state)
    assert sp.expand(x.dot(derivative(kinematics, x))) == 0


@pytest.mark.parametrize("name", KINEMATICS)
def test_the_identity_is_the_identity(name):
    kinematics = KINEMATICS[name]
    x = symbols(kinematics.state)
    assert zero(kinematics.product(x, kinematics.identity) - x)
    assert zero(kinematics.product(kinematics.identity, x) - x)
    if kinematics.attitude:
        assert attitude(kinematics.attitude, kinematics.identity) == sp.eye(3)
    else:
        assert kinematics.identity == sp.eye(3)


@pytest.mark.parametrize("kinematics", [EULER, CAYLEY_KLEIN], ids=["euler", "cayley-klein"])
def test_products_of_states_are_products_of_matrices(kinematics):
    x, p = symbols(kinematics.state), symbols(kinematics.transition)
    name = kinematics.attitude
    product = attitude(name, kinematics.product(x, p))
    assert zero(product - attitude(name, x) * attitude(name, p))
