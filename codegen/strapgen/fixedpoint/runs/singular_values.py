"""Bounds the singular values of a transition from its exact polynomials.

A transition T stretches a state by the roots of the eigenvalues of T T', of a quaternion by its length. Where it turns
with its increments, a rotation of all of them leaves these values alone: the longer increment may lie along x and the
other one in the plane of x and y. In units of the longer, the other lies in a half disc; what is left are three
variables, on which polynomials are bounded in Bernstein form.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from fractions import Fraction
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from strapgen.fixedpoint.intervals import Interval, norm
from strapgen.ir.program import Program, Result
from strapgen.kernel.bernstein import Cube, Powers, eigenvalue_bounds
from strapgen.kernel.polynomials import ONE, OPERATIONS, Polynomial, add, multiply, scale

#: Dimensions of space, and elements of a quaternion.
_SPACE, _QUATERNION = 3, 4
#: Products of terms after which polynomials count as too long.
_MOST_PRODUCTS = 400_000
#: Vectors that three variables describe.
_MOST_VECTORS = 2
#: A square of a length that is above 1 in double is above 1.
_LONGER = 1 + 2.0**-40
#: Fraction bits of the length of an increment.
_LENGTH_BITS = 40


class _TooLongError(ValueError):
    """A transition is no polynomial, or one that is too long to bound it."""


def singular_value_bounds(
    program: Program, transition: Result, sizes: Sequence[Fraction], width: int, known: Fraction
) -> Interval:
    """Return bounds of the squared singular values of a transition, less 1, which `known` bounds already."""
    coarse = Interval.symmetric(known)
    vectors = len(sizes) // _SPACE
    parts = [signal.size % _SPACE for signal in program.inputs[1:]]
    of_one_kind = (len(transition.nodes), width) in ((_QUATERNION, _QUATERNION), (_SPACE**2, _SPACE))
    if not of_one_kind or any(parts) or not 0 < vectors <= _MOST_VECTORS:
        return coarse
    try:
        elements = _polynomials(program, transition)
    except _TooLongError:
        return coarse
    if not _turns_with_vectors(elements):
        return coarse
    lengths = [_length(sizes[k : k + _SPACE]) for k in range(0, len(sizes), _SPACE)]
    in_plane = [
        _excess(_in_plane(elements, order, lengths), width)
        for order in itertools.permutations(range(vectors))
    ]
    excess = [_in_powers(matrix, side, vectors) for matrix in in_plane for side in (1, -1)[:vectors]]
    return Interval.of(*eigenvalue_bounds(excess, _samples(vectors), known, _is_outside))


def _polynomials(program: Program, transition: Result) -> list[Polynomial]:
    """Return the elements of a transition as polynomials of (vector, axis); _TooLongError if they are none."""
    part = program.transition_program()
    names = [name for signal in program.inputs[1:] for name in signal.elements]
    left = _MOST_PRODUCTS

    def product(p: Polynomial, q: Polynomial) -> Polynomial:
        nonlocal left
        left -= len(p) * len(q)
        if left < 0:
            raise _TooLongError
        return multiply(p, q)

    try:
        (elements,) = part.run(
            {name: {(divmod(place, _SPACE),): Fraction(1)} for place, name in enumerate(names)},
            lambda value: scale(ONE, value),
            {**OPERATIONS, "multiply": product},
        ).values()
    except KeyError as error:  # an operation that is no polynomial
        raise _TooLongError from error
    return elements


def _turns_with_vectors(elements: Sequence[Polynomial]) -> bool:
    """Tell whether a matrix, or a quaternion, turns with its vectors: about two axes, and so about all.

    A small turn G of the vectors must change a matrix T by G T - T G, and of a quaternion the vector part by G v.
    """
    for i, j in ((0, 1), (1, 2)):
        turned = [_turned(element, i, j) for element in elements]
        expected: list[Polynomial] = [{} for _ in elements]
        if len(elements) == _QUATERNION:
            expected[j], expected[i] = elements[i], scale(elements[j], -1)
        else:
            for k in range(_SPACE):
                for row, other, sign in ((j, i, 1), (i, j, -1)):
                    at, source = _SPACE * row + k, _SPACE * other + k
                    expected[at] = add(expected[at], elements[source], sign)
                    at, source = _SPACE * k + row, _SPACE * k + other
                    expected[at] = add(expected[at], elements[source], sign)
        if turned != expected:
            return False
    return True


def _turned(p: Polynomial, i: int, j: int) -> Polynomial:
    """Return the derivative of a polynomial when all vectors turn from axis i to axis j."""
    change: Polynomial = {}
    for monomial, coefficient in p.items():
        for place, (vector, axis) in enumerate(monomial):
            if axis in (i, j):
                other, sign = (i, 1) if axis == j else (j, -1)
                turned = tuple(sorted((*monomial[:place], (vector, other), *monomial[place + 1 :])))
                change = add(change, {turned: coefficient * sign})
    return change


def _length(elements: Sequence[Fraction]) -> Fraction:
    """Return the largest length of a vector, rounded up to few digits."""
    return Fraction(math.ceil(norm(elements) * (1 << _LENGTH_BITS)), 1 << _LENGTH_BITS)


def _in_plane(
    elements: Sequence[Polynomial], order: Sequence[int], lengths: Sequence[Fraction]
) -> list[Polynomial]:
    """Return polynomials of the coordinates 0 of the first vector along x, 1 and 2 of the second one along x and y."""
    coordinates = {
        (vector, axis): place + axis for place, vector in enumerate(order) for axis in range(place + 1)
    }
    return [
        {
            tuple(sorted(coordinates[atom] for atom in monomial)): c
            * math.prod(lengths[v] for v, _ in monomial)
            for monomial, c in element.items()
            if coordinates.keys() >= set(monomial)
        }
        for element in elements
    ]


def _excess(elements: Sequence[Polynomial], width: int) -> list[list[Polynomial]]:
    """Return T T' - 1."""
    rows = [elements[k : k + width] for k in range(0, len(elements), width)]
    upper = {
        (i, j): reduce(add, map(multiply, rows[i], rows[j]), scale(ONE, -1) if i == j else {})
        for i, j in itertools.combinations_with_replacement(range(len(rows)), 2)
    }
    return [[upper[min(i, j), max(i, j)] for j in range(len(rows))] for i in range(len(rows))]


def _in_powers(matrix: Sequence[Sequence[Polynomial]], side: int, vectors: int) -> list[list[Powers]]:
    """Return a matrix in the variables from 0 to 1: the length of the first vector, and the second in units of that."""
    return [
        [
            {
                (len(m), m.count(1), m.count(2))[: 2 * vectors - 1]: c * side ** m.count(1)
                for m, c in polynomial.items()
            }
            for polynomial in row
        ]
        for row in matrix
    ]


def _samples(vectors: int) -> NDArray[np.float64]:
    """Return points in the cube: lengths of the first vector, and points of a quarter of a disc."""
    if vectors == 1:
        return np.linspace(0, 1, 65)[:, None]
    axes = np.linspace(0, 1, 9), np.linspace(0, 1, 5), np.linspace(0, np.pi / 2, 31)
    first, second, angle = (x.ravel() for x in np.meshgrid(*axes))
    return np.stack([first, second * np.cos(angle), second * np.sin(angle)], axis=1)


def _is_outside(cube: Cube) -> bool:
    """Tell whether the second vector is longer than the first anywhere in a part of the cube, in spite of rounding."""
    return sum(low * low for low, _ in cube[1:]) > _LONGER
