"""Proves ranges of sums of products by interval arithmetic, by expansion in the inputs, and by splitting their box."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from strapgen.fixedpoint.intervals import GRID, Interval
from strapgen.fixedpoint.quantities import InputElement, Monomial, Quantity, Sum, Terms, combined

#: Degree up to which a quantity is expanded in the inputs for its range, and terms that this may take.
_DEGREE, _MOST_TERMS = 2, 60
#: Boxes that a cut of the inputs' box may take for one quantity.
_MOST_BOXES = 128


#: Products, each with its coefficient.
SumOfTerms = Iterable[tuple[Monomial, Fraction]]


class Ranges:
    """Proves the ranges of quantities one after another; the caller adds each to `items` after its range is proved."""

    def __init__(self, items: dict[str, Quantity], box: Mapping[str, Interval]) -> None:
        self.items, self.box = items, dict(box)
        self.expanded: dict[str, Terms | None] = {name: {(name,): Fraction(1)} for name in box}
        # What is known of the items so far: the inputs of each, and whether all are inputs or sums.
        self._inputs: dict[str, frozenset[str]] = {name: frozenset((name,)) for name in box}
        self._looked_at, self._sums_alone = 0, True

    def of_sum(self, name: str, terms: Terms, seen: float) -> Interval:
        """Return the range of a sum and note its expansion by name; `seen` is its largest magnitude on samples."""
        self.expanded[name] = expansion = self.expansion(terms)
        enclosure = self.enclosure(terms.items())
        if expansion is not None:
            enclosure = enclosure.meet(self.enclosure(expansion.items(), self.box))
        return self.cut(Sum(tuple(terms.items())), enclosure, seen)

    def expansion(self, terms: Terms) -> Terms | None:
        """Return a sum as a polynomial of the inputs; None if that has too high a degree or too many terms."""
        total: Terms = {}
        for monomial, coefficient in terms.items():
            product: Terms = {(): coefficient}
            for name in monomial:
                factor = self.expanded.get(name)
                if factor is None:
                    return None
                grown: Terms = {}
                for one, a in product.items():
                    for other, b in factor.items():
                        key = tuple(sorted(one + other))
                        if len(key) > _DEGREE:
                            return None
                        grown[key] = grown.get(key, Fraction(0)) + a * b
                product = grown
            total = combined(total, product, Fraction(1))
            if len(total) > _MOST_TERMS:
                return None
        return total

    def enclosure(self, terms: SumOfTerms, box: Mapping[str, Interval] | None = None) -> Interval:
        """Return the interval of a sum from the ranges of the quantities, or from intervals by name."""
        low = high = 0
        for monomial, coefficient in terms:
            ranges = [self.items[name].range if box is None else box[name] for name in monomial]
            if not ranges:
                part = Interval.of(coefficient)
            elif len(ranges) == 1:
                part = ranges[0].scale(coefficient)
            elif monomial[0] == monomial[1]:
                part = ranges[0].square().scale(coefficient)
            else:
                product = ranges[0] * ranges[1]
                for one, other in (monomial, monomial[::-1]) if box is None else ():
                    square = self._with_square(one, other)
                    product = product if square is None else product.meet(square)
                part = product.scale(coefficient)
            low, high = low + part.low, high + part.high
        return Interval(low, high)

    def _with_square(self, one: str, other: str) -> Interval | None:
        """Return the interval of a product whose first factor is a multiple of the second, by a square."""
        definition = self.items[one].definition
        if (
            not isinstance(definition, Sum)
            or len(definition.terms) != 1
            or self.items[one].approximation_error
        ):
            return None
        ((monomial, coefficient),) = definition.terms
        if len(monomial) != 2 or other not in monomial:
            return None
        rest = monomial[1] if monomial[0] == other else monomial[0]
        return (self.items[other].range.square() * self.items[rest].range).scale(coefficient)

    def cut(self, definition: Sum, enclosure: Interval, seen: float) -> Interval:
        """Return the range of a sum after the box of the inputs is cut until no bit is lost, or the boxes are too many.

        `seen` is the largest magnitude on samples: it tells whether a bit may be gained, and proves nothing.
        """
        bits, lost = math.frexp(seen * (1 + 1e-9))[1], math.frexp(float(enclosure.magnitude))[1]
        if lost <= bits or not self._are_sums_alone():
            return enclosure
        goal = Interval.of(Fraction(2) ** bits).low
        inputs = self._inputs_of(definition)
        names = [n for n in self.box if n in inputs]
        if not names or 2 ** len(names) > _MOST_BOXES:  # not even a cut of every side in two
            return enclosure
        needed = self._needed(definition)
        parts = _Parts(self.box, [q for name, q in self.items.items() if name in needed], definition)
        pending, proved, spent = [parts.whole()], Interval(0, 0), 0
        while pending:
            part = pending.pop()
            inside = parts.evaluate(part)
            if max(abs(inside.low), abs(inside.high)) <= goal:
                proved = proved.join(inside)
                continue
            spent += 2
            if spent > _MOST_BOXES:
                return enclosure
            pending += parts.halves(part, parts.widest(part, names))
        return enclosure.meet(proved)

    def _are_sums_alone(self) -> bool:
        """Return whether all quantities are inputs or sums, and note the inputs of those that are new."""
        new = list(itertools.islice(reversed(self.items.values()), len(self.items) - self._looked_at))
        for quantity in reversed(new):
            self._sums_alone &= isinstance(quantity.definition, InputElement | Sum)
            if isinstance(quantity.definition, Sum):
                self._inputs[quantity.name] = self._inputs_of(quantity.definition)
        self._looked_at = len(self.items)
        return self._sums_alone

    def _inputs_of(self, definition: Sum) -> frozenset[str]:
        """Return the inputs that a sum is made from, directly or not."""
        names = {name for monomial, _ in definition.terms for name in monomial}
        return frozenset().union(*(self._inputs.get(name, ()) for name in names))

    def _needed(self, definition: Sum) -> set[str]:
        """Return the names that a sum is made from, directly or not."""
        needed = {name for monomial, _ in definition.terms for name in monomial}
        for quantity in reversed(list(self.items.values())):
            if quantity.name in needed and isinstance(quantity.definition, Sum):
                needed |= {name for monomial, _ in quantity.definition.terms for name in monomial}
        return needed


#: A term as plain integers: the places of its factors, None where it has one alone, and its coefficient.
_Product = tuple[int, int | None, int, int]


@dataclass
class _Part:
    """A part of the inputs' box: both ends of every value by its place, and whose values are still to be computed."""

    lows: list[int]
    highs: list[int]
    pending: Sequence[int]


