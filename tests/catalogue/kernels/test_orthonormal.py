"""Orthonormalization: the schemes of the thesis (chapter 3 C, appendix B), exactly and against SciPy."""

from fractions import Fraction
from functools import cache
from random import Random

import mpmath
import numpy as np
import pytest
import scipy.linalg
import sympy as sp
from scipy.spatial.transform import Rotation

import strapgen
from strapgen import derive, lower
from strapgen.kernel import algebra

EPS = np.finfo(float).eps
SCHEME = "dcm-orthonormalize"
OPTIMAL = "dcm-orthonormalize-optimal"
EXPANSIONS = {1: "dcm-orthonormalize-first-order", 2: "dcm-orthonormalize-second-order"}
ORDER = pytest.mark.parametrize("order", EXPANSIONS)

# A rotation in rationals, far from the identity.
TURNED = sp.Matrix([[-8, -1, 4], [4, -4, 7], [1, 8, 4]]) / 9


@cache
def kernel(name: str):
    return derive(name)


def apply(name: str, matrix) -> sp.Matrix:
    """Return a kernel's result on a matrix of numbers, polynomials or expressions."""
    made = kernel(name)
    return made.expand(dict(zip(made.inputs[0].elements, matrix, strict=True)))[made.outputs[0].signal.name]


def in_double(name: str, matrix: np.ndarray) -> np.ndarray:
    program = programs(name)
    values = dict(zip(program.inputs[0].elements, map(float, matrix.flat), strict=True))
    (result,) = program.run(values).values()
    return np.array(result, float).reshape(matrix.shape)


@cache
def programs(name: str):
    return lower(kernel(name))


def ring_matrix(elements) -> np.ndarray:
    return np.array(list(elements), dtype=object).reshape(3, 3)


def rational(random: Random) -> sp.Rational:
    return sp.Rational(random.randint(-99, 99), random.randint(1, 99))


@pytest.mark.parametrize("name", ["euler-normalize", "cayley-klein-normalize"])
def test_a_state_is_divided_by_its_length(name):
    made = kernel(name)
    values = dict(zip(made.inputs[0].elements, map(sp.Integer, (2, -4, 5, 6)), strict=True))
    assert made.expand(values)["next"] == [sp.Rational(x, 9) for x in (2, -4, 5, 6)]


def test_the_scheme_of_the_thesis():
    # C1' = C1 + C2 x C3 and so on in turn, then each row is divided by its length.
    random = Random(3)
    C = sp.Matrix(3, 3, lambda i, j: rational(random))
    rows = [C.row(k) for k in range(3)]
    new = [
        rows[0] + rows[1].cross(rows[2]),
        rows[1] + rows[2].cross(rows[0]),
        rows[2] + rows[0].cross(rows[1]),
    ]
    expected = sp.Matrix.vstack(*(row / sp.sqrt(row.dot(row)) for row in new))
    difference = sp.Matrix(3, 3, apply(SCHEME, C)) - expected
    assert difference.applyfunc(sp.radsimp) == sp.zeros(3, 3)


@ORDER
def test_the_expansions_are_written_in_the_excess(order):
    # C (I - S/2) and C (I - S/2 + 3/8 S^2) with S = C'C - I
    _, *generators = sp.ring("c1:10", sp.QQ)
    C, identity = ring_matrix(generators), np.eye(3, dtype=int).astype(object)
    S = C.T @ C - identity
    series = identity - S * Fraction(1, 2) + (S @ S * Fraction(3, 8) if order == 2 else 0)
    assert apply(EXPANSIONS[order], C.flat) == list((C @ series).flat)


@ORDER
def test_the_expansions_equal_the_forms_in_the_error(order):
    # (B.4) and (B.14): with C = (I + P) T, T true, the same to the order in P, counted by eps.
    ring, eps, *generators = sp.ring("eps p1:10", sp.QQ)
    P, T, identity = ring_matrix(generators), ring_matrix(TURNED), np.eye(3, dtype=int).astype(object)
    half, eighth = Fraction(1, 2), Fraction(1, 8)
    by_order = {1: P * half - P.T * half, 2: 0 * P}
    if order == 2:
        by_order[2] = (P.T @ P.T * 3 - P @ P - P @ P.T - P.T @ P) * eighth
    printed = (identity + by_order[1] * eps + by_order[2] * eps**2) @ T
    result = apply(EXPANSIONS[order], ((identity + P * eps) @ T).flat)
    difference = [a - b for a, b in zip(result, printed.flat, strict=True)]
    assert min(monomial[0] for d in difference for monomial in ring(d).itermonoms()) == order + 1


