"""Exact algebra of rotations: identities that only the right signs satisfy."""

from fractions import Fraction

import pytest
import sympy as sp

from strapgen.kernel import algebra
from strapgen.kernel.algebra import evaluate

U = sp.Matrix(sp.symbols("u1:4", real=True))
V = sp.Matrix(sp.symbols("v1:4", real=True))
P = sp.Matrix(sp.symbols("p1:5", real=True))
Q = sp.Matrix(sp.symbols("q1:5", real=True))


def zero(matrix: sp.Matrix) -> bool:
    return matrix.expand() == sp.zeros(*matrix.shape)


def test_skew_is_the_matrix_of_the_cross_product():
    (u1, u2, u3), (v1, v2, v3) = U, V
    expected = sp.Matrix([u2 * v3 - u3 * v2, u3 * v1 - u1 * v3, u1 * v2 - u2 * v1])
    assert zero(algebra.skew(U) * V - expected)
    assert zero(algebra.cross(U, V) - expected)


def test_skew_turns_cross_products_into_commutators():
    A, B = algebra.skew(U), algebra.skew(V)
    assert zero(algebra.skew(algebra.cross(U, V)) - (A * B - B * A))


@pytest.mark.parametrize("size", [3, 4])
def test_dot(size):
    u, v = sp.symbols(f"a1:{size + 1}"), sp.symbols(f"b1:{size + 1}")
    assert algebra.dot(sp.Matrix(u), sp.Matrix(v)) == sum(a * b for a, b in zip(u, v, strict=True))


def test_quaternion_units_obey_hamilton():
    one, i, j, k = (sp.Matrix([int(n == place) for n in range(4)]) for place in (3, 0, 1, 2))
    times = algebra.quaternion_product
    assert times(i, i) == times(j, j) == times(k, k) == times(times(i, j), k) == -one
    assert (times(i, j), times(j, k), times(k, i)) == (k, i, j)
    assert times(one, Q) == times(Q, one) == Q


def test_conjugate_gives_the_squared_length():
    squared = Q.dot(Q)
    product = algebra.quaternion_product(Q, algebra.quaternion_conjugate(Q))
    assert zero(product - sp.Matrix([0, 0, 0, squared]))


def test_products_of_quaternions_are_products_of_matrices():
    # A wrong order or a transposed matrix would turn the right side round.
    left = algebra.quaternion_matrix(algebra.quaternion_product(P, Q))
    assert zero(left - algebra.quaternion_matrix(P) * algebra.quaternion_matrix(Q))


def test_quaternion_matrix_is_the_squared_length_times_a_rotation():
    M, squared = algebra.quaternion_matrix(Q), Q.dot(Q)
    assert zero(M.T * M - squared**2 * sp.eye(3))
    assert sp.expand(M.det() - squared**3) == 0


def test_quaternion_matrix_turns_by_the_right_hand_rule():
    # A quarter turn about z, scalar last, takes x to y.
    quarter = sp.Matrix([0, 0, 1, 1]) / sp.sqrt(2)
    assert algebra.quaternion_matrix(quarter) * sp.Matrix([1, 0, 0]) == sp.Matrix([0, 1, 0])


def test_pauli_matrices():
    s1, s2, s3 = algebra.PAULI
    assert s1 * s1 == s2 * s2 == s3 * s3 == sp.eye(2)
    assert (s1 * s2, s2 * s3, s3 * s1) == (sp.I * s3, sp.I * s1, sp.I * s2)


def test_cayley_klein_matrix_has_the_printed_layout():
    # U = [[alpha, -conj(beta)], [beta, conj(alpha)]], alpha = a1 + i a4, beta = -a3 + i a2
    a1, a2, a3, a4 = P
    alpha, beta = a1 + sp.I * a4, -a3 + sp.I * a2
    printed = sp.Matrix([[alpha, -sp.conjugate(beta)], [beta, sp.conjugate(alpha)]])
    matrix = algebra.cayley_klein_matrix(P)
    assert zero(matrix - printed)
    assert zero(matrix.H * matrix - P.dot(P) * sp.eye(2))


