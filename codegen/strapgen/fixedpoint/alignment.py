"""Formats that let products meet at one place, so that sums need no shifts before they are rounded."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Iterator, Mapping
from fractions import Fraction

from strapgen.fixedpoint.code import IntegerSum, Value, used_by

#: Bits below the last place of a sum down to which its products are kept.
_BELOW = 8
#: A coarser format may add this part of the rounding of a value that it is multiplied into.
_PART = Fraction(1, 16)


def aligning(body: Iterable[Value], values: Mapping[str, Value], kept: Container[str]) -> dict[str, int]:
    """Return, by name, the most fraction bits of values that are finer than the sums that use them can tell.

    Parameters
    ----------
    body : iterable of Value
        The code, with every value in its finest format.
    values : mapping of str to Value
        The same by name, and the elements of the inputs.
    kept : container of str
        Values whose format must stay.

    Returns
    -------
    dict of str to int
    """
    wanted: dict[str, int] = {}
    allowed: dict[str, int] = {}
    for value in body:
        for name, want, most in _uses(value, values):
            wanted[name] = max(want, wanted.get(name, 0))
            allowed[name] = min(most, allowed.get(name, most))
    coarser: dict[str, int] = {}
    for name, want in wanted.items():
        definition = values[name].definition
        rounded = isinstance(definition, IntegerSum) and definition.shift and definition.residual is None
        bits = min(want, allowed[name])
        if bits > 0 and rounded and name not in kept:
            coarser[name] = values[name].fraction - bits
    return coarser


def _uses(value: Value, values: Mapping[str, Value]) -> Iterator[tuple[str, int, int]]:
    """Yield the values that another is computed from: by how many bits each should be coarser, and may be."""
    definition = value.definition
    if not isinstance(definition, IntegerSum) or value.wide or not definition.shift:
        # Left as it is: every bit of what is compared, or added at full precision, counts.
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
        own = place - term.shift
        for name in term.names:
            # What an error of the value is multiplied with.
            others = [other for other in term.names if other != name]
            if len(others) == len(term.names) - 1:
                size = Fraction(1)
                for other in others:
                    made = values[other]
                    size = Fraction(made.magnitude) / Fraction(2) ** made.fraction
                if not others:
                    size = abs(term.factor) / Fraction(2) ** (own - values[name].fraction)
                room = _PART / Fraction(2) ** value.fraction / size * Fraction(2) ** values[name].fraction
                most = min(max(0, own - lowest), max(0, math.floor(room).bit_length() - 1))
            else:
                most = 0  # a square
            finer = len(others) == 1 and values[others[0]].fraction > values[name].fraction
            yield name, 0 if finer else max(0, own - goal), most
