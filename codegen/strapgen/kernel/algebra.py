"""Exact algebra of kernels, as `strapgen.algebra`: rotations, evaluation of expressions, functions that SymPy lacks.

Vectors are 3 x 1 matrices. Quaternions are 4 x 1 matrices with the scalar **last**, as the Euler parameters.
All functions of rotations but `rotation` and `quaternion` use only sums and products, so they also take polynomials
and numbers.

>>> from strapgen import algebra
>>> algebra.skew(sp.Matrix([1, 2, 3]))
Matrix([
[ 0, -3,  2],
[ 3,  0, -1],
[-2,  1,  0]])
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import sympy as sp

__all__ = [
    "CROSS",
    "PAULI",
    "Direction",
    "Wrapped",
    "adjugate",
    "cayley_klein_matrix",
    "cayley_klein_parameters",
    "cross",
    "cross_elements",
    "dot",
    "evaluate",
    "exact",
    "quaternion",
    "quaternion_conjugate",
    "quaternion_matrix",
    "quaternion_product",
    "rotation",
    "skew",
    "wave_series",
]


def skew(v: sp.Matrix) -> sp.Matrix:
    """Return the 3 x 3 matrix of the cross product with a vector, 3 x 1: ``skew(v) * u == v x u``.

    Examples
    --------
    >>> skew(sp.Matrix(sp.symbols("x y z")))
    Matrix([
    [ 0, -z,  y],
    [ z,  0, -x],
    [-y,  x,  0]])
    """
    columns = [cross_elements(v, [int(axis == k) for k in range(3)]) for axis in range(3)]
    return sp.Matrix(columns).T


#: Index pairs (i, j) of the cross product: its elements are u[i] v[j] - u[j] v[i].
CROSS = ((1, 2), (2, 0), (0, 1))


def cross_elements(u: Sequence[Any], v: Sequence[Any]) -> list[Any]:
    """Return the elements of the cross product of two 3-vectors of symbols, polynomials or numbers.

    Examples
    --------
    >>> cross_elements([1, 0, 0], [0, 1, 0])
    [0, 0, 1]
    """
    return [u[i] * v[j] - u[j] * v[i] for i, j in CROSS]


def cross(u: sp.Matrix, v: sp.Matrix) -> sp.Matrix:
    """Return the cross product of two 3-vectors.

    Examples
    --------
    >>> cross(sp.Matrix([1, 0, 0]), sp.Matrix([0, 1, 0])).T
    Matrix([[0, 0, 1]])
    """
    return sp.Matrix(cross_elements(u, v))


def dot(u: Sequence[Any], v: Sequence[Any]) -> Any:
    """Return the scalar product of two vectors of the same length, of symbols, polynomials or numbers.

    Examples
    --------
    >>> dot([1, 2, 3], sp.symbols("x y z"))
    x + 2*y + 3*z
    """
    first, *rest = (a * b for a, b in zip(u, v, strict=True))
    return sum(rest, first)


def quaternion_product(p: sp.Matrix, q: sp.Matrix) -> sp.Matrix:
    """Return the product p q of quaternions, 4 x 1, scalar last: q followed by p, both in reference axes.

    Examples
    --------
    >>> i, j = sp.Matrix([1, 0, 0, 0]), sp.Matrix([0, 1, 0, 0])
    >>> quaternion_product(i, j).T
    Matrix([[0, 0, 1, 0]])
    """
    p_v, p_s, q_v, q_s = p[:3, :], p[3], q[:3, :], q[3]
    return sp.Matrix([*(p_s * q_v + q_s * p_v + cross(p_v, q_v)), p_s * q_s - dot(p_v, q_v)])


def quaternion_conjugate(q: sp.Matrix) -> sp.Matrix:
    """Return the conjugate of a quaternion, 4 x 1, scalar last.

    Examples
    --------
    >>> quaternion_conjugate(sp.Matrix([1, 2, 3, 4])).T
    Matrix([[-1, -2, -3, 4]])
    """
    return sp.Matrix([-q[0], -q[1], -q[2], q[3]])


def quaternion_matrix(q: sp.Matrix) -> sp.Matrix:
    """Return the matrix of ``v -> q v q*``, 3 x 3: ``|q|^2`` times the direction cosine matrix of q, scalar last.

    Examples
    --------
    >>> quaternion_matrix(sp.Matrix([0, 0, 1, 0]))
    Matrix([
    [-1,  0, 0],
    [ 0, -1, 0],
    [ 0,  0, 1]])
    """
    columns = []
    for axis in range(3):
        unit = sp.Matrix([int(k == axis) for k in range(4)])
        rotated = quaternion_product(quaternion_product(q, unit), quaternion_conjugate(q))
        columns.append(rotated[:3, :])
    return sp.Matrix.hstack(*columns)


#: The Pauli matrices s1, s2, s3.
PAULI = (
    sp.Matrix([[0, 1], [1, 0]]),
    sp.Matrix([[0, -sp.I], [sp.I, 0]]),
    sp.Matrix([[1, 0], [0, -1]]),
)


def cayley_klein_matrix(a: sp.Matrix) -> sp.Matrix:
    """Return U = a1 I + i (a2 s1 + a3 s2 + a4 s3), the complex 2 x 2 form of Cayley-Klein parameters, a1 the scalar.

    Examples
    --------
    >>> cayley_klein_matrix(sp.Matrix([1, 0, 0, 0])) == sp.eye(2)
    True
    """
    return a[0] * sp.eye(2) + sp.I * sum((a[k + 1] * PAULI[k] for k in range(3)), sp.zeros(2, 2))


def cayley_klein_parameters(U: sp.Matrix) -> sp.Matrix:
    """Return the real parameters, 4 x 1, scalar **first**, of a 2 x 2 matrix: the inverse of `cayley_klein_matrix`.

    Examples
    --------
    >>> cayley_klein_parameters(cayley_klein_matrix(sp.Matrix([4, 1, 2, 3]))).T
    Matrix([[4, 1, 2, 3]])
    """
    parts = [U.trace() / 2, *((U * s).trace() / (2 * sp.I) for s in PAULI)]
    return sp.Matrix([sp.expand(part) for part in parts])


def wave_series(square: Any, first: int, order: int) -> Any:
    """Return the truncated series of sin(x)/x, (1 - cos x)/x^2, (x - sin x)/x^3 or cos x in the square of x.

    Parameters
    ----------
    square : Expr or ring element
        x^2.
    first : int
        1, 2, 3 or 0 for these functions: the power of x that multiplies the function in the caller's formula.
    order : int
        Highest power of x in that product, so that the series itself ends at ``order - first``.

    Examples
    --------
    >>> wave_series(sp.Symbol("A"), 1, 5)
    A**2/120 - A/6 + 1
    """
    total = 0 * square
    for j in range((order - first) // 2 + 1):
        total += square**j * sp.Rational((-1) ** j, sp.factorial(2 * j + first))
    return total


def rotation(v: sp.Matrix, order: int | None = None, square: sp.Expr | None = None) -> sp.Matrix:
    """Return exp(skew(v)), the rotation matrix of the rotation vector v, without a singularity at v = 0.

    The matrix is I + (sin x)/x skew(v) + (1 - cos x)/x^2 skew(v)^2 with x = ``|v|``. The last factor is written as half
    the square of sin(x/2)/(x/2).

    Parameters
    ----------
    v : Matrix, 3 x 1
        Rotation vector in rad.
    order : int, optional
        Highest degree in v of the products that are kept; all by default.
    square : Expr, optional
        v . v, where it has a name.

    Returns
    -------
    Matrix, 3 x 3

    Examples
    --------
    >>> rotation(sp.Matrix([0, 0, sp.Symbol("z")]), order=2)
    Matrix([
    [1 - z**2/2,         -z, 0],
    [         z, 1 - z**2/2, 0],
    [         0,          0, 1]])
    """
    square = dot(v, v) if square is None else square
    K = skew(v)
    if order is not None:
        return sp.eye(3) + wave_series(square, 1, order) * K + wave_series(square, 2, order) * (K * K)
    angle = sp.sqrt(square)
    return sp.eye(3) + sp.sinc(angle) * K + sp.sinc(angle / 2) ** 2 / 2 * K * K


def quaternion(v: sp.Matrix, order: int | None = None, square: sp.Expr | None = None) -> sp.Matrix:
    """Return the unit quaternion of the rotation vector v, without a singularity at v = 0.

    Parameters
    ----------
    v : Matrix, 3 x 1
        Rotation vector in rad.
    order : int, optional
        Highest degree in v of the products that are kept; all by default.
    square : Expr, optional
        v . v, where it has a name.

    Returns
    -------
    Matrix, 4 x 1
        Scalar last.

    Examples
    --------
    >>> quaternion(sp.Matrix([0, 0, sp.Symbol("z")]), order=2).T
    Matrix([[0, 0, z/2, 1 - z**2/8]])
    """
    square = dot(v, v) if square is None else square
    if order is not None:
        return sp.Matrix([*(wave_series(square / 4, 1, order) / 2 * v), wave_series(square / 4, 0, order)])
    half = sp.sqrt(square) / 2
    return sp.Matrix([*(sp.sinc(half) / 2 * v), sp.cos(half)])


def adjugate(A: sp.Matrix) -> sp.Matrix:
    """Return the adjugate of a 3 x 3 matrix, from cross products of its columns.

    Examples
    --------
    >>> A = sp.Matrix([[2, 0, 0], [0, 3, 0], [0, 0, 4]])
    >>> adjugate(A) * A == sp.det(A) * sp.eye(3)
    True
    """
    a, b, c = A[:, 0], A[:, 1], A[:, 2]
    return sp.Matrix([cross_elements(b, c), cross_elements(c, a), cross_elements(a, b)])


def exact(number: Fraction | sp.Expr) -> sp.Expr:
    """Return a fraction as a number of SymPy, and any other exact number unchanged.

    Examples
    --------
    >>> exact(Fraction(1, 3)) + sp.Rational(1, 6)
    1/2
    """
    return sp.Rational(number.numerator, number.denominator) if isinstance(number, Fraction) else number


class Direction(sp.Function):  # type: ignore[misc]
    """The angle atan2(y, x) up to whole turns, so that -pi and pi are equivalent.

    Examples
    --------
    >>> Direction(0, -1)
    pi
    """

    nargs = 2

    @classmethod
    def eval(cls, y: sp.Expr, x: sp.Expr) -> sp.Expr | None:
        """Return the angle of two numbers; None for other arguments, which stay unevaluated."""
        return sp.atan2(y, x) if y.is_number and x.is_number else None


class Wrapped(sp.Function):  # type: ignore[misc]
    """An angle of at most one and a half turns, reduced to -pi to pi by a whole turn.

    Examples
    --------
    >>> Wrapped(3 * sp.pi / 2)
    -pi/2
    """

    nargs = 1

    @classmethod
    def eval(cls, angle: sp.Expr) -> sp.Expr | None:
        """Return the reduced angle of a number; None for other arguments, which stay unevaluated."""
        if not angle.is_number:
            return None
        turns = int(bool(angle > sp.pi)) - int(bool(angle < -sp.pi))
        return angle - 2 * sp.pi * turns


def evaluate(
    expression: sp.Expr,
    values: Mapping[str, Any],
    number: Callable[[sp.Rational], Any] | None = None,
    function: Callable[[sp.Expr, list[Any]], Any] | None = None,
) -> Any:
    """Evaluate an expression with the given values for its symbols.

    Unlike `subs` this does not rearrange the expression. It applies the operators of the values to each sum and
    product, so polynomials stay polynomials and numbers stay exact.

    Parameters
    ----------
    expression : Expr
    values : mapping of str to number, polynomial or Expr
    number : callable, optional
        Converts a rational number of SymPy if the values do not combine with it.
    function : callable, optional
        ``function(expression, arguments)`` evaluates an expression that is no sum, product or whole power, by default
        as SymPy does. It returns whether a condition holds, and then only one branch is evaluated.

    Returns
    -------
    number, polynomial or Expr

    Raises
    ------
    KeyError
        If a symbol has no value.

    Examples
    --------
    >>> x, y = sp.symbols("x y")
    >>> evaluate(x * (x + y), {"x": 2, "y": 3})
    10
    """
    if expression.is_Symbol:
        return values[expression.name]
    if expression.is_Rational:
        return number(expression) if number else expression
    if function is not None and isinstance(expression, sp.Piecewise):
        # Branches are tried in order, since a later one may have no value here.
        for value, condition in expression.args:
            if condition == sp.true or evaluate(condition, values, number, function):
                return evaluate(value, values, number, function)
    arguments = [evaluate(argument, values, number, function) for argument in expression.args]
    if expression.is_Add or expression.is_Mul:
        result = arguments[0]
        for argument in arguments[1:]:
            # A polynomial must come first: a SymPy number on the left would treat it as a symbol.
            first, second = (argument, result) if isinstance(result, sp.Rational) else (result, argument)
            result = first + second if expression.is_Add else first * second
        return result
    if expression.is_Pow and expression.exp.is_Integer and expression.exp > 0:
        return arguments[0] ** int(expression.exp)
    if function is not None:
        return function(expression, arguments)
    return expression.func(*(sp.sympify(argument) for argument in arguments))
