"""Axes of redundant sensors in exact numbers: parity equations, triads with noise, and failures that they tell."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import combinations
from typing import Any

from strapgen.support import checks
from strapgen.support.exceptions import InputError

#: Sensors of a geometry: fewer have no parity equation, more have more equations than a table can hold.
LEAST_AXES, MOST_AXES = 4, 10

Row = tuple[Fraction, ...]


def _cross(a: Row, b: Row) -> Row:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _dot(a: Sequence[Fraction], b: Sequence[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


def _det(a: Row, b: Row, c: Row) -> Fraction:
    return _dot(_cross(a, b), c)


def _inverse(rows: Sequence[Row]) -> tuple[Row, ...]:
    """Return the inverse of a regular 3 x 3 matrix of rows."""
    a, b, c = rows
    det = _det(a, b, c)
    columns = (_cross(b, c), _cross(c, a), _cross(a, b))
    return tuple(tuple(column[k] / det for column in columns) for k in range(3))


@dataclass(frozen=True)
class Triad:
    """Three sensors and the rate that they measure.

    Parameters
    ----------
    sensors : tuple of int
        Their numbers.
    determinant : Fraction
        Of their axes.
    inverse : tuple of tuple of Fraction, 3 x 3
        From the three measurements to components along x, y and z.
    """

    sensors: tuple[int, ...]
    determinant: Fraction
    inverse: tuple[Row, ...]

    @property
    def squared_gains(self) -> Row:
        """Squares of the noise in x, y and z for equal, independent noise of 1 on all sensors."""
        return tuple(_dot(row, row) for row in self.inverse)

    @property
    def squared_gain(self) -> Fraction:
        """Square of the noise of the vector, the sum of `squared_gains`."""
        return sum(self.squared_gains, Fraction(0))


@dataclass(frozen=True)
class SensorGeometry:
    """Single-axis sensors by what each measures of a vector: its axis, times its scale.

    Parameters
    ----------
    axes : tuple of tuple of Fraction, (N, 3)
        Rows of the measurement matrix H in body axes.

    Raises
    ------
    InputError
        If there are too few axes or too many, one is zero, or no three of them are independent; if one sensor is in no
        parity equation, so that nothing would tell its failure.

    Examples
    --------
    >>> HEXAD.equations[0]
    (-2, -2, 1, 3, 0, 0)
    """

    axes: tuple[Row, ...]

    def __post_init__(self) -> None:
        checks.count("the number of axes", len(self.axes), smallest=LEAST_AXES, largest=MOST_AXES)
        for number, axis in enumerate(self.axes):
            if not any(axis):
                raise InputError(f"axis {number} is zero; it measures nothing")
        if not self.triads:
            raise InputError("all axes lie in one plane; no triad of them measures a vector")
        for number in range(len(self.axes)):
            if not any(equation[number] for equation in self.equations):
                raise InputError(
                    f"axis {number} is in no parity equation, since the others lie in one plane; "
                    "no failure of it would be detected"
                )

    @property
    def count(self) -> int:
        """Number of sensors."""
        return len(self.axes)

    @cached_property
    def equations(self) -> tuple[tuple[int, ...], ...]:
        """The parity equations: integers without a common factor, the last that is not zero positive.

        Each is a combination of at most four measurements that is zero for every vector: a left null vector of H. Four
        axes in a plane are passed over; what holds among three of them comes with a fourth that is not in the plane.
        """
        vectors = [self._null_vector(four) for four in combinations(range(self.count), 4)]
        return tuple(dict.fromkeys(vector for vector in vectors if any(vector)))

    def _null_vector(self, four: tuple[int, ...]) -> tuple[int, ...]:
        rows = [self.axes[sensor] for sensor in four]
        minors = [(-1) ** k * _det(*(row for j, row in enumerate(rows) if j != k)) for k in range(4)]
        scale = math.lcm(*(minor.denominator for minor in minors))
        integers = [int(minor * scale) for minor in minors]
        divisor = math.gcd(*integers) or 1
        if next((value for value in reversed(integers) if value), 1) < 0:
            divisor = -divisor
        vector = [0] * self.count
        for sensor, value in zip(four, integers, strict=True):
            vector[sensor] = value // divisor
        return tuple(vector)

    @cached_property
    def triads(self) -> tuple[Triad, ...]:
        """All triads that measure a vector, those with the least noise first, then by the numbers of their sensors."""
        triads = []
        for three in combinations(range(self.count), 3):
            rows = [self.axes[sensor] for sensor in three]
            if det := _det(*rows):
                triads.append(Triad(three, det, _inverse(rows)))
        return tuple(sorted(triads, key=lambda triad: (triad.squared_gain, triad.sensors)))

    @cached_property
    def least_squares(self) -> tuple[Row, ...]:
        """The matrix (H'H)^-1 H' (3, N), from all measurements to the vector."""
        columns = tuple(zip(*self.axes, strict=True))
        inverse = _inverse([tuple(_dot(a, b) for b in columns) for a in columns])
        return tuple(tuple(_dot(row, axis) for axis in self.axes) for row in inverse)

    def without(self, removed: Sequence[int]) -> tuple[tuple[int, ...], ...]:
        """Return the parity equations that need none of some sensors."""
        return tuple(e for e in self.equations if not any(e[sensor] for sensor in removed))

    def undetected(self, removed: Sequence[int] = ()) -> tuple[int, ...]:
        """Return the sensors in no equation once others are removed."""
        left = self.without(removed)
        return tuple(
            sensor
            for sensor in range(self.count)
            if sensor not in removed and not any(equation[sensor] for equation in left)
        )

    def ambiguous(self, removed: Sequence[int] = ()) -> tuple[tuple[int, int], ...]:
        """Return the pairs of sensors whose failures look alike once others are removed: they share all equations."""
        left = self.without(removed)
        patterns = {
            sensor: tuple(bool(equation[sensor]) for equation in left)
            for sensor in range(self.count)
            if sensor not in removed
        }
        return tuple(pair for pair in combinations(patterns, 2) if patterns[pair[0]] == patterns[pair[1]])

    @cached_property
    def fail_operate(self) -> int:
        """How many failures, one after the other, are isolated whichever sensors they hit, a triad being left."""
        for failures in range(self.count):
            for removed in combinations(range(self.count), failures):
                if self.undetected(removed) or self.ambiguous(removed):
                    return failures
        return self.count

    @property
    def fail_safe(self) -> bool:
        """Whether one failure more than `fail_operate` is detected, whichever sensors it hits."""
        removals = combinations(range(self.count), self.fail_operate)
        return not any(self.undetected(removed) for removed in removals)

    @cached_property
    def parity_basis(self) -> tuple[tuple[int, ...], ...]:
        """Independent parity equations, N - 3 of them, which span the parity space."""
        basis: list[tuple[int, ...]] = []
        reduced: list[Row] = []
        for equation in self.equations:
            row = tuple(map(Fraction, equation))
            for other in reduced:
                pivot = next(k for k, value in enumerate(other) if value)
                row = tuple(a - row[pivot] / other[pivot] * b for a, b in zip(row, other, strict=True))
            if any(row):
                reduced.append(row)
                basis.append(equation)
        return tuple(basis)


#: Largest component of an axis, which is a unit vector but for what its numbers are rounded to.
_LARGEST = 2


def geometry(axes: Any) -> SensorGeometry:
    """Return a geometry of rows of numbers, texts such as "2/3" among them.

    Raises
    ------
    InputError
        If there is no list of rows of three numbers, or as `SensorGeometry` does.

    Examples
    --------
    >>> geometry([[1, 0, 0], [0, 1, 0], [0, 0, 1], ["1/3", "2/3", "2/3"]]).equations
    ((-1, -2, -2, 3),)
    """
    if not isinstance(axes, list | tuple):
        raise InputError("axes is no list; rows of three numbers are needed")
    return SensorGeometry(tuple(_row(number, row) for number, row in enumerate(axes)))


def _row(number: int, row: Any) -> Row:
    if not isinstance(row, list | tuple) or len(row) != 3 or any(isinstance(x, bool | list) for x in row):
        raise InputError(f"axis {number} is {row}; three numbers are needed")
    axis = tuple(checks.number(f"a component of axis {number}", component) for component in row)
    if max(map(abs, axis)) > _LARGEST:
        raise InputError(
            f"axis {number} has a component of {float(max(map(abs, axis))):g}; a unit vector is needed"
        )
    return axis


def _hexad() -> Iterator[Row]:
    """Yield the axes of two orthogonal triads, the second turned by 60 degrees about (1, 1, 1)."""
    third = Fraction(1, 3)
    for row in ((3, 0, 0), (0, 3, 0), (0, 0, 3), (2, 2, -1), (-1, 2, 2), (2, -1, 2)):
        yield tuple(third * value for value in row)


#: Six sensors on a cone: an orthogonal triad along body axes, and one turned by 60 degrees about (1, 1, 1).
HEXAD = SensorGeometry(tuple(_hexad()))
