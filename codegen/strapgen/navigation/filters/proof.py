"""Proved bounds of a filter in a run of any length: ranges of its states, and what errors of each call add up to.

With the matrices M, B, C and D of a cycle, samples up to 1 take the states to the sum of |M^k B|, and errors e of the
states in each call become errors of at most the sum of |M^k| e. These sums are computed in integers, each rounded with
a known error, until the norm of M^N is small; what follows is bounded by the sum so far over 1 less that norm.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache

from strapgen.ir.exceptions import InputError
from strapgen.navigation.filters.sections import Section

#: Fraction bits of the integers, the norm at which a sum ends in their units, and its most cycles.
_BITS, _SMALL, MOST_CYCLES = 96, 1 << 56, 200_000
#: Cycles after which the norm is looked at again.
_LOOK = 16
_ONE = 1 << _BITS

#: Room above the ranges that exact arithmetic has, for what rounding adds.
ROOM = Fraction(17, 16)

#: Part of a response that is left after the most cycles, where no bound follows.
_HOPELESS = 0.9
_TOO_SLOW = f"the filter does not settle in {MOST_CYCLES} cycles, for which its bounds are computed"

Vector = tuple[Fraction, ...]


@dataclass(frozen=True)
class Bounds:
    """Upper bounds of sums over all cycles, for samples up to 1."""

    #: Largest magnitude of each state
    states: Vector
    #: Sum of |M^k|, and of |C M^k|: what errors of each call become in the states and in the output
    growth: tuple[Vector, ...]
    output_growth: Vector

    def errors(self, added: Sequence[Fraction]) -> Vector:
        """Return bounds of the errors of the states in a run whose calls each add up to `added`."""
        return tuple(_dot(row, added) for row in self.growth)

    def output_error(self, added: Sequence[Fraction], last: Fraction) -> Fraction:
        """Return a bound of the error of the output; `last` is that of one call beside its states."""
        return _dot(self.output_growth, added) + last


def _dot(one: Sequence[Fraction], other: Sequence[Fraction]) -> Fraction:
    return sum((a * b for a, b in zip(one, other, strict=True)), Fraction(0))


def cycle(
    sections: Sequence[Section], states: Sequence[Fraction], sample: Fraction
) -> tuple[list[Fraction], Fraction]:
    """Return the states after a cycle and the output, exactly; the order of the states is that of the kernel."""
    left, after = iter(states), []
    for one in sections:
        first = next(left) if one.loss is not None else Fraction(0)
        second = next(left)
        apart = sample - second
        change = one.cross * first + one.square * apart
        width, across = one.band
        band, slow = width * apart + across * first, second + change
        if one.loss is not None:
            after.append(first + 2 * (one.enter * apart - one.loss * first))
        after.append(second + 2 * change)
        sample = one.high * (sample - band - slow) + one.centre * band + one.low * slow
    return after, sample


@cache
def bounds(sections: tuple[Section, ...]) -> Bounds:
    """Return the bounds of a filter; refuse one that settles too slowly for them."""
    size = sum(len(one.states) for one in sections)
    rest = [Fraction(0)] * size
    unit = [[Fraction(k == place) for k in range(size)] for place in range(size)]
    columns = [cycle(sections, one, Fraction(0)) for one in unit]
    entering, _ = cycle(sections, rest, Fraction(1))
    matrix = [[column[0][row] for column in columns] for row in range(size)]
    outward = [column[1] for column in columns]
    below = math.lcm(*(x.denominator for row in matrix for x in row), *(x.denominator for x in outward))
    # Of each row the entries that are not zero, as integers over `below`; the last row is that of the output.
    rows = [[(k, int(x * below)) for k, x in enumerate(row) if x] for row in (*matrix, outward)]

    vectors = [[_ONE * int(x) for x in one] for one in unit] + [[math.floor(x * _ONE) for x in entering]]
    sums = [[0] * (size + 1) for _ in vectors]
    norm, cycles = _ONE, 0
    if max(one.radius for one in sections) ** MOST_CYCLES > _HOPELESS:
        raise InputError(_TOO_SLOW)
    while norm > _SMALL and cycles < MOST_CYCLES:
        for place, vector in enumerate(vectors):
            *later, out = [sum(c * vector[k] for k, c in row) // below for row in rows]
            total = sums[place]
            for k, x in enumerate(vector):
                total[k] += abs(x)
            total[size] += abs(out)
            vectors[place] = later
        cycles += 1
        if cycles % _LOOK == 0:
            norm = max(sum(abs(vector[row]) for vector in vectors[:size]) for row in range(size))
    # A column is off by at most S units, S the norm of the sum of |M^k| so far, since each cycle drops up to a unit.
    so_far = Fraction(max(sum(one[row] for one in sums[:size]) for row in range(size)), _ONE)
    so_far /= 1 - Fraction(cycles * size, _ONE)
    left = Fraction(norm, _ONE) + size * so_far / _ONE
    if left >= 1:
        raise InputError(_TOO_SLOW)
    whole = so_far / (1 - left)
    off, gain = 2 * so_far / _ONE, sum(map(abs, outward), Fraction(0))
    tail = [left] * size + [Fraction(max(map(abs, vectors[size])), _ONE) + off]

    def upper(place: int, row: int) -> Fraction:
        slack = cycles * off + whole * tail[place]
        if row == size:
            slack = slack * gain + Fraction(cycles, _ONE)
        return _rounded_up(Fraction(sums[place][row], _ONE) + slack)

    return Bounds(
        tuple(upper(size, row) for row in range(size)),
        tuple(tuple(upper(place, row) for place in range(size)) for row in range(size)),
        tuple(upper(place, size) for place in range(size)),
    )


def _rounded_up(value: Fraction) -> Fraction:
    """Return a number that is not smaller, with few digits."""
    return Fraction(math.ceil(value * (1 << 64)), 1 << 64)
