"""Ranges on parts of the inputs' box: plain integers give what intervals do, and a half what it gives by itself."""

from __future__ import annotations

from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st

from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import InputElement, Quantity, Sum
from strapgen.fixedpoint.ranges import Ranges, _Parts

INPUTS = ("x", "y", "z")
ends = st.fractions(min_value=-3, max_value=3, max_denominator=24)
intervals = st.tuples(ends, ends).map(lambda pair: Interval.of(min(pair), max(pair)))
coefficients = st.fractions(min_value=-2, max_value=2, max_denominator=7)
WIDE = Interval.symmetric(10**6)


@st.composite
def chains(draw: st.DrawFn) -> list[Sum]:
    """Sums of products of up to two values before them; the last is the one whose range is asked for."""
    names, sums = [*INPUTS], []
    for k in range(draw(st.integers(1, 4))):
        factors = st.lists(st.sampled_from(names), max_size=2).map(tuple)
        sums.append(Sum(tuple(draw(st.dictionaries(factors, coefficients, min_size=1, max_size=4)).items())))
        names.append(f"v_{k}")
    return sums


def quantities(sums: list[Sum], box: dict[str, Interval]) -> dict[str, Quantity]:
    inputs = {name: Quantity(name, InputElement("input"), Fraction(0), side) for name, side in box.items()}
    values = {
        f"v_{k}": Quantity(f"v_{k}", definition, Fraction(0), WIDE) for k, definition in enumerate(sums[:-1])
    }
    return inputs | values


def by_intervals(sums: list[Sum], box: dict[str, Interval]) -> Interval:
    known = dict(box)
    for k, definition in enumerate(sums):
        known[f"v_{k}"] = Ranges({}, {}).enclosure(definition.terms, known)
    return known[f"v_{len(sums) - 1}"]


@given(chains(), st.fixed_dictionaries(dict.fromkeys(INPUTS, intervals)), st.sampled_from(INPUTS))
def test_a_part_and_its_halves_have_the_range_that_intervals_give(sums, box, side):
    parts = _Parts(box, [*quantities(sums, box).values()], sums[-1])
    whole = parts.whole()
    assert parts.evaluate(whole) == by_intervals(sums, box)
    for part, half in zip(parts.halves(whole, side), box[side].halves(), strict=True):
        assert parts.evaluate(part) == by_intervals(sums, box | {side: half})
