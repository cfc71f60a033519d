"""Exact quantities are the values that a fixed-point program stores, before anything is rounded.

Every quantity is an exact sum of products of quantities before it, or one operation on them. A quantity that stays near
a constant is stored as its distance from that constant, which is small and so has a finer scale: 1 - x is stored as
-x, with the offset 1.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction

from strapgen.fixedpoint.intervals import GRID, Interval
from strapgen.ir.integer_program import Term, Value

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
    """Return whether a number is a power of two or its negative, so that multiplying by it is a shift."""
    top, bottom = abs(value.numerator), value.denominator
    return top & (top - 1) == 0 and bottom & (bottom - 1) == 0


def exponent(value: Fraction) -> int:
    """Return the exponent of a power of two or its negative.

    >>> exponent(Fraction(-1, 8))
    -3
    """
    return abs(value.numerator).bit_length() - value.denominator.bit_length()


def is_dyadic(value: Fraction) -> bool:
    """Return whether a number has a finite binary expansion."""
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


@dataclass(frozen=True)
class Placed:
    """A term that is not shifted yet."""

    term: Term
    place: int  # its fraction bits
    error: Fraction  # bound of its distance from the exact term


@dataclass(frozen=True)
class Aligned:
    """Terms at one place."""

    terms: tuple[Term, ...]
    peak: int  # bound of the magnitude of their partial sums
    error: Fraction  # bound of the error of their sum, with what shifts lose

    def fits(self, word: int, values: Mapping[str, Value], added: int = 0) -> bool:
        """Return whether every term, and every partial sum with so much added, fits into a wide number."""
        return self.peak + added <= largest_wide(word) and _terms_fit(self.terms, word, values)


def largest_wide(word: int) -> int:
    """Return the largest integer that a wide number holds."""
    return (1 << (2 * word - 1)) - 1


def nearest(value: Fraction) -> int:
    """Return the nearest integer, halves up."""
    return math.floor(value + Fraction(1, 2))


def up(value: Fraction) -> Fraction:
    """Round a bound up to the grid of the intervals, so that numbers stay short."""
    return Fraction(-((-value.numerator << GRID) // value.denominator), 1 << GRID)


def in_units(bound: Fraction) -> int:
    """Return a bound in units of the grid of the intervals, on which bounds are."""
    return -((-bound.numerator << GRID) // bound.denominator)


def binary(integer: int, fraction: int) -> Fraction:
    """Return an integer with so many fraction bits as a number.

    >>> binary(3, 2), binary(3, -1)
    (Fraction(3, 4), Fraction(6, 1))
    """
    return Fraction(integer, 1 << fraction) if fraction >= 0 else Fraction(integer << -fraction)


def aligned(terms: Iterable[Placed], place: int, word: int, values: Mapping[str, Value]) -> Aligned:
    """Return terms shifted to one place: the fraction bits of their sum."""
    shifted: list[Term] = []
    peak, error = 0, Fraction(0)
    inherited = cut = 0  # errors of terms in units of the grid, and terms that are shifted down
    for item in terms:
        term, wrong = item.term, item.error
        # A shift by all bits of a wide number but one leaves 0 or -1, as every longer one would.
        shift = max(place - item.place, 1 - 2 * word)
        if not term.names and shift < 0:  # a constant: rounded here
            exact = term.factor * Fraction(2) ** (place - item.place)
            integer = nearest(exact)
            error += wrong + abs(integer - exact) / Fraction(2) ** place
            if not integer:
                continue
            known = term.coefficient
            coefficient = known and replace(known, fraction=known.fraction + shift)
            shifted.append(Term((), integer, coefficient=coefficient))
        else:
            shifted.append(Term(term.names, term.factor, shift, term.coefficient))
            inherited += in_units(wrong)
            cut += shift < 0
        size = _bound(shifted[-1], values)
        peak += (size >> -shift) + 1 if shift < 0 and term.names else size
    if place <= GRID:
        inherited += cut << (GRID - place)
    else:
        error += binary(cut, place)
    on_grid = Fraction(inherited, 1 << GRID)
    return Aligned(tuple(shifted), peak, on_grid + up(error) if error else on_grid)


def _terms_fit(terms: Iterable[Term], word: int, values: Mapping[str, Value]) -> bool:
    """Return whether every term fits into a wide number."""
    room = largest_wide(word)
    return all(_bound(term, values) <= room for term in terms)


def _bound(term: Term, values: Mapping[str, Value]) -> int:
    """Return the largest magnitude of an integer term, before it is shifted down."""
    size = abs(term.factor)
    for name in term.names:
        size *= values[name].magnitude
    return size << term.shift if term.shift > 0 else size
