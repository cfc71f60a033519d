"""Geometry of redundant sensors in exact numbers: parity equations, triads with noise, detectable failures."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property, reduce
from itertools import combinations
from operator import add
from typing import Annotated, Any, NamedTuple

from strapgen.catalogue import coefficients, toml_models
from strapgen.catalogue.coefficients import Number
from strapgen.catalogue.toml_models import Key
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

#: Sensors of a geometry: fewer have no parity equation, more have more equations than a table can hold.
LEAST_AXES, MOST_AXES = 4, 10

Row = tuple[Number, ...]
#: Elements of a field: fractions, or algebraic numbers of SymPy.
_Elements = tuple[Any, ...]


class _Field(NamedTuple):
    """Rows of numbers in their field, where sums, products and quotients are exact, and the ways there and back."""

    rows: tuple[_Elements, ...]
    #: Returns the element that a number is; None if it is not in the field
    into: Callable[[Number], Any]
    #: Returns the number that an element is, always in one form
    back: Callable[[Any], Number]


def _in_field(rows: Sequence[Row]) -> _Field:
    """Return rows in the field of their numbers: fractions as they are."""
    if all(isinstance(value, Fraction) for row in rows for value in row):
        return _Field(tuple(rows), lambda x: x if isinstance(x, Fraction) else None, lambda x: x)
    import sympy as sp
    from sympy.polys.constructor import construct_domain
    from sympy.polys.polyerrors import CoercionFailed

    numbers = [sp.sympify(value) for row in rows for value in row]
    if coefficients.degree_bound(numbers) > coefficients.MOST_DEGREE:
        raise InputError("the axes hold over three different square roots; at most three are allowed")
    domain, elements = construct_domain(numbers, extension=True)
    iterator = iter(elements)

    def into(number: Number) -> Any:
        try:
            return domain.from_sympy(sp.sympify(number))
        except CoercionFailed:
            return None

    @cache
    def back(element: Any) -> Number:
        value = sp.expand(domain.to_sympy(element))
        return Fraction(value.p, value.q) if value.is_Rational else value

    return _Field(tuple(tuple(next(iterator) for _ in row) for row in rows), into, back)


def _cross(a: _Elements, b: _Elements) -> _Elements:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return reduce(add, (x * y for x, y in zip(a, b, strict=True)))


def _det(a: _Elements, b: _Elements, c: _Elements) -> Any:
    return _dot(_cross(a, b), c)


def _inverse(rows: Sequence[_Elements]) -> tuple[_Elements, ...]:
    """Return the inverse of a regular 3 x 3 matrix of rows."""
    a, b, c = rows
    det = _det(a, b, c)
    columns = (_cross(b, c), _cross(c, a), _cross(a, b))
    return tuple(tuple(column[k] / det for column in columns) for k in range(3))


@dataclass(frozen=True)
class Triad:
    """Three sensors and the rate that they measure."""

    #: Their numbers
    sensors: tuple[int, ...]
    #: Of their axes
    determinant: Number
    #: From the three measurements to components along x, y and z
    inverse: tuple[Row, ...]
    #: Squares of the noise in x, y and z for equal, independent noise of 1 on all sensors
    squared_gains: Row

    @property
    def squared_gain(self) -> Any:
        """Square of the noise of the vector, the sum of `squared_gains`."""
        return reduce(add, self.squared_gains)


@dataclass(frozen=True)
class SensorGeometry:
    """Single-axis sensors, each given by its axis times its scale.

    >>> HEXAD.equations[0]
    (-2, -2, 1, 3, 0, 0)
    """

    #: Rows of the measurement matrix H in body axes, as `coefficients.number` returns numbers
    axes: tuple[Row, ...]

    def __post_init__(self) -> None:
        checks.count("the number of axes", len(self.axes), smallest=LEAST_AXES, largest=MOST_AXES)
        for number, axis in enumerate(self.axes):
            if not any(axis):
                raise InputError(f"axis {number} is zero; it measures nothing")
        if not self.triads:
            raise InputError("all axes lie in one plane; no triad of them measures a vector")

    @property
    def count(self) -> int:
        """Number of sensors."""
        return len(self.axes)

    @cached_property
    def _field(self) -> _Field:
        return _in_field(self.axes)

    @cached_property
    def lengths(self) -> Row:
        """The lengths of the axes."""
        return tuple(coefficients.root(self._field.back(_dot(axis, axis))) for axis in self._field.rows)

    @cached_property
    def equations(self) -> tuple[tuple[Any, ...], ...]:
        """The parity equations: integers without a common factor, the last that is not zero positive.

        Where axes are irrational an equation is divided by its last number first; what is rational in all others then
        has no common factor.

        Each is a combination of at most four measurements that is zero for every vector: a left null vector of H. Four
        axes in a plane are passed over; what holds among three of them comes with a fourth that is not in the plane.
        """
        vectors = [self._null_vector(four) for four in combinations(range(self.count), 4)]
        return tuple(dict.fromkeys(vector for vector in vectors if any(vector)))

    def _null_vector(self, four: tuple[int, ...]) -> tuple[Any, ...]:
        rows = [self._field.rows[sensor] for sensor in four]
        minors = [_det(*(row for j, row in enumerate(rows) if j != k)) for k in range(4)]
        signed = [-minor if k % 2 else minor for k, minor in enumerate(minors)]
        last = next((value for value in reversed(signed) if value), None)
        vector: list[Any] = [0] * self.count
        if last is not None:
            numbers = _without_common_factor([self._field.back(value / last) for value in signed])
            for sensor, value in zip(four, numbers, strict=True):
                vector[sensor] = value
        return tuple(vector)

    @cached_property
    def triads(self) -> tuple[Triad, ...]:
        """All triads that measure a vector, those with the least noise first, then by the numbers of their sensors."""
        triads = []
        for three in combinations(range(self.count), 3):
            rows = [self._field.rows[sensor] for sensor in three]
            if det := _det(*rows):
                inverse = _inverse(rows)
                gains = self._back([[_dot(row, row) for row in inverse]])[0]
                triads.append(Triad(three, self._field.back(det), self._back(inverse), gains))
        # Equal gains have one form, so that rounding does not order them.
        return tuple(sorted(triads, key=lambda triad: (_sortable(triad.squared_gain), triad.sensors)))

    @cached_property
    def least_squares(self) -> tuple[Row, ...]:
        """The matrix (H'H)^-1 H' (3, N), from all measurements to the vector."""
        axes = self._field.rows
        columns = tuple(zip(*axes, strict=True))
        inverse = _inverse([tuple(_dot(a, b) for b in columns) for a in columns])
        return self._back([[_dot(row, axis) for axis in axes] for row in inverse])

    def _back(self, rows: Sequence[Sequence[Any]]) -> tuple[Row, ...]:
        """Return elements of the field as numbers."""
        return tuple(tuple(map(self._field.back, row)) for row in rows)

    def without(self, removed: Sequence[int]) -> tuple[tuple[int, ...], ...]:
        """Return the parity equations that need none of some sensors."""
        return tuple(e for e in self.equations if not any(e[sensor] for sensor in removed))

    def undetected(self, removed: Sequence[int] = ()) -> tuple[int, ...]:
        """Return the sensors in no equation once others are removed: every vector needs them.

        >>> geometry([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1]]).undetected()
        (0, 1)
        """
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
    def parity_basis(self) -> tuple[tuple[Any, ...], ...]:
        """Independent parity equations, N - 3 of them, which span the parity space."""
        basis: list[tuple[Any, ...]] = []
        reduced: list[_Elements] = []
        for equation in self.equations:
            row = tuple(map(self._field.into, (Fraction(x) if isinstance(x, int) else x for x in equation)))
            for other in reduced:
                pivot = next(k for k, value in enumerate(other) if value)
                row = tuple(a - row[pivot] / other[pivot] * b for a, b in zip(row, other, strict=True))
            if any(row):
                reduced.append(row)
                basis.append(equation)
        return tuple(basis)


def _sortable(value: Number) -> Any:
    return value if isinstance(value, Fraction) else float(value)


def _without_common_factor(vector: list[Number]) -> list[Any]:
    """Return numbers times a rational one, so that the rational factors of their terms are coprime integers."""
    factors = [factor for number in vector for factor in _rational_factors(number)]
    divisor = math.gcd(*(factor.numerator for factor in factors))
    scale = Fraction(math.lcm(*(factor.denominator for factor in factors)), divisor)
    return [int(x * scale) if isinstance(x, Fraction) else (x * scale).expand() for x in vector]


def _rational_factors(number: Number) -> list[Fraction]:
    """Return the rational factor of every term of a number."""
    if isinstance(number, Fraction):
        return [number]
    factors = [term.as_coeff_Mul()[0] for term in number.as_ordered_terms()]
    return [Fraction(factor.p, factor.q) for factor in factors]


#: Axes as a file states them.
Axes = Annotated[
    tuple[Annotated[tuple[Number, Number, Number], Key(least=-1000, most=1000)], ...],
    Key("What each sensor measures of a vector, in body axes", "1", least=LEAST_AXES, most=MOST_AXES),
]


def geometry(axes: Any) -> SensorGeometry:
    """Return a geometry of rows of exact numbers, texts such as "2/3" or "sqrt(3)/2" among them.

    A row is divided by its length where that is in the field of all their numbers; else it stands as it is.

    >>> geometry([[1, 0, 0], [0, 1, 0], [0, 0, 1], ["1/3", "2/3", "2/3"]]).equations
    ((-1, -2, -2, 3),)
    >>> geometry([[1, 0, 0], [0, 1, 0], [0, 0, 2], ["sqrt(3)/2", "1/4", "sqrt(3)/4"]]).equations
    ((-2*sqrt(3), -1, -sqrt(3), 4),)
    """
    return of_rows(toml_models.parse(Axes, axes, "axes"))


def of_rows(axes: Sequence[Row]) -> SensorGeometry:
    """Return a geometry of rows of exact numbers, see `geometry`."""
    rows = list(axes)
    stated = SensorGeometry(tuple(rows))
    field = _in_field(rows)
    for number, length in enumerate(stated.lengths):
        inside = field.into(length)
        if inside is not None:
            rows[number] = tuple(field.back(value / inside) for value in field.rows[number])
    return SensorGeometry(tuple(rows))


def _hexad() -> Iterator[Row]:
    """Yield the axes of two orthogonal triads, the second turned by 60 degrees about (1, 1, 1)."""
    third = Fraction(1, 3)
    for row in ((3, 0, 0), (0, 3, 0), (0, 0, 3), (2, 2, -1), (-1, 2, 2), (2, -1, 2)):
        yield tuple(third * value for value in row)


#: Six sensors on a cone: an orthogonal triad along body axes, and one turned by 60 degrees about (1, 1, 1).
HEXAD = SensorGeometry(tuple(_hexad()))
