"""Ranges of sums of products: they hold all values; on parts of the inputs' box integers give what intervals do."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import pytest
from hypothesis import Phase, given, settings
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


@pytest.mark.long
@given(chains(), st.fixed_dictionaries(dict.fromkeys(INPUTS, intervals)), st.sampled_from(INPUTS))
def test_a_part_and_its_halves_have_the_range_that_intervals_give(sums, box, side):
    parts = _Parts(box, [*quantities(sums, box).values()], sums[-1])
    whole = parts.whole()
    assert parts.evaluate(whole) == by_intervals(sums, box)
    for part, half in zip(parts.halves(whole, side), box[side].halves(), strict=True):
        assert parts.evaluate(part) == by_intervals(sums, box | {side: half})


# A cut takes long: no shorter example is sought.
@settings(max_examples=20, phases=(Phase.explicit, Phase.generate))
@given(chains(), st.fixed_dictionaries(dict.fromkeys(INPUTS, intervals)))
def test_no_value_at_a_corner_or_inside_leaves_its_range(sums, box):
    items = quantities([], box)
    ranges = Ranges(items, box)
    sides = [(box[name].lowest, box[name].highest) for name in INPUTS]
    inside = [(2 * low + high) / 3 for low, high in sides]
    points = [dict(zip(INPUTS, point, strict=True)) for point in (inside, *itertools.product(*sides))]
    for k, definition in enumerate(sums):
        name = f"v_{k}"
        for point in points:
            point[name] = sum((c * math.prod(map(point.get, m)) for m, c in definition.terms), Fraction(0))
        seen = float(max(abs(point[name]) for point in points)) or 1e-300
        known = ranges.of_sum(name, dict(definition.terms), seen)
        items[name] = Quantity(name, definition, Fraction(0), known)
        assert all(known.lowest <= point[name] <= known.highest for point in points)


def of_product(coefficient: Fraction, approximation_error: Fraction) -> tuple[Fraction, Fraction]:
    """Return the range of p x, where p is a multiple of x z up to an error."""
    x, z = Interval.of(-1, 1), Interval.of(Fraction(1, 2), 1)
    items = quantities([], {"x": x, "z": z})
    p = Sum(((("x", "z"), coefficient),))
    known = (x * z).scale(coefficient).widened(approximation_error)
    items["p"] = Quantity("p", p, Fraction(0), known, approximation_error=approximation_error)
    result = Ranges(items, {"x": x, "z": z}).enclosure([(("p", "x"), Fraction(1))])
    return result.lowest, result.highest


def test_a_product_with_a_factor_of_its_own_has_the_range_of_a_square():
    assert of_product(Fraction(-1, 2), Fraction(0)) == (Fraction(-1, 2), 0)
    assert of_product(Fraction(3, 4), Fraction(0)) == (0, Fraction(3, 4))
    # At x = 1/4 and z = 1/2 the product is positive if the factor is too large by 1/8.
    low, high = of_product(Fraction(-1, 2), Fraction(1, 8))
    assert low == -high == Fraction(-5, 8)


@pytest.mark.parametrize("sign", [1, -1])
def test_all_parts_of_a_box_that_is_cut_count(sign):
    """x - 5/4 x^2 is -3 at x = 2 and 1/5 at x = 2/5; a cut between them proves that 4 is not exceeded."""
    side = Interval.of(min(0, 2 * sign), max(0, 2 * sign))
    items = quantities([], {"x": side})
    terms = {("x",): Fraction(sign), ("x", "x"): Fraction(-5, 4)}
    ranges = Ranges(items, {"x": side})
    assert ranges.enclosure(terms.items()) == Interval.of(-5, 2)
    known = ranges.of_sum("v", terms, 3.0)
    assert -4 <= known.lowest <= -3
    assert Fraction(1, 5) <= known.highest <= 2


def test_the_side_that_is_cut_is_the_one_of_which_most_is_left():
    box = {"x": Interval.of(-4, 0), "y": Interval.of(0, 1)}
    parts = _Parts(box, [*quantities([], box).values()], Sum(((("x", "y"), Fraction(1)),)))
    _, upper = parts.halves(parts.whole(), "y")
    assert parts.widest(upper, box) == "x"
    for half in parts.halves(parts.whole(), "x"):
        assert parts.widest(half, box) == "y"
