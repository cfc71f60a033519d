"""Exact quantities: what a fixed-point program stores, before anything is rounded.

Every quantity is an exact sum of products of quantities before it, or one operation on them. A quantity that stays near
a constant is kept as its distance from it, which is small and so gets a finer scale: 1 - x as -x, the 1 remembered.
"""

from __future__ import annotations

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
    """A sum of exact multiples of products of at most two stored quantities; without a constant, unless alone."""

    terms: tuple[tuple[Monomial, Fraction], ...]


@dataclass(frozen=True)
class Quotient:
    """A quotient of whole quantities."""

    numerator: Operand
    denominator: str


@dataclass(frozen=True)
class SquareRoot:
    """A square root."""

    argument: str


@dataclass(frozen=True)
class Maximum:
    """The largest of several quantities."""

    arguments: tuple[Operand, ...]


@dataclass(frozen=True)
class Selection:
    """The value of the first case whose left side is at least its right side, or another one."""

    cases: tuple[tuple[Operand, Operand, Operand], ...]
    otherwise: Operand


@dataclass(frozen=True)
class Computed:
    """What the code computes for another quantity, brought into that one's range: it has no error of its own."""

    argument: str


@dataclass(frozen=True)
class NearestInteger:
    """The integer that the code finds nearest to a multiple of a quantity; the factor is dyadic."""

    argument: str
    factor: Fraction


Definition = InputElement | Sum | Quotient | SquareRoot | Maximum | Selection | Computed | NearestInteger


@dataclass(frozen=True)
class ErrorPropagation:
    """The error of a function of quantities whose computed values were taken as exact.

    Parameters
    ----------
    slopes : tuple
        Each of these quantities with a bound of the derivative by it, None where the derivative has none.
    most : Fraction
        The largest difference of two values of the function.
    """

    slopes: tuple[tuple[str, Fraction | None], ...]
    most: Fraction


@dataclass(frozen=True)
class Quantity:
    """A quantity of a fixed-point program, exactly.

    Parameters
    ----------
    name : str
    definition : Definition
        What is stored: the quantity less its offset.
    offset : Fraction
        Constant that is not stored.
    range : Interval
        Proved range of what is stored.
    meaning : str
        Said where a named stage of the algorithm begins.
    guarded : bool
        Whether the range holds because it is checked when the code runs.
    beside : tuple
        Exact words that are not stored in it either, each with a power of two: the quantity is what is stored, the
        offset and these.
    inexact : Fraction
        Bound of how far the definition is from the quantity: what a series leaves out, or a rational number for an
        irrational one.
    follows : ErrorPropagation or None
        How the errors of quantities go on whose computed values were taken as exact on the way.
    """

    name: str
    definition: Definition
    offset: Fraction
    range: Interval
    meaning: str = ""
    guarded: bool = False
    beside: tuple[tuple[Monomial, Fraction], ...] = ()
    inexact: Fraction = Fraction(0)
    follows: ErrorPropagation | None = None


@dataclass
class Quantities:
    """All quantities of a program in order, and which of them hold its results.

    Parameters
    ----------
    items : dict of str to Quantity
    results : dict of str to tuple
        For each output signal, and the transition, the quantity or constant that holds each element.
    """

    items: dict[str, Quantity] = field(default_factory=dict)
    results: dict[str, tuple[Operand, ...]] = field(default_factory=dict)

    def distance(self, name: str) -> Fraction:
        """Return a bound of how far a quantity can be from its offset."""
        quantity = self.items[name]
        beside = (abs(c) * self.items[m[0]].range.magnitude for m, c in quantity.beside)
        return quantity.range.magnitude + sum(beside, Fraction(0))

    def factors(self) -> set[str]:
        """Return the quantities that are multiplied by something that is no power of two."""
        return {
            name
            for quantity in self.items.values()
            if isinstance(quantity.definition, Sum)
            for monomial, coefficient in quantity.definition.terms
            if len(monomial) == 2 or not is_power_of_two(coefficient)
            for name in monomial
        } | {
            name
            for quantity in self.items.values()
            for name in (
                *(m[0] for m, _ in quantity.beside),
                *(
                    [quantity.definition.argument]
                    if isinstance(quantity.definition, Computed | NearestInteger)
                    else []
                ),
            )
        }


def is_power_of_two(value: Fraction) -> bool:
    """Tell whether a number is a power of two or its negative, so that multiplying by it is a shift."""
    top, bottom = abs(value.numerator), value.denominator
    return top & (top - 1) == 0 and bottom & (bottom - 1) == 0


def exponent(value: Fraction) -> int:
    """Return the exponent of a power of two or its negative.

    Examples
    --------
    >>> exponent(Fraction(-1, 8))
    -3
    """
    return abs(value.numerator).bit_length() - value.denominator.bit_length()


def is_dyadic(value: Fraction) -> bool:
    """Tell whether a number has a finite binary expansion."""
    return value.denominator & (value.denominator - 1) == 0


def used_by(quantity: Quantity) -> list[str]:
    """Return the quantities that another rests on."""
    definition = quantity.definition
    used: list[Operand] = [m[0] for m, _ in quantity.beside]
    if quantity.follows is not None:
        used += [name for name, _ in quantity.follows.slopes]
    if isinstance(definition, Sum):
        used += [name for monomial, _ in definition.terms for name in monomial]
    elif isinstance(definition, Quotient):
        used += [definition.numerator, definition.denominator]
    elif isinstance(definition, SquareRoot | Computed | NearestInteger):
        used.append(definition.argument)
    elif isinstance(definition, Maximum):
        used += definition.arguments
    elif isinstance(definition, Selection):
        used += [operand for case in definition.cases for operand in case] + [definition.otherwise]
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
