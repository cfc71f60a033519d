"""Bounds eigenvalues of symmetric matrices of polynomials with FLINT, by cutting a box until the bound is close."""

from __future__ import annotations

import heapq
import itertools
import math
from fractions import Fraction
from typing import Any

import numpy as np

#: The share of the bound that may be lost, what is lost beside it, and boxes after which neither matters.
_CLOSE, _NOTHING, _MOST_BOXES = 0.01, 1e-15, 3_000
#: Dimensions of space.
_SPACE = 3

#: A symmetric matrix of polynomials.
Matrix = list[list[Any]]
#: A box of the three variables: the ends of every side.
_Box = tuple[tuple[Fraction, Fraction], ...]


def exact(number: Fraction) -> Any:
    """Return a number of FLINT."""
    from flint import fmpq

    return fmpq(number.numerator, number.denominator)


def turns_alone(matrix: Matrix) -> bool:
    """Tell whether rotations of all vectors turn a symmetric matrix of polynomials, and leave one element as it is."""
    gens = matrix[0][0].context().gens()
    size = len(matrix)
    for i, j in itertools.combinations(range(_SPACE), 2):
        turn = {(j, i): 1, (i, j): -1} if size == _SPACE else {}
        for row, column in itertools.product(range(size), repeat=2):
            polynomial, change = matrix[row][column], 0 * gens[0]
            for vector in range(0, len(gens), _SPACE):
                a, b = vector + i, vector + j
                change += gens[a] * polynomial.derivative(b) - gens[b] * polynomial.derivative(a)
            for k in range(size):
                change -= (
                    turn.get((row, k), 0) * matrix[k][column] - turn.get((k, column), 0) * matrix[row][k]
                )
            if change != 0:
                return False
    return True


def largest(matrices: list[Matrix]) -> Fraction:
    """Return an upper bound of 0 and of all eigenvalues for x and z from 0 to 1, y from -1 to 1, y^2 + z^2 up to 1."""
    power = min(
        (int(powers[0]) for m in matrices for row in m for p in row for powers in p.to_dict()), default=0
    )
    quotients = [[[_divided(p, power) for p in row] for row in matrix] for matrix in matrices]
    zero, one = Fraction(0), Fraction(1)
    order, reached = itertools.count(), 0.0
    start: _Box = ((zero, one), (-one, one), (zero, one))
    pending: list[tuple[float, int, Matrix, _Box]] = []

    def examine(matrix: Matrix, box: _Box) -> None:
        nonlocal reached
        middle, above = _eigenvalues(matrix, box)
        x, y, z = ((low + high) / 2 for low, high in box)
        if y * y + z * z <= 1:
            reached = max(reached, middle * float(x) ** power)
        highest = Fraction(max(0.0, above)) * box[0][1] ** power
        heapq.heappush(pending, (-math.nextafter(float(highest), math.inf), next(order), matrix, box))

    for matrix in quotients:
        examine(matrix, start)
    while len(pending) < _MOST_BOXES and -pending[0][0] > reached * (1 + _CLOSE) + _NOTHING:
        _, _, matrix, box = heapq.heappop(pending)
        side = max(range(_SPACE), key=lambda k: box[k][1] - box[k][0])
        low, high = box[side]
        for half in ((low, (low + high) / 2), ((low + high) / 2, high)):
            part = (*box[:side], half, *box[side + 1 :])
            if _least_square(part) <= 1:
                examine(matrix, part)
    return Fraction(-pending[0][0])


def _divided(polynomial: Any, power: int) -> Any:
    """Return a polynomial divided by a power of x."""
    terms = {(n - power, *others): c for (n, *others), c in polynomial.to_dict().items()}
    return polynomial.context().from_dict(terms)


def _eigenvalues(matrix: Matrix, box: _Box) -> tuple[float, float]:
    """Return about the largest eigenvalue in the middle of a box, and a number below which all in it are.

    About the middle, a matrix is linear but for terms that are bounded one by one; the largest eigenvalue of what is
    linear is convex, and so largest at a corner.
    """
    from flint import fmpq, fmpq_mat

    ring = matrix[0][0].context()
    moved = [
        exact((low + high) / 2) + exact((high - low) / 2) * gen
        for gen, (low, high) in zip(ring.gens(), box, strict=True)
    ]
    size = len(matrix)
    upper = {(i, j): matrix[i][j].compose(*moved, ctx=ring) for i in range(size) for j in range(i, size)}
    places = [[(min(i, j), max(i, j)) for j in range(size)] for i in range(size)]

    def part(*powers: int) -> Any:
        return fmpq_mat(size, size, [upper[place][powers] for row in places for place in row])

    linear = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
    rests = {
        place: sum(map(abs, element.coeffs()), fmpq(0)) - sum(abs(element[powers]) for powers in linear)
        for place, element in upper.items()
    }
    rest = max(sum((rests[place] for place in row), fmpq(0)) for row in places)
    middle, slopes = part(0, 0, 0), [part(1, 0, 0), part(0, 1, 0), part(0, 0, 1)]
    corners = [
        sum((sign * slope for sign, slope in zip(signs, slopes, strict=True)), middle)
        for signs in itertools.product((-1, 1), repeat=_SPACE)
    ]
    return _largest_eigenvalue(middle), max(map(_above, corners)) + _rounded_up(rest)


def _least_square(box: _Box) -> Fraction:
    """Return the least y^2 + z^2 in a box."""
    return sum((min(a * a, b * b) if a * b > 0 else Fraction(0) for a, b in box[1:]), Fraction(0))


def _largest_eigenvalue(matrix: Any) -> float:
    """Return about the largest eigenvalue of a matrix."""
    rows = [[int(x.p) / int(x.q) for x in row] for row in matrix.tolist()]
    if len(rows) == 1:
        return rows[0][0]
    return float(np.linalg.eigvalsh(np.array(rows)).max())


def _above(matrix: Any) -> float:
    """Return a number that is above all eigenvalues."""
    about = _largest_eigenvalue(matrix)
    margin = 1e-9 * abs(about) + 1e-30
    while not _exceeds(exact(Fraction(about + margin)), matrix):
        margin *= 16
    return about + margin


def _exceeds(number: Any, matrix: Any) -> bool:
    """Tell whether a number is above all eigenvalues: what they lack of it has positive leading minors."""
    from flint import fmpq_mat

    size = matrix.nrows()
    if size == 1:
        return bool(number > matrix[0, 0])
    lack = (fmpq_mat([[number * (i == j) for j in range(size)] for i in range(size)]) - matrix).tolist()
    minors = (fmpq_mat([row[:k] for row in lack[:k]]).det() for k in range(1, size + 1))
    return all(minor > 0 for minor in minors)


def _rounded_up(number: Any) -> float:
    """Return a number that is not below an exact one of 0 or more."""
    return math.nextafter(int(number.p) / int(number.q), math.inf)
