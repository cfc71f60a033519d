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


def test_the_rotation_of_these_tests_is_one():
    assert (TURNED.T * TURNED, TURNED.det()) == (sp.eye(3), 1)


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


@pytest.mark.long
@pytest.mark.parametrize("name", [SCHEME, OPTIMAL, *EXPANSIONS.values()])
def test_a_rotation_is_left_alone(name):
    if name == OPTIMAL:  # atan2(0, 0) at equal singular values has a value in floating point only
        assert np.abs(in_double(name, np.array(TURNED, float)) - np.array(TURNED, float)).max() < 8 * EPS
    else:
        assert sp.Matrix(3, 3, apply(name, TURNED)) == TURNED


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


@ORDER
def test_the_residual_of_the_expansions(order):
    # -3/4 S^2 + 1/4 S^3, and 5/8 S^3 - 15/64 S^4 + 9/64 S^5
    residuals = {
        1: lambda S: -sp.Rational(3, 4) * S**2 + S**3 / 4,
        2: lambda S: sp.Rational(5, 8) * S**3 - sp.Rational(15, 64) * S**4 + sp.Rational(9, 64) * S**5,
    }
    random = Random(5)
    for _ in range(3):
        C = sp.Matrix(3, 3, lambda i, j: rational(random))
        result = sp.Matrix(3, 3, apply(EXPANSIONS[order], C))
        assert result.T * result - sp.eye(3) == residuals[order](C.T * C - sp.eye(3))


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


def test_the_identity_behind_the_nearest_rotation():
    # Cayley and Hamilton: U (G + i2 I) = i1 G + i3 I with G = U^2 and the invariants of U.
    a, b, c, d, e, f = sp.ring("a b c d e f", sp.QQ)[1:]
    U = np.array([[a, b, c], [b, d, e], [c, e, f]], dtype=object)
    identity = np.eye(3, dtype=int).astype(object)
    i1 = a + d + f
    i2 = a * d - b**2 + a * f - c**2 + d * f - e**2
    i3 = a * (d * f - e**2) - b * (b * f - c * e) + c * (b * e - c * d)
    G = U @ U
    assert np.all(U @ (G + identity * i2) == G * i1 + identity * i3)


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


@pytest.mark.parametrize("matrix", [np.eye(3), 2 * np.eye(3), np.diag([1.0, -1, -1]), np.diag([2.0, 2, 1])])
def test_the_nearest_rotation_of_exactly_orthogonal_columns(matrix):
    expected = np.sign(matrix)
    assert np.abs(in_double(OPTIMAL, matrix) - expected).max() <= 4 * EPS


def test_the_nearest_rotation_is_the_nearest(rng):
    # (B.1): it minimises Tr[(R - C)(R - C)'] over rotations R, near ones and any.
    def criterion(R, C):
        return np.trace((R - C) @ (R - C).T)

    for turn in Rotation.random(20, rng=rng).as_matrix():
        C = turn + 0.2 * rng.standard_normal((3, 3))
        nearest = in_double(OPTIMAL, C)
        least = criterion(nearest, C)
        others = Rotation.random(50, rng=rng).as_matrix()
        steps = Rotation.from_rotvec(rng.standard_normal((50, 3)) * 10.0 ** rng.uniform(-3, 0, (50, 1)))
        for other in [*others, *(nearest @ steps.as_matrix())]:
            assert criterion(other, C) > least


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


def test_errors_of_rows_turn_with_the_navigation_frame_and_those_of_columns_with_the_body():
    # (40), from dC/dt = C (w x) - (W x) C (38): rows are preferred, since the navigation frame turns slowly.
    C = GENERAL
    w, W = (algebra.skew(sp.Matrix(sp.symbols(f"{name}:3"))) for name in "wW")
    rate = C * w - W * C
    rows, columns = sp.eye(3) - C * C.T, sp.eye(3) - C.T * C
    rows_rate, columns_rate = -(rate * C.T + C * rate.T), -(rate.T * C + C.T * rate)
    assert (rows_rate - (rows * W - W * rows)).expand() == sp.zeros(3, 3)
    assert (columns_rate - (columns * w - w * columns)).expand() == sp.zeros(3, 3)


def test_the_sign_of_the_length_correction_is_plus():
    # A row that is too long becomes shorter: what is left is of second order.
    e = sp.Symbol("e")
    made = apply("dcm-rows-normalize", sp.diag(1 + e, 1, 1))
    assert sp.expand(made[0] - 1 + sp.Rational(3, 2) * e**2 + e**3 / 2) == 0


def test_the_third_row_is_the_cross_product_of_the_others(rng):
    rotation = Rotation.random(rng=rng).as_matrix()
    made = strapgen.evaluator("dcm-third-row")(np.vstack([rotation[:2], rng.normal(size=(1, 3))]))
    np.testing.assert_allclose(made, rotation, atol=3e-16)


@pytest.mark.parametrize("name", ["euler", "cayley-klein"])
def test_first_order_normalization_leaves_the_square_of_the_error(name, rng):
    state = rng.normal(size=4)
    state /= np.linalg.norm(state)
    normalize = strapgen.evaluator(f"{name}-normalize-first-order")
    for error in (1e-2, 1e-4, -1e-4):
        left = np.linalg.norm(normalize(state * (1 + error))) - 1
        assert left == pytest.approx(-1.5 * error**2, rel=abs(error) * 2, abs=4e-16)


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