def test_cayley_klein_parameters_invert_the_matrix():
    assert algebra.cayley_klein_parameters(algebra.cayley_klein_matrix(P)) == P


def test_rotation_equals_the_printed_form():
    # |v| = pi/3 along (2, 3, 6)/7: I + sin K + (1 - cos) K^2
    n = sp.Matrix([2, 3, 6]) / 7
    K = algebra.skew(n)
    expected = sp.eye(3) + sp.sqrt(3) / 2 * K + K * K / 2
    rotation = algebra.rotation(n * sp.pi / 3).applyfunc(lambda element: element.rewrite(sp.sin))
    assert zero(rotation - expected)


def test_rotation_has_no_singularity():
    assert algebra.rotation(sp.zeros(3, 1)) == sp.eye(3)


def test_adjugate():
    A = sp.Matrix(3, 3, sp.symbols("a1:10"))
    assert zero(A * algebra.adjugate(A) - A.det() * sp.eye(3))


def test_evaluate_keeps_polynomials():
    x, y, z = sp.symbols("x y z")
    ring, r, s, t = sp.ring("r s t", sp.QQ)
    expression = (x + y / 3 + sp.Rational(1, 2)) ** 2 * z - 2 * x * y
    value = evaluate(expression, {"x": r, "y": s, "z": t})
    assert value.ring == ring
    assert value == (r + s / 3 + sp.QQ(1, 2)) ** 2 * t - 2 * r * s


def test_evaluate_is_exact_on_fractions():
    x, y = sp.symbols("x y")
    values = {"x": Fraction(1, 3), "y": Fraction(-2, 7)}
    assert evaluate(x / 7 + x * y**3 + sp.Rational(5, 11), values) == sp.Rational(1, 21) - sp.Rational(
        8, 1029
    ) + sp.Rational(5, 11)


def test_evaluate_calls_functions_and_chooses():
    x, y = sp.symbols("x y", real=True)
    expression = sp.Piecewise((sp.sin(x) / y, x > y), (sp.sqrt(y), True)) + sp.Max(x, y) + sp.pi
    assert evaluate(expression, {"x": sp.pi / 2, "y": sp.Integer(1)}) == 1 + sp.pi / 2 + sp.pi
    assert evaluate(expression, {"x": sp.Integer(1), "y": sp.Integer(9)}) == 3 + 9 + sp.pi


def test_evaluate_does_not_rearrange():
    # Left as written, the value is a product; SymPy's own substitution would multiply 2 into the sum.
    x = sp.Symbol("x")
    number = sp.Symbol("n")
    assert evaluate(number * x, {"n": 2.0, "x": 3}) == 6.0
    assert isinstance(evaluate(number * x, {"n": 2.0, "x": 3}), float)


def test_evaluate_needs_every_symbol():
    with pytest.raises(KeyError, match="y"):
        evaluate(sp.Symbol("x") + sp.Symbol("y"), {"x": 1})


def test_evaluation_takes_numbers_from_a_function():
    # Values of other systems need not know SymPy's numbers.
    x = sp.Symbol("x")
    asked = []

    def number(r):
        asked.append(r)
        return Fraction(int(r.p), int(r.q))

    assert evaluate(x / 3 + sp.Rational(1, 2), {"x": Fraction(1, 7)}, number) == Fraction(23, 42)
    assert set(asked) == {sp.Rational(1, 3), sp.Rational(1, 2)}


def test_cross_and_dot_take_any_numbers():
    u, v = [Fraction(1, 2), 3, -1], [2, Fraction(1, 3), 5]
    assert algebra.cross_elements(u, v) == [Fraction(46, 3), Fraction(-9, 2), Fraction(-35, 6)]
    assert algebra.dot(u, v) == -3
    assert algebra.dot(algebra.cross_elements(u, v), u) == 0
