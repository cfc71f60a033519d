"""Proves ranges of sums of products by interval arithmetic, by expansion in the inputs, and by splitting their box."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from fractions import Fraction

from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import InputElement, Monomial, Quantity, Sum, Terms, combined

#: Degree up to which a quantity is expanded in the inputs for its range, and terms that this may take.
_DEGREE, _MOST_TERMS = 2, 60
#: Boxes that a cut of the inputs' box may take for one quantity.
_MOST_BOXES = 128


#: Products, each with its coefficient.
SumOfTerms = Iterable[tuple[Monomial, Fraction]]


class Ranges:
    """Proves the ranges of quantities one after another, as they are derived.

    Parameters
    ----------
    items : mapping of str to Quantity
        The quantities so far; the caller adds each after its range is proved.
    box : mapping of str to Interval
        Range of every element of an input.
    """

    def __init__(self, items: Mapping[str, Quantity], box: Mapping[str, Interval]) -> None:
        self.items, self.box = items, dict(box)
        self.expanded: dict[str, Terms | None] = {name: {(name,): Fraction(1)} for name in box}

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
        if not isinstance(definition, Sum) or len(definition.terms) != 1 or self.items[one].inexact:
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
        if lost <= bits or any(not isinstance(q.definition, InputElement | Sum) for q in self.items.values()):
            return enclosure
        goal = Fraction(2) ** bits
        needed = self._needed(definition)
        pending, proved, spent = [self.box], Interval(0, 0), 0
        names = [n for n in self.box if n in needed]
        if not names or 2 ** len(names) > _MOST_BOXES:  # not even a cut of every side in two
            return enclosure
        steps = [q for name, q in self.items.items() if name in needed]
        while pending:
            box = pending.pop()
            inside = self._on(box, definition, steps)
            if inside.magnitude <= goal:
                proved = proved.join(inside)
                continue
            spent += 2
            if spent > _MOST_BOXES:
                return enclosure
            # Widest first, each measured against what it was.
            widest = max(
                names,
                key=lambda n: Fraction(box[n].high - box[n].low, max(1, self.box[n].high - self.box[n].low)),
            )
            pending += [box | {widest: half} for half in box[widest].halves()]
        return enclosure.meet(proved)

    def _needed(self, definition: Sum) -> set[str]:
        """Return the names that a sum is made from, directly or not."""
        needed = {name for monomial, _ in definition.terms for name in monomial}
        for quantity in reversed(list(self.items.values())):
            if quantity.name in needed and isinstance(quantity.definition, Sum):
                needed |= {name for monomial, _ in quantity.definition.terms for name in monomial}
        return needed

    def _on(self, box: Mapping[str, Interval], definition: Sum, steps: list[Quantity]) -> Interval:
        """Return the interval of a sum on a part of the inputs' box; the steps lead to it."""
        known: dict[str, Interval] = {}
        for quantity in steps:
            known[quantity.name] = (
                self.enclosure(quantity.definition.terms, known).meet(quantity.range)
                if isinstance(quantity.definition, Sum)
                else box[quantity.name]
            )
        return self.enclosure(definition.terms, known)
