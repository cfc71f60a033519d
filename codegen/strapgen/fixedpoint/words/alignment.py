"""Chooses coarser formats that let the products of a sum be added without shifts."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping

from strapgen.ir.integer_program import IntegerSum, Term, Value, used_by

#: Bits below the last place of a sum down to which its products are computed.
_BELOW = 8
#: A coarser format may add a part of the rounding error of a value that it is multiplied into: so many bits less.
_PART = 4
#: Bits by which that is less where the sum's own rounding comes with the next call: other errors add up alone.
_FED_BACK = 4


def aligning(body: Iterable[Value], values: Mapping[str, Value], fixed: Container[str]) -> dict[str, int]:
    """Return, by name, the most fraction bits of values that are finer than the sums that use them can tell.

    In `body` every value has its finest format; values in `fixed` keep theirs.
    """
    useful: dict[str, int] = {}
    allowed: dict[str, int] = {}
    for value in body:
        for name, bits, most in _uses(value, values):
            useful[name] = max(bits, useful.get(name, 0))
            allowed[name] = min(most, allowed.get(name, most))
    coarser: dict[str, int] = {}
    for name in useful:
        definition = values[name].definition
        rounded = isinstance(definition, IntegerSum) and definition.shift and definition.residual is None
        bits = min(useful[name], allowed[name])
        if bits > 0 and rounded and name not in fixed:
            coarser[name] = values[name].fraction - bits
    return coarser


def _uses(value: Value, values: Mapping[str, Value]) -> Iterator[tuple[str, int, int]]:
    """Yield the operands of a value, each with the bits by which it should be coarser, and by which it may be."""
    definition = value.definition
    if not isinstance(definition, IntegerSum) or value.wide or not definition.shift:
        # Every bit counts of what is compared, or added at full precision.
        for name in used_by(value):
            yield name, 0, 0
        return
    for term in definition.coarse:
        for name in term.names:
            yield name, 0, 0
    place = value.fraction + definition.shift + definition.drop
    lowest = value.fraction + _BELOW
    goal = max(min((place - term.shift for term in definition.fine if term.names), default=place), lowest)
    for term in definition.fine:
        term_place = place - term.shift
        for name in term.names:
            others = [other for other in term.names if other != name]
            is_square = len(others) < len(term.names) - 1
            room = (
                0 if is_square else _room(term, term_place, value, values[name], [values[o] for o in others])
            )
            finer = len(others) == 1 and values[others[0]].fraction > values[name].fraction
            yield name, 0 if finer else max(0, term_place - goal), min(max(0, term_place - lowest), room)


def _room(term: Term, place: int, value: Value, factor: Value, others: list[Value]) -> int:
    """Return the bits by which a factor of a term may be coarser, so that the error of the sum hardly grows."""
    # What an error of the factor is multiplied with, as an integer with fraction bits.
    size, bits = abs(term.factor), place - factor.fraction
    for other in others:
        size, bits = other.magnitude, other.fraction
    if not size:  # a product with what is always zero
        return place
    is_fed_back = isinstance(value.definition, IntegerSum) and value.definition.residual is not None
    fraction = value.fraction + (_FED_BACK if is_fed_back else 0)
    units = factor.fraction + bits - fraction - _PART
    return max(0, ((1 << units) // size).bit_length() - 1) if units > 0 else 0