class _Parts:
    """Evaluates a sum on parts of the inputs' box.

    There are thousands of them: ends of intervals are plain integers here, in units of 2**-GRID, and a half takes from
    the whole what does not depend on the side that is cut. `steps` lead to the sum, each after those it is made from.
    """

    def __init__(self, box: Mapping[str, Interval], steps: Sequence[Quantity], definition: Sum) -> None:
        self._box, self._ranges = box, [quantity.range for quantity in steps]
        self._places = {quantity.name: place for place, quantity in enumerate(steps)}
        self._terms = [
            self._plain(quantity.definition) if isinstance(quantity.definition, Sum) else None
            for quantity in steps
        ]
        self._result = self._plain(definition)
        self._dependent: dict[str, list[int]] = {}
        for name, place in self._places.items():
            if name in box:
                self._dependent[name] = self._after(place)

    def _plain(self, definition: Sum) -> tuple[Interval, list[_Product]]:
        """Return the constant of a sum and its products."""
        constant, products = Interval(0, 0), []
        for monomial, coefficient in definition.terms:
            if monomial:
                first, second = self._places[monomial[0]], None if len(monomial) == 1 else monomial[1]
                other = None if second is None else self._places[second]
                products.append((first, other, coefficient.numerator, coefficient.denominator))
            else:
                constant += Interval.of(coefficient)
        return constant, products

    def _after(self, start: int) -> list[int]:
        """Return the places of the sums that depend on the value at a place."""
        changed = {start}
        for place, plain in enumerate(self._terms):
            if plain and any(first in changed or second in changed for first, second, *_ in plain[1]):
                changed.add(place)
        return sorted(changed - {start})

    def whole(self) -> _Part:
        """Return the whole box."""
        ranges = [self._box.get(name, known) for name, known in zip(self._places, self._ranges, strict=True)]
        sums = [place for place, plain in enumerate(self._terms) if plain]
        return _Part([r.low for r in ranges], [r.high for r in ranges], sums)

    def widest(self, part: _Part, names: Iterable[str]) -> str:
        """Return the widest side, relative to that of the whole box."""

        def share(name: str) -> Fraction:
            place, side = self._places[name], self._box[name]
            return Fraction(part.highs[place] - part.lows[place], max(1, side.high - side.low))

        return max(names, key=share)

    def halves(self, part: _Part, name: str) -> list[_Part]:
        """Return both halves of a part that is cut through one side."""
        place = self._places[name]
        halves = []
        for half in Interval(part.lows[place], part.highs[place]).halves():
            lows, highs = part.lows.copy(), part.highs.copy()
            lows[place], highs[place] = half.low, half.high
            halves.append(_Part(lows, highs, self._dependent[name]))
        return halves

    def evaluate(self, part: _Part) -> Interval:
        """Compute the values on a part that are not known yet, and return the interval of the sum."""
        lows, highs = part.lows, part.highs
        for place in part.pending:
            plain, known = self._terms[place], self._ranges[place]
            assert plain is not None
            low, high = _sum(plain, lows, highs)
            lows[place], highs[place] = max(low, known.low), min(high, known.high)
        return Interval(*_sum(self._result, lows, highs))


def _sum(plain: tuple[Interval, list[_Product]], lows: list[int], highs: list[int]) -> tuple[int, int]:
    """Return the ends of a sum, rounded outward as those of `Interval` are."""
    low, high = plain[0].low, plain[0].high
    for first, second, numerator, denominator in plain[1]:
        a, b = lows[first], highs[first]
        if second == first:
            most = max(abs(a), abs(b))
            least = 0 if a <= 0 <= b else min(abs(a), abs(b))
            a, b = least * least >> GRID, -(-most * most >> GRID)
        elif second is not None:
            c, d = lows[second], highs[second]
            corners = (a * c, a * d, b * c, b * d)
            a, b = min(corners) >> GRID, -(-max(corners) >> GRID)
        if numerator < 0:
            a, b = b, a
        low += a * numerator // denominator
        high -= -b * numerator // denominator
    return low, high
