"""Exact quantities are the values that a fixed-point program stores, before anything is rounded.

Every quantity is an exact sum of products of quantities before it, or one operation on them. A quantity that stays near
a constant is stored as its distance from that constant, which is small and so has a finer scale: 1 - x is stored as
-x, with the offset 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from strapgen.fixedpoint.intervals import Interval

Operand = str | Fraction
Monomial = tuple[str, ...]
Terms = dict[Monomial, Fraction]


@dataclass(frozen=True)
class InputElement:
    """An element of an input."""

    signal: str


@dataclass(frozen=True)
class Sum:
    """A sum of exact multiples of products of at most two stored quantities."""

    terms: tuple[tuple[Monomial, Fraction], ...]


@dataclass(frozen=True)
class ExactOperation:
    """An operation on quantities and constants that is no sum; quantities in it are stored whole, without offset.

    Its kinds are "divide", "sqrt", "maximum" and "select" (see `cases_of`); "computed", the value of a quantity as the
    code computes it, brought into the range of that one, so that as a number it has no error; and "nearest", the
    integer that the code computes as the nearest to a quantity times a dyadic factor.
    """

    kind: str
    arguments: tuple[Operand, ...]


Definition = InputElement | Sum | ExactOperation


@dataclass(frozen=True)
class ErrorPropagation:
    """The error of a function of quantities whose computed values were taken as exact."""

    slopes: tuple[tuple[str, Fraction | None], ...]  # bounds of the derivatives, None where there is none
    most: Fraction  # the largest difference of two values of the function

    def bound(self, errors: Mapping[str, Fraction]) -> Fraction:
        """Return the largest change of the function when the quantities change by so much."""
        total = Fraction(0)
        for name, slope in self.slopes:
            if errors[name]:
                total += self.most if slope is None else slope * errors[name]
        return min(total, self.most)


@dataclass(frozen=True)
class Quantity:
    """A quantity of a fixed-point program, exactly."""

    name: str
    definition: Definition  # the stored part: the quantity less its offset and the words beside it
    offset: Fraction  # the constant that is not stored
    range: Interval  # proved range of the stored part
    meaning: str = ""  # the comment where a named stage of the algorithm begins; "" elsewhere
    range_checked: bool = False  # whether the range holds because it is checked when the code runs
    #: Exact words, each with a power of two: the quantity is the sum of its stored part, its offset and these.
    exact_addends: tuple[tuple[Monomial, Fraction], ...] = ()
    #: Bound of the distance of the definition from the quantity: a truncated series, or a rounded irrational number.
    approximation_error: Fraction = Fraction(0)
    inherited_error: ErrorPropagation | None = None


@dataclass
class Quantities:
    """All quantities of a program in order, and which of them hold its results."""

    items: dict[str, Quantity] = field(default_factory=dict)
    #: For each output signal, and the transition, the quantity or constant that holds each element.
    results: dict[str, tuple[Operand, ...]] = field(default_factory=dict)

    def distance(self, name: str, number: Fraction) -> Fraction:
        """Return a bound of the distance of a quantity from a number."""
        quantity = self.items[name]
        shift = quantity.offset - number
        ends = (quantity.range.lowest + shift, quantity.range.highest + shift)
        sizes = (abs(c) * self.items[m[0]].range.magnitude for m, c in quantity.exact_addends)
        return max(map(abs, ends)) + sum(sizes, Fraction(0))

    def factors(self) -> set[str]:
        """Return the quantities that must be words: factors of products, exact parts beside others, and arguments."""
        names: set[str] = set()
        for quantity in self.items.values():
            names.update(monomial[0] for monomial, _ in quantity.exact_addends)
            match quantity.definition:
                case Sum(terms):
                    for monomial, coefficient in terms:
                        if len(monomial) == 2 or not is_power_of_two(coefficient):
                            names.update(monomial)
                case ExactOperation("computed" | "nearest", (str(argument), *_)):
                    names.add(argument)
        return names


def is_power_of_two(value: Fraction) -> bool:
    """Tell whether a number is a power of two or its negative, so that multiplying by it is a shift."""
    top, bottom = abs(value.numerator), value.denominator
    return top & (top - 1) == 0 and bottom & (bottom - 1) == 0


def exponent(value: Fraction) -> int:
    """Return the exponent of a power of two or its negative.

    >>> exponent(Fraction(-1, 8))
    -3
    """
    return abs(value.numerator).bit_length() - value.denominator.bit_length()


def is_dyadic(value: Fraction) -> bool:
    """Tell whether a number has a finite binary expansion."""
    return value.denominator & (value.denominator - 1) == 0


def used_by(quantity: Quantity) -> list[str]:
    """Return the names that a quantity is made from."""
    used: list[Operand] = [monomial[0] for monomial, _ in quantity.exact_addends]
    if quantity.inherited_error is not None:
        used += [name for name, _ in quantity.inherited_error.slopes]
    match quantity.definition:
        case Sum(terms):
            used += [name for monomial, _ in terms for name in monomial]
        case ExactOperation(_, arguments):
            used += arguments
    return [name for name in used if isinstance(name, str)]


def combined(left: Terms, right: Terms, factor: Fraction) -> Terms:
    """Return a sum plus a multiple of another."""
    total = dict(left)
    for monomial, coefficient in right.items():
        value = total.get(monomial, Fraction(0)) + factor * coefficient
        if value:
            total[monomial] = value
        else:
            total.pop(monomial, None)
    return total


def scaled(terms: Terms, factor: Fraction) -> Terms:
    """Return a multiple of a sum."""
    return {monomial: factor * c for monomial, c in terms.items()} if factor else {}