@pytest.mark.parametrize("name", [SCHEME, *EXPANSIONS.values()])
def test_a_turned_matrix_gives_the_turned_result(name):
    # So the error matrix of (I + P) T with T true is that of I + P with I true.
    random = Random(13)
    M = sp.Matrix(3, 3, lambda i, j: rational(random))
    difference = sp.Matrix(3, 3, apply(name, M * TURNED)) - sp.Matrix(3, 3, apply(name, M)) * TURNED
    assert difference.applyfunc(sp.radsimp) == sp.zeros(3, 3)


def in_high_precision(name: str, matrix: sp.Matrix) -> mpmath.matrix:
    """Return a kernel's result in mpmath, stage by stage."""
    made = kernel(name)
    known = {n: mpmath.mpf(x.p) / x.q for n, x in zip(made.inputs[0].elements, matrix, strict=True)}
    for stage in (*made.stages, *made.outputs):
        arguments = [sp.Symbol(n, real=True) for n in known]
        values = sp.lambdify(arguments, list(stage.expressions), "mpmath")(*known.values())
        known |= dict(zip(stage.signal.elements, values, strict=True))
    return mpmath.matrix([values[k : k + 3] for k in (0, 3, 6)])


@pytest.mark.long
@pytest.mark.parametrize(
    "stretch",
    [
        sp.Matrix([[3, 1, 0], [1, 2, 1], [0, 1, 4]]) / 3,
        sp.Matrix([[1000, 3, -1], [3, 1001, 2], [-1, 2, 998]]) / 1000,
        sp.diag(1, 1, 2),
        sp.diag(1, 2, 2),
        sp.diag(sp.Rational(1, 1000), 1, 30),
    ],
    ids=["far", "near", "equal-small", "equal-large", "ill-conditioned"],
)
def test_the_nearest_rotation_takes_the_stretch_away(stretch):
    # A matrix is a rotation times a stretch in one way only, its polar decomposition.
    with mpmath.workdps(60):
        error = in_high_precision(OPTIMAL, TURNED * stretch) - mpmath.matrix(TURNED)
        assert mpmath.mnorm(error, mpmath.inf) < mpmath.mpf("1e-40")


def test_the_expansions_are_the_series_of_the_nearest_rotation():
    # (I + S)^(-1/2) = I - S/2 + 3/8 S^2 - 5/16 S^3 + ...: what the second order leaves out, by its leading term.
    C = (sp.eye(3) + sp.Matrix([[1, -2, 3], [0, 2, 1], [4, 1, -1]]) / 10**15) * TURNED
    S = C.T * C - sp.eye(3)
    with mpmath.workdps(120):
        left_out = in_high_precision(OPTIMAL, C) - in_high_precision(EXPANSIONS[2], C)
        leading = mpmath.matrix(-sp.Rational(5, 16) * C * S**3)
        assert mpmath.mnorm(left_out - leading) < mpmath.mpf("1e-12") * mpmath.mnorm(leading)


def polar_tolerance(singular: np.ndarray) -> float:
    """Return what rounding may do to the nearest rotation, for the singular values of a matrix.

    Where two singular values meet the angle of the cubic is known to the root of a rounding, and so is the
    gap of the small squares against the largest, cond^2 sqrt(eps); it enters by its square.
    """
    return 64 * EPS * (singular.max() / singular.min()) ** 4


@pytest.mark.parametrize("distance", [1e-16, 1e-12, 1e-9, 1e-6, 1e-3, 0.1])
def test_the_nearest_rotation_near_rotations(distance, rng):
    for turn in Rotation.random(50, rng=rng).as_matrix():
        C = turn + distance * rng.standard_normal((3, 3))
        tolerance = polar_tolerance(scipy.linalg.svdvals(C))
        assert np.abs(in_double(OPTIMAL, C) - scipy.linalg.polar(C)[0]).max() <= tolerance


