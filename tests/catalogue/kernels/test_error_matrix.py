"""The error matrix and its parts (thesis, chapter 4 A)."""

from random import Random

import pytest
import sympy as sp

from strapgen import derive

# A rotation in rationals, far from the identity.
TURNED = sp.Matrix([[-8, -1, 4], [4, -4, 7], [1, 8, 4]]) / 9


def parts(computed: sp.Matrix, truth: sp.Matrix) -> dict[str, sp.Matrix]:
    kernel = derive("error-matrix")
    elements = [name for signal in kernel.inputs for name in signal.elements]
    result = kernel.expand(dict(zip(elements, [*computed, *truth], strict=True)))
    return {name: sp.Matrix(3, len(values) // 3, values) for name, values in result.items()}


def test_the_split_is_the_printed_one():
    random = Random(11)
    computed, truth = (sp.Matrix(3, 3, lambda i, j: sp.Rational(random.randint(-99, 99), 7)) for _ in "12")
    result = parts(computed, truth)
    E = computed * truth.T - sp.eye(3)
    assert result["error"] == E
    assert result["scale"] == sp.Matrix([E[0, 0], E[1, 1], E[2, 2]])
    # skew_k = (E_ij + E_ji)/2 with (k, i, j) = (1, 2, 3), (2, 1, 3), (3, 1, 2)
    assert result["skew"] == sp.Matrix([E[1, 2] + E[2, 1], E[0, 2] + E[2, 0], E[0, 1] + E[1, 0]]) / 2
    assert result["drift"] == sp.Matrix([E[1, 2] - E[2, 1], E[2, 0] - E[0, 2], E[0, 1] - E[1, 0]]) / 2


def test_a_small_rotation_is_drift_alone():
    # C_computed = exp(skew(eps)) C, eps in reference axes: drift = -eps, scale and skew of second order.
    t = sp.Symbol("t")
    x, y, z = sp.symbols("x y z", real=True)
    K = sp.Matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    series = sp.eye(3) + t * K + t**2 * K**2 / 2
    first = {name: part.diff(t).subs(t, 0).expand() for name, part in parts(series * TURNED, TURNED).items()}
    assert first["drift"] == -sp.Matrix([x, y, z])
    assert first["scale"] == first["skew"] == sp.zeros(3, 1)


def test_a_frame_that_lags_has_positive_drift():
    # A turn about z of which a part is lost: the computed angle is the smaller one.
    def about_z(angle):
        return sp.Matrix([[sp.cos(angle), -sp.sin(angle), 0], [sp.sin(angle), sp.cos(angle), 0], [0, 0, 1]])

    lost = sp.Rational(1, 1000)
    drift = parts(about_z(1 - lost), about_z(1))["drift"]
    assert drift[:2, :].applyfunc(sp.simplify) == sp.zeros(2, 1)
    assert float(drift[2]) == pytest.approx(float(sp.sin(lost)), rel=1e-14)
