"""Aligns the terms of sums as integers of one scale, and bounds their partial sums and the bits that shifts drop."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

from strapgen.fixedpoint.intervals import GRID
from strapgen.ir.integer_program import Term, Value


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
        """Tell whether every term, and every partial sum with so much added, fits into a wide number."""
        return self.peak + added <= largest_wide(word) and terms_fit(self.terms, word, values)


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


def terms_fit(terms: Iterable[Term], word: int, values: Mapping[str, Value]) -> bool:
    """Tell whether every term fits into a wide number."""
    room = largest_wide(word)
    return all(_bound(term, values) <= room for term in terms)


def _bound(term: Term, values: Mapping[str, Value]) -> int:
    """Return the largest magnitude of an integer term, before it is shifted down."""
    size = abs(term.factor)
    for name in term.names:
        size *= values[name].magnitude
    return size << term.shift if term.shift > 0 else size