def test_the_nearest_rotation_far_from_rotations(rng):
    for left, right in zip(Rotation.random(200, rng=rng), Rotation.random(200, rng=rng), strict=True):
        singular = 10 ** rng.uniform(-1, 1, 3)
        C = left.as_matrix() * singular @ right.as_matrix()
        expected = (left * right).as_matrix()
        assert np.abs(in_double(OPTIMAL, C) - expected).max() <= polar_tolerance(singular)
        assert np.abs(scipy.linalg.polar(C)[0] - expected).max() <= polar_tolerance(singular)


@pytest.mark.parametrize(
    "singular", [(1, 1, 1), (2, 2, 2), (1e-3, 1e-3, 1e-3), (1e3, 1e3, 1e3), (2, 2, 1), (2, 1, 1), (3, 3, 0.3)]
)
def test_the_nearest_rotation_at_equal_singular_values(singular, rng):
    singular = np.array(singular, float)
    for left, right in zip(Rotation.random(50, rng=rng), Rotation.random(50, rng=rng), strict=True):
        C = left.as_matrix() * singular @ right.as_matrix()
        difference = in_double(OPTIMAL, C) - (left * right).as_matrix()
        assert np.abs(difference).max() <= polar_tolerance(singular)


# Rows, as the paper of 1984 corrects them


GENERAL = sp.Matrix(3, 3, sp.symbols("c:9"))


def change(name: str) -> sp.Matrix:
    """Return what a scheme adds to a matrix, expanded."""
    return (sp.Matrix(3, 3, apply(name, GENERAL)) - GENERAL).expand()


def test_correcting_rows_is_correcting_columns():
    # (33) and (34) are one polynomial, and with (32) the thesis's first order.
    rows = (sp.eye(3) - GENERAL * GENERAL.T) * GENERAL / 2
    columns = GENERAL * (sp.eye(3) - GENERAL.T * GENERAL) / 2
    assert rows.expand() == columns.expand() == change("dcm-orthonormalize-first-order")


def test_orthogonality_and_length_of_rows_make_the_whole_correction():
    # (28) to (31) from one matrix, their corrections added, are (32).
    parts = change("dcm-rows-orthogonalize") + change("dcm-rows-normalize")
    assert parts.expand() == change("dcm-orthonormalize-first-order")


def test_the_third_row_is_the_cross_product_of_the_others(rng):
    rotation = Rotation.random(rng=rng).as_matrix()
    made = strapgen.evaluator("dcm-third-row")(np.vstack([rotation[:2], rng.normal(size=(1, 3))]))
    np.testing.assert_allclose(made, rotation, atol=3e-16)


@pytest.mark.parametrize("name", ["euler", "cayley-klein"])
def test_first_order_normalization_is_the_sources(name):
    # (41), (42): the error is q q* - 1, and half of its product with q is taken away.
    e = sp.Symbol("e")
    q = sp.Matrix(sp.symbols("x y z s"))
    error = algebra.quaternion_product(q, algebra.quaternion_conjugate(q)) - sp.Matrix([0, 0, 0, 1])
    wanted = q - algebra.quaternion_product(error, q) / 2
    first = name == "cayley-klein"  # the scalar
    state = [q[3], *q[:3]] if first else list(q)
    made = sp.Matrix(apply(f"{name}-normalize-first-order", state))
    made = sp.Matrix([*made[1:], made[0]]) if first else made
    assert (made - wanted).expand() == sp.zeros(4, 1)
    # Of a length 1 + e is left 1 - 3/2 e^2 - e^3/2, exactly.
    unit = [sp.Rational(x, 9) for x in (2, -4, 5, 6)]
    made = apply(f"{name}-normalize-first-order", [(1 + e) * x for x in unit])
    left = 1 - sp.Rational(3, 2) * e**2 - e**3 / 2
    assert [sp.expand(x - left * y) for x, y in zip(made, unit, strict=True)] == [0] * 4
