"""Rounds the coefficients of a filter together, so that the exact sums of coefficients also hold after rounding.

A filter is a sum of many samples, each times a coefficient. What it makes of a constant rate, and of one that grows
evenly, is the sum of its coefficients and their first moment over the samples: often nothing, or a short binary
fraction. Coefficients that are rounded one by one miss these by a few units, the same way in every step.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from itertools import combinations

from strapgen.fixedpoint.quantities import InputElement, Monomial, Quantities, Sum, is_power_of_two, nearest
from strapgen.ir.formats import finest
from strapgen.ir.signals import Signal

#: Fewest coefficients of a filter that are rounded.
_FEWEST = 3
#: What a missed moment costs, in the same error of a coefficient.
_MOMENT = 1024

#: A coefficient as a word, and its fraction bits.
Factor = tuple[int, int]
#: The sum of the weights of the samples in a quantity, and of the weights times the numbers of their samples.
Moments = tuple[Fraction, Fraction]


def nearest_word(value: Fraction, word: int) -> Factor:
    """Return the nearest word to a number that is no power of two, and its fraction bits.

    >>> nearest_word(Fraction(3, 8), 16), nearest_word(Fraction(1, 3), 8)
    ((3, 3), (85, 8))
    """
    bits = longest(value, word)
    return _short(nearest(value * Fraction(2) ** bits), bits)


def filter_words(
    quantities: Quantities,
    inputs: Sequence[Signal],
    definition: Sum,
    word: int,
    fractions: Mapping[str, int] | None = None,
) -> Mapping[Monomial, Factor]:
    """Return the words for the coefficients of a sum that filters samples; an empty mapping for any other sum.

    With the fraction bits of the samples, all products have the same.
    """
    linear = [(monomial, c) for monomial, c in definition.terms if len(monomial) == 1]
    if sum(not is_power_of_two(c) for _, c in linear) < _FEWEST:
        return {}
    samples = {
        element: (signal.name, number // 3, number % 3)
        for signal in inputs
        if len(signal.shape) == 2 and signal.shape[1] == 3 and not signal.constraint
        for number, element in enumerate(signal.elements)
    }
    shares = [_weights(quantities, samples, monomial[0]) for monomial, _ in linear]
    axes = {place[::2] for share in shares for place in share}
    if len(axes) != 1 or not all(shares):
        return {}
    moments = tuple(
        (
            sum(share.values(), Fraction(0)),
            sum((weight * number for (_, number, _), weight in share.items()), Fraction(0)),
        )
        for share in shares
    )
    most: tuple[int, ...] = ()
    if fractions is not None:
        places = [longest(c, word) + fractions[monomial[0]] for monomial, c in linear]
        top = min(p for p, (_, c) in zip(places, linear, strict=True) if not is_power_of_two(c))
        most = tuple(top - fractions[monomial[0]] for monomial, _ in linear)
    words = rounded_together(tuple(c for _, c in linear), moments, word, most)
    if most:  # the zeros at the end of a coefficient stay
        words = tuple(
            factor if is_power_of_two(c) else (factor[0] << (bits - factor[1]), bits)
            for factor, bits, (_, c) in zip(words, most, linear, strict=True)
        )
    return {monomial: one for (monomial, c), one in zip(linear, words, strict=True) if not is_power_of_two(c)}


def _weights(
    quantities: Quantities, places: Mapping[str, tuple[str, int, int]], name: str
) -> dict[tuple[str, int, int], Fraction]:
    """Return the weights of the samples in a quantity that is one, or an exact sum of some; empty for any other."""
    quantity = quantities.items[name]
    if isinstance(quantity.definition, InputElement):
        return {places[name]: Fraction(1)} if name in places else {}
    if not isinstance(quantity.definition, Sum) or quantity.offset or quantity.exact_addends:
        return {}
    terms = quantity.definition.terms
    if any(len(m) != 1 or m[0] not in places or not is_power_of_two(c) for m, c in terms):
        return {}
    return {places[monomial[0]]: c for monomial, c in terms}


@lru_cache(maxsize=256)
def rounded_together(
    coefficients: tuple[Fraction, ...], moments: tuple[Moments, ...], word: int, most: tuple[int, ...] = ()
) -> tuple[Factor, ...]:
    """Return coefficients as words whose sums with the moments are exact, or as near as their units allow.

    Powers of two are exact. Two of the other coefficients take up the rounding errors of all: those with which the
    errors are smallest. `most` are the fraction bits of each at most.

    >>> thirds = (Fraction(-1, 3), Fraction(2, 3), Fraction(-1, 3))
    >>> rounded_together(thirds, tuple((Fraction(1), Fraction(k)) for k in range(3)), 8)
    ((-85, 8), (85, 7), (-85, 8))
    """
    filter_ = _Filter(coefficients, moments, word, most)
    return min(filter_.candidates(), key=filter_.cost)


@dataclass(frozen=True)
class _Filter:
    """The coefficients of a filter, each with the moments of the quantity that it multiplies."""

    coefficients: tuple[Fraction, ...]
    moments: tuple[Moments, ...]
    word: int
    most: tuple[int, ...] = ()

    def candidates(self) -> Iterator[tuple[Factor, ...]]:
        """Yield the coefficients rounded one by one, and with each two of them changed."""
        places = [longest(c, self.word) for c in self.coefficients]
        if self.most:
            places = [min(pair) for pair in zip(places, self.most, strict=True)]
        yield tuple(_short(self._integer(k, place), place) for k, place in enumerate(places))
        free = [k for k, c in enumerate(self.coefficients) if not is_power_of_two(c)]
        for pair in combinations(free, 2):
            common = min(places[k] for k in pair)
            bits = [
                place if is_power_of_two(c) else min(place, common)
                for c, place in zip(self.coefficients, places, strict=True)
            ]
            integers = [self._integer(k, place) for k, place in enumerate(bits)]
            for k, change in zip(pair, self._changes(integers, bits, pair), strict=True):
                integers[k] += change
            if all(abs(integers[k]) < 1 << (self.word - 1) for k in pair):
                yield tuple(_short(integer, place) for integer, place in zip(integers, bits, strict=True))

    def cost(self, factors: Sequence[Factor]) -> Fraction:
        """Return the sum of the errors of the coefficients, and more for moments that are missed."""
        errors = [
            Fraction(integer) / Fraction(2) ** place - c
            for (integer, place), c in zip(factors, self.coefficients, strict=True)
        ]
        total = sum(map(abs, errors), Fraction(0))
        for row in zip(*self.moments, strict=True):
            missed = sum((m * error for m, error in zip(row, errors, strict=True)), Fraction(0))
            total += _MOMENT * abs(missed) / max(1, *map(abs, row))
        return total

    def _integer(self, k: int, place: int) -> int:
        return nearest(self.coefficients[k] * Fraction(2) ** place)

    def _changes(
        self, integers: Sequence[int], bits: Sequence[int], pair: tuple[int, int]
    ) -> tuple[int, int]:
        """Return the changes of two coefficients, in units, that make the moments right."""
        unit = Fraction(2) ** bits[pair[0]]
        rows: list[tuple[int, int]] = []
        missing: list[int] = []
        for row in zip(*self.moments, strict=True):
            off = sum(
                (
                    m * (c - integer / Fraction(2) ** place)
                    for m, c, integer, place in zip(row, self.coefficients, integers, bits, strict=True)
                ),
                Fraction(0),
            )
            rows.append((int(row[pair[0]]), int(row[pair[1]])))
            missing.append(nearest(off * unit))
        (a, b), (c, d) = rows
        determinant = a * d - b * c
        if determinant:
            first, second = missing[0] * d - b * missing[1], a * missing[1] - missing[0] * c
            return nearest(Fraction(first, determinant)), nearest(Fraction(second, determinant))
        return _shortest(a, b, missing[0]) if a or b else _shortest(c, d, missing[1])


def _shortest(a: int, b: int, total: int) -> tuple[int, int]:
    """Return small whole x, y for which a x + b y is the multiple of their greatest divisor nearest to a total."""
    divisor = math.gcd(a, b)
    if not divisor:
        return 0, 0
    p, q = a // divisor, b // divisor
    goal = nearest(Fraction(total, divisor))
    x = goal * pow(p, -1, abs(q)) if abs(q) > 1 else 0
    y = (goal - p * x) // q if q else 0
    if not q:
        x = goal * p
    steps = nearest(Fraction(q * x - p * y, p * p + q * q))
    return x - q * steps, y + p * steps


def longest(value: Fraction, word: int) -> int:
    """Return the most fraction bits with which a word holds a coefficient."""
    return finest(abs(value) * (1 + Fraction(1, 1 << word)), word)


def _short(integer: int, bits: int) -> Factor:
    """Return an integer without the zeros at its end, and its fraction bits."""
    while integer and integer % 2 == 0:
        integer, bits = integer // 2, bits - 1
    return integer, bits
