"""The acceleration transformation: rotation compensation derived, both forms and both attitudes alike."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from scipy.spatial.transform import Rotation

import strapgen
from strapgen import derive
from strapgen.kernel.algebra import cross


def test_rotation_compensation_comes_out_of_the_product_rule():
    # (48) to (49): with beta' = w and u' = a, beta x a is half the derivative of beta x u and half of beta x a + u x w.
    t = sp.Symbol("t")
    beta, u = (sp.Matrix([sp.Function(f"{name}{axis}")(t) for axis in "xyz"]) for name in "bu")
    w, a = beta.diff(t), u.diff(t)
    split = cross(beta, u).diff(t) / 2 + (cross(beta, a) + cross(u, w)) / 2
    assert (cross(beta, a) - split).expand() == sp.zeros(3, 1)


def test_to_first_order_the_body_has_turned_by_its_increments():
    # (46) and (47): C(m) A(t) with A = I + (beta x), the first order of the update.
    made = derive("dcm-update-1").expand(
        {**dict(zip(derive("dcm-update-1").inputs[0].elements, sp.eye(3), strict=True)), **symbols("phi")}
    )
    x, y, z = symbols("phi").values()
    assert made["next"] == [1, -z, y, z, 1, -x, -y, x, 1]


def symbols(prefix):
    return {f"{prefix}_{axis}": sp.Symbol(f"{prefix}_{axis}", real=True) for axis in "xyz"}


@pytest.mark.parametrize("form", [1, 2])
def test_the_velocity_is_that_of_the_equation(form, rng):
    C = Rotation.random(rng=rng).as_matrix()
    u, s, beta = rng.normal(size=(3, 3))
    given = (C, u, s, beta)[: 2 + form]
    wanted = C @ (u + s + (np.cross(beta, u) / 2 if form == 2 else 0))
    np.testing.assert_allclose(strapgen.evaluator(f"dcm-velocity-{form}")(*given), wanted, atol=2e-15)


@pytest.mark.parametrize("what", ["acceleration", "velocity-1", "velocity-2"])
def test_euler_parameters_give_what_the_matrix_gives(what):
    # As polynomials, on the unit sphere: the matrix of a quaternion is that of dcm-from-euler.
    by_matrix, by_parameters = derive(f"dcm-{what}"), derive(f"euler-{what}")
    names = [name for signal in by_parameters.inputs for name in signal.elements]
    generators = sp.ring(names, sp.QQ)[1:]
    values = dict(zip(names, generators, strict=True))
    state = by_parameters.inputs[0].elements
    (matrix,) = derive("dcm-from-euler").expand({n: values[n] for n in state}).values()
    held = {n: v for n, v in values.items() if n not in state}
    wanted = by_matrix.expand(dict(zip(by_matrix.inputs[0].elements, matrix, strict=True)) | held)
    assert by_parameters.expand(values) == wanted


def test_the_frame_correction_is_half_a_cross_product():
    (made,) = derive("navigation-velocity").expand().values()
    theta, v = (sp.Matrix(list(symbols(p).values())) for p in ("theta", "v"))
    assert (sp.Matrix(made) + cross(theta, v) / 2).expand() == sp.zeros(3, 1)
