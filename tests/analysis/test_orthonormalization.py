"""Appendix B of the thesis as a theorem."""

from __future__ import annotations

import mpmath
import pytest
import sympy as sp

from strapgen.analysis.series.series import ERROR, effect
from strapgen.catalogue import orthonormalizations
from strapgen.ir.exceptions import InputError
from strapgen.run import exact
from strapgen.run.exact import interpreter

P = ERROR
K, Y = (P - P.T) / 2, (P + P.T) / 2
SERIES = ["dcm-orthonormalize", "dcm-orthonormalize-first-order", "dcm-orthonormalize-second-order"]


def is_zero(matrix: sp.Matrix) -> bool:
    return bool(matrix.expand().is_zero_matrix)


def nearest_to_second_order() -> sp.Matrix:
    """Return the s^2 of (I + sP) ((I + sP)'(I + sP))^(-1/2), equation (B.1).

    The binomial series of the root is I - E/2 + 3/8 E^2 - ..., of E = s (P + P') + s^2 P'P.
    """
    first, second = P + P.T, P.T * P
    return -second / 2 + sp.Rational(3, 8) * first * first - P * first / 2


@pytest.mark.parametrize("scheme", SERIES)
def test_to_first_order_the_skew_part_is_left(scheme):
    """(B.4): scale and skew vanish, and drift is unchanged."""
    assert is_zero(effect(scheme, 1)[1] - K)


def test_to_second_order():
    """(B.14), which is the series of the nearest rotation."""
    second = effect("dcm-orthonormalize-second-order")[2]
    assert is_zero(second - (-P * P - P * P.T - P.T * P + 3 * P.T * P.T) / 8)
    assert is_zero(second - nearest_to_second_order())


@pytest.mark.long
@pytest.mark.parametrize("scheme", SERIES)
def test_what_each_scheme_leaves_to_second_order(scheme):
    """Drift changes by half of KY + YK, whatever the scheme; they differ in what is left of scale and skew.

    Of the symmetric error the second order leaves nothing beside the K^2/2 of a rotation; the first one the root of
    1 - 3/4 (2Y)^2; and the scheme of the thesis, whose rows have length 1, a skew.
    """
    second = effect(scheme)[2]
    cofactors = Y.adjugate()
    remainder = {
        "dcm-orthonormalize": (cofactors - sp.diag(*cofactors.diagonal())) / 2,
        "dcm-orthonormalize-first-order": -sp.Rational(3, 2) * Y * Y,
        "dcm-orthonormalize-second-order": sp.zeros(3, 3),
    }
    assert is_zero((second - second.T) / 2 + (K * Y + Y * K) / 2)
    assert is_zero((second + second.T) / 2 - K * K / 2 - remainder[scheme])


def test_scale_alone_lets_the_drift_of_a_large_error_fall():
    """Claim 6: with the scale y and the drift k about one axis, drift falls by y k."""
    y, k = sp.symbols("y k")
    error = sp.Matrix([[y, k, 0], [-k, y, 0], [0, 0, 0]])
    values = dict(zip(P, error, strict=True))
    second = effect("dcm-orthonormalize-second-order")[2].subs(values)
    assert sp.expand((second - second.T)[0, 1] / 2 + y * k) == 0


@pytest.mark.long
@pytest.mark.parametrize("scheme", orthonormalizations("dcm"))
def test_any_true_matrix(scheme):
    """The kernels, that of the nearest rotation too, on (I + sP) C: what they leave is as predicted, to order s^3."""
    name = scheme if scheme in SERIES else "dcm-orthonormalize-second-order"
    values = {symbol: sp.Rational((5 * n) % 7 - 3, 4) for n, symbol in enumerate(P)}
    terms = {power: matrix.subs(values) for power, matrix in effect(name).items()}
    with mpmath.workdps(exact.DIGITS):
        true = mpmath.matrix(3, 3)
        rows = interpreter("dcm-from-euler")([mpmath.mpf(x) / 5 for x in (1, 2, 2, 4)])
        for k, x in enumerate(rows):
            true[k // 3, k % 3] = x
        left = []
        for size in (mpmath.mpf(1) / 1000, mpmath.mpf(1) / 2000):
            error = mpmath.matrix(P.subs(values).tolist()) * size
            made = interpreter(scheme)(list((mpmath.eye(3) + error) * true))
            expected = mpmath.eye(3) + sum(
                (mpmath.matrix(m.tolist()) * size**power for power, m in terms.items()), mpmath.zeros(3)
            )
            wanted = list(expected * true)
            left.append(max(abs(a - b) for a, b in zip(made, wanted, strict=True)))
        assert left[0] < 1e-7
        assert float(mpmath.log(left[0] / left[1], 2)) == pytest.approx(3, abs=0.05)


def test_what_has_no_effect():
    with pytest.raises(InputError, match="has no series in the error"):
        effect("dcm-orthonormalize-optimal")
    with pytest.raises(InputError, match="scheme 'dcm' is not known"):
        effect("dcm")
