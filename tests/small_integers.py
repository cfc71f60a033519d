"""Single values of fixed point, lowered from hand-made quantities with errors, and the worst that they can do.

The exact value of a quantity lies anywhere within the error of its integer, so that every term of a bound can be
attained: what these functions search is all integers of a few bits, with every quantity off by all of its error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from types import SimpleNamespace
from typing import Any

from strapgen.fixedpoint.format_plan import FormatPlan
from strapgen.fixedpoint.integer_sums import Quantization
from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import InputElement, Quantities, Quantity
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import (
    IntegerOperation,
    IntegerSum,
    Scaled,
    Term,
    Value,
    cases_of,
    high_word_of_halves,
)

#: Bounds are rounded up to numbers of so many bits below the point, a few times each.
GRID = Fraction(1, 1 << 150)


@dataclass(frozen=True)
class Known:
    """A quantity that there is already: integers from `low` to `high` with `fraction` bits, and their error.

    The exact value lies within the error of the integer, and inside what the two ends less the error enclose.
    """

    fraction: int
    low: int
    high: int
    error: Fraction = Fraction(0)
    wide: bool = False

    @property
    def unit(self) -> Fraction:
        return Fraction(2) ** -self.fraction

    def exact(self, integer: int) -> list[Fraction]:
        """Return the ends of where the exact value of an integer may lie."""
        low, high = self.low * self.unit + self.error, self.high * self.unit - self.error
        near = integer * self.unit
        return sorted({min(max(near + sign * self.error, low), high) for sign in (-1, 1)})


def context(
    known: Mapping[str, Known],
    *items: Quantity,
    words: Sequence[str] = (),
    forced: Mapping[str, int] | None = None,
    feedback: Mapping[str, str] | None = None,
    **settings: Any,
) -> Quantization:
    """Return a walk that knows these values, and these quantities beside them."""
    values, quantities = {}, Quantities()
    zero = Fraction(0)
    for name, value in known.items():
        exact = Interval.of(value.exact(value.low)[0], value.exact(value.high)[-1])
        quantities.items[name] = Quantity(name, InputElement(name), zero, exact)
        top = max(abs(value.low), abs(value.high))
        values[name] = Value(
            name, None, value.fraction, value.wide, value.low, value.high, zero, value.error, top
        )
    quantities.items |= {item.name: item for item in items}
    plan = FormatPlan((), values, forced or {}, frozenset({*words, *(forced or {})}))
    program = SimpleNamespace(kernel="small", outputs=(), inputs=(), attitude_step=None, transition=None)
    return Quantization(program, Settings(**{"word": 8} | settings), quantities, plan, {}, feedback or {})


def quantity(name: str, definition: Any, low: Fraction | int, high: Fraction | int, **more: Any) -> Quantity:
    """Return a quantity whose range is known."""
    return Quantity(name, definition, Fraction(0), Interval.of(low, high), **more)


def at_corners(known: Mapping[str, Known], exact: Callable[..., Fraction]) -> tuple[Fraction, Fraction]:
    """Return the range of what takes its extremes at the ends of the known quantities."""
    ends = [(item.exact(item.low)[0], item.exact(item.high)[-1]) for item in known.values()]
    values = [exact(*row) for row in product(*ends)]
    return min(values), max(values)


# What the code computes, from the meaning of integers alone


def _shifted(integer: int, shift: int) -> int:
    return integer << shift if shift > 0 else integer >> -shift


def _scaled(operand: Scaled, integers: Mapping[str, int]) -> int:
    value = operand.value if isinstance(operand.value, int) else integers[operand.value]
    return _shifted(value, operand.shift)


def _term(term: Term, integers: Mapping[str, int]) -> int:
    return _shifted(term.factor * math.prod(integers[name] for name in term.names), term.shift)


def _quotient(exact: Fraction, nearest: bool) -> int:
    size = math.floor(abs(exact) + (Fraction(1, 2) if nearest else 0))
    return size if exact >= 0 else -size


def _sum(total: IntegerSum, integers: Mapping[str, int], nearest: bool) -> tuple[int, list[int]]:
    """Return the integer of a sum, and the magnitudes of its partial sums in any order."""
    fine, coarse = ([_term(term, integers) for term in terms] for terms in (total.fine, total.coarse))
    if not total.shift:
        return sum(fine + coarse), _partial(fine + coarse)
    if total.halves:
        (term,) = total.fine
        factors = [*(integers[name] for name in term.names), *[term.factor] * (len(term.names) == 1)]
        return high_word_of_halves(*factors, total.shift), _partial(fine)
    if total.residual is None:
        fine.append(1 << (total.shift - 1) if nearest else 0)
        inside = sum(fine)
    else:
        inside = with_feedback(total, integers)
        fine = [sum(fine) >> total.drop, _shifted(integers[total.residual.name], total.residual.shift)]
    rounded = inside >> total.shift
    return rounded + sum(coarse), _partial(fine) + _partial([rounded, *coarse])


def with_feedback(total: IntegerSum, integers: Mapping[str, int]) -> int:
    """Return the fine terms of a sum and what is fed back into it, before they are rounded."""
    assert total.residual is not None
    fine = sum(_term(term, integers) for term in total.fine)
    return (fine >> total.drop) + _shifted(integers[total.residual.name], total.residual.shift)


def _partial(terms: Sequence[int]) -> list[int]:
    """Return the largest magnitude that adding up these terms can meet."""
    positive, negative = (sum(t for t in terms if (t > 0) == above) for above in (True, False))
    return [max(positive, -negative)]


def computed(
    definition: IntegerSum | IntegerOperation, integers: Mapping[str, int], nearest: bool
) -> tuple[int, list[int]]:
    """Return the integer that the code computes, and the sizes of the integers on the way."""
    match definition:
        case IntegerSum():
            return _sum(definition, integers, nearest)
        case IntegerOperation("divide", (numerator, denominator)):
            top = _scaled(numerator, integers)
            size = _quotient(Fraction(top, _scaled(denominator, integers)), nearest)
            return size, [abs(top)]
        case IntegerOperation("sqrt", (argument,)):
            square = _scaled(argument, integers)
            root = math.isqrt(square)
            return root + (nearest and square - root * root > root), [square]
        case IntegerOperation("maximum", arguments):
            return max(_scaled(argument, integers) for argument in arguments), []
        case IntegerOperation("select", (*_, otherwise) as arguments):
            for left, right, result in cases_of(arguments):
                if _scaled(left, integers) >= _scaled(right, integers):
                    return _scaled(result, integers), []
            return _scaled(otherwise, integers), []
    raise TypeError(type(definition).__name__)


# The worst case


@dataclass(frozen=True)
class Worst:
    """What a value does at worst: its distance from the exact one, the ends of its integers, the largest on the way."""

    error: Fraction
    low: int
    high: int
    peak: int


def worst(
    walk: Quantization,
    name: str,
    known: Mapping[str, Known],
    exact: Callable[..., Fraction],
    words: Mapping[str, Sequence[int]] | None = None,
) -> Worst:
    """Return the worst over all integers of the known quantities, each off by all of its error to either side.

    Parameters
    ----------
    walk : Quantization
        It has the value, and all that the value is computed from.
    name : str
    known : mapping of str to Known
    exact : callable
        The exact value, from exact values of the known quantities in their order.
    words : mapping of str to sequence of int, optional
        What error feedback may hold.
    """
    nearest = walk.settings.rounding == "nearest"
    value, errors, integers_seen, sizes = walk.values[name], [Fraction(0)], [], [0]
    for integers in _integers(known, words or {}):
        for step in walk.body:
            integers[step.name], partial = computed(step.definition, integers, nearest)
            if step.name == name:
                break
        near = value.offset + integers[name] * Fraction(2) ** -value.fraction
        integers_seen.append(integers[name])
        sizes += partial
        for row in product(*(item.exact(integers[item_name]) for item_name, item in known.items())):
            errors.append(abs(near - exact(*row)))
    return Worst(max(errors), min(integers_seen), max(integers_seen), max(sizes))


def _integers(known: Mapping[str, Known], words: Mapping[str, Sequence[int]]) -> Iterator[dict[str, int]]:
    ranges = [range(item.low, item.high + 1) for item in known.values()] + list(words.values())
    for row in product(*ranges):
        yield dict(zip([*known, *words], row, strict=True))
