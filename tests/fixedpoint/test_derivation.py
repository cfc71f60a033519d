"""Quotients, roots, maxima and angles as quantities: what is proved of their ranges, and what only a check ensures."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from small_programs import node, program

from strapgen.fixedpoint import functions
from strapgen.fixedpoint.derivation import quantities
from strapgen.fixedpoint.derived_sums import samples
from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import ExactOperation, InputElement, Quantity, Sum
from strapgen.fixedpoint.ranges import Ranges, _Parts
from strapgen.ir.exceptions import InputError
from strapgen.ir.program import Node, Program
from strapgen.ir.signals import Signal

UNIT_VECTOR = Signal("e", (4,), ("a", "b", "c", "d"), constraint="unit")


def derived(code: Program) -> dict[str, Quantity]:
    limits = {name: s.bound or Fraction(17, 16) for s in code.inputs for name in s.elements}
    return quantities(code, {name: Interval.symmetric(size) for name, size in limits.items()}).items


def ends(body: dict[str, Node], name: str = "y") -> tuple[Fraction, Fraction]:
    known = derived(program(body, {"a": 1, "b": 2}))[name].range
    return known.lowest, known.highest


def test_a_quotient_by_a_number_is_a_multiple():
    y = derived(program({"y": node("divide", "a", -4)}, {"a": 3}))["y"]
    assert dict(y.definition.terms) == {("a",): Fraction(-1, 4)}
    assert (y.range.lowest, y.range.highest) == (Fraction(-3, 4), Fraction(3, 4))


def third_of(name: str) -> Node:
    return node("multiply", Fraction(1, 3), name)


def test_a_multiple_and_what_differs_from_it_by_a_number_are_one_word():
    body = {"m": third_of("a"), "y": node("subtract", 2, "m"), "n": node("subtract", "m", Fraction(1, 3))}
    body["w"] = node("multiply", "m", node("add", node("multiply", 3, "b"), "a"))
    sum_of_all = node("add", "w", node("multiply", "y", "n"))
    known = derived(program(body | {"z": sum_of_all}, {"a": 1, "b": 1}, "z"))
    assert "m" not in known
    assert dict(known["w_factor"].definition.terms) == {("b",): 1, ("a",): Fraction(1, 3)}
    assert dict(known["y"].definition.terms) == {("a",): Fraction(-1, 3)} and known["y"].offset == 2
    assert dict(known["n"].definition.terms) == {("y",): -1, (): Fraction(-1, 3)}


def test_a_multiple_that_has_a_word_keeps_it():
    body = {"m": third_of("a"), "x": node("multiply", "m", "m"), "y": node("subtract", 2, "m")}
    known = derived(program(body | {"z": node("multiply", "y", "x")}, {"a": 1}, "z"))
    assert dict(known["y"].definition.terms) == {("m",): -1}


@pytest.mark.parametrize(
    ("other", "terms"),
    [
        # Of 6 b and a/2, one is no shift; of 2 b and a/6 the other: the multiple takes no word then.
        (
            node("add", node("multiply", 6, "b"), node("multiply", Fraction(1, 2), "c")),
            {"b": 2, "c": Fraction(1, 6)},
        ),
        (node("add", node("multiply", 3, "b"), "c"), {"b": 1, "c": Fraction(1, 3)}),
        # Of b and c both are shifts, and b/3 and c/3 are none.
        (node("add", "b", "c"), {"b": 1, "c": 1}),
    ],
)
@pytest.mark.parametrize("turned", [False, True])
def test_a_product_takes_no_multiple_where_shifts_do(other, terms, turned):
    factors = (other, "m") if turned else ("m", other)
    known = derived(program({"m": third_of("a"), "y": node("multiply", *factors)}, dict.fromkeys("abc", 1)))
    assert dict(known["y_factor"].definition.terms) == {(name,): c for name, c in terms.items()}
    assert ("m" in known) == (terms == {"b": 1, "c": 1})


def test_the_root_of_a_number_lies_between_its_ends():
    root = derived(program({"r": node("sqrt", 2), "y": node("multiply", "r", "a")}, {"a": 1}))["r"]
    ((_, low),) = root.definition.terms
    assert low**2 < 2 <= (low + root.approximation_error) ** 2
    assert root.approximation_error < Fraction(1, 1 << 150)


@pytest.mark.parametrize(
    ("value", "low", "high"),
    [
        (node("maximum", "a", "b"), -1, 2),
        (node("maximum", "a", node("negate", "a")), 0, 1),
        (node("maximum", "a", node("subtract", 1, "a")), Fraction(1, 2), 2),
        (node("maximum", "a", -3), -1, 1),
        (node("maximum", -1, "a"), -1, 1),
        (node("maximum", "a", node("add", "b", 3), -3), 1, 5),
        (node("maximum", "a", 1), 1, 1),
        (node("select", node("at_least", "a", 0), "a", node("multiply", 3, "b")), -6, 6),
        (node("select", node("at_least", "a", 0), node("multiply", 3, "b"), "a"), -6, 6),
        (node("divide", "b", node("add", "a", 3)), -1, 1),
        (node("sqrt", node("add", "a", Fraction(5, 4))), Fraction(1, 2), Fraction(3, 2)),
    ],
)
def test_a_range_is_attained(value, low, high):
    assert ends({"y": value}) == (low, high)


def test_what_is_never_the_largest_is_left_out_and_at_its_end_it_stays():
    product = node("multiply", "m", "b")
    limits = {"a": 1, "b": 2}
    known = derived(program({"m": node("maximum", "a", node("subtract", "b", 4)), "y": product}, limits))
    assert known["m"].definition == Sum(((("a",), Fraction(1)),))
    largest = node("maximum", -1, "a", node("subtract", "b", 4))
    known = derived(program({"m": largest, "y": product}, limits))
    assert known["m"].definition == ExactOperation("maximum", (Fraction(-1), "a"))


def test_what_differs_from_a_function_by_a_number_is_made_from_its_value_and_inherits_its_error():
    body = {"c": node("cos", "a"), "y": node("subtract", 8, "c"), "z": node("multiply", "y", "a")}
    known = derived(program(body, {"a": 6}, "z"))
    assert dict(known["y"].definition.terms) == {("c",): -1}
    assert known["c"].inherited_error is not None


@pytest.mark.parametrize("inputs", [(UNIT_VECTOR,), None])
def test_an_angle_is_refused_off_a_constraint_alone(inputs):
    """Inputs without a constraint are proper up to the ends of their ranges, of which samples know nothing."""
    squares = [node("multiply", name, name) for name in "abcd"]
    body = {"p": node("add", *squares[:2]), "q": node("add", Fraction(1, 8), node("add", *squares[2:]))}
    code = program({**body, "y": node("atan2", "p", "q")}, dict.fromkeys("abcd", 1))
    quantities = derived(replace(code, inputs=inputs or code.inputs))
    assert any(quantity.range_checked for quantity in quantities.values()) == (inputs is not None)


def test_a_divisor_below_zero_is_checked_to_stay_there():
    squares = [node("multiply", name, name) for name in "abcd"]
    divisor = node("negate", node("add", node("add", *squares[:2]), node("add", *squares[2:])))
    code = program({"s": divisor, "y": node("divide", "a", "s")}, dict.fromkeys("abcd", 1))
    s = derived(replace(code, inputs=(UNIT_VECTOR,)))["s"]
    # -1 on unit vectors; the check is that of half and twice of it.
    assert (s.range.lowest, s.range.highest, s.range_checked) == (-2, Fraction(-1, 2), True)


@pytest.mark.parametrize(("least", "range_checked"), [(Fraction(3, 10), False), (Fraction(1, 5), True)])
def test_a_limit_that_is_proved_within_a_factor_of_two_is_not_checked(least, range_checked):
    """Of about 1 on unit vectors half is the limit; a proof of 3/10 is near it, and one of 1/5 is not."""
    squares = [node("multiply", name, name) for name in "abcd"]
    total = node("add", node("add", *squares[:2]), node("add", *squares[2:]))
    divisor = node("add", node("multiply", Fraction(95, 100) - least, total), least)
    code = program({"s": divisor, "y": node("divide", "a", "s")}, dict.fromkeys("abcd", 1))
    assert derived(replace(code, inputs=(UNIT_VECTOR,)))["s"].range_checked is range_checked


def test_nothing_is_checked_where_proper_inputs_come_near_zero():
    near = node("subtract", "a", Fraction(1, 2))
    divisor = node("add", node("multiply", near, near), Fraction(1, 512))
    code = program({"d": divisor, "y": node("divide", "a", "d")}, {"a": 1})
    with pytest.raises(ValueError, match=r"a division by \[-0"):
        derived(code)


def test_root_of_possibly_negative_number_is_refused():
    code = program({"s": node("add", "a", "b"), "y": node("sqrt", "s")}, {"a": 1, "b": 1})
    with pytest.raises(InputError, match=r"s may be below 0, its range is .*; it has no square root"):
        derived(code)


def slope_distance(code: Program, monkeypatch) -> Fraction:
    """Return the inverse of the slope that is stated for the angle of a program."""
    told: list[Fraction] = []
    derive = functions.derive_function
    monkeypatch.setattr(
        functions, "derive_function", lambda *arguments: [told.append(arguments[-1]), derive(*arguments)]
    )
    derived(code)
    (distance,) = told
    return distance


def test_the_slope_of_an_angle_is_that_of_the_shortest_vectors(monkeypatch):
    body = {
        "y1": node("add", node("multiply", "a", "b"), 2),
        "x1": node("subtract", 3, node("multiply", "a", "b")),
        "y": node("atan2", "y1", "x1"),
    }
    distance = slope_distance(program(body, {"a": 1, "b": 1}), monkeypatch)
    # Components of at least 1 and 2. Opposite vectors are half a turn apart in angle, and 2 * root(5) in place.
    assert distance**2 <= 5 * Fraction(7, 11) ** 2
    assert 0.99 * 2 / math.pi * math.sqrt(5) < distance <= 2 / math.pi * math.sqrt(5)


def test_vectors_that_are_checked_are_near_each_other(monkeypatch):
    rest = node("maximum", 0, node("subtract", 1, node("multiply", "a", "a")))
    code = program({"y": node("atan2", "a", node("sqrt", rest))}, {"a": 1})
    distance, length = float(slope_distance(code, monkeypatch)), math.sqrt(1 / 2)
    # Of length 1 at first, root(1/2) at least in the check. Ends 3/4 of that apart are 2 asin(3/8) apart in angle.
    assert 0.88 * length < distance <= length * (3 / 4) / (2 * math.asin(3 / 8))


@pytest.mark.parametrize("size", [3, 4])
def test_proper_vectors_of_length_one_have_it(size):
    signal = Signal.labelled("direction", "u", "xyzs"[:size], constraint="unit")
    ranges = {name: Interval.of(-1, 1) for name in signal.elements}
    proper, anywhere = samples([signal], ranges)
    lengths, others = (sum(values[name] ** 2 for name in signal.elements) for values in (proper, anywhere))
    np.testing.assert_allclose(lengths, 1, atol=1e-14)
    assert others.max() == size


def test_proper_rotations_are_rotations():
    signal = Signal.matrix("attitude", "C", constraint="rotation")
    proper, _ = samples([signal], {name: Interval.of(-1, 1) for name in signal.elements})
    C = np.stack([proper[name] for name in signal.elements], axis=-1).reshape(-1, 3, 3)
    np.testing.assert_allclose(C @ np.swapaxes(C, -1, -2), np.broadcast_to(np.eye(3), C.shape), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(C), 1, atol=1e-14)


INPUTS = ("x", "y", "z")
fractions = st.fractions(min_value=-3, max_value=3, max_denominator=24)
intervals = st.tuples(fractions, fractions).map(lambda pair: Interval.of(min(pair), max(pair)))
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


def items_of(sums: list[Sum], box: dict[str, Interval]) -> dict[str, Quantity]:
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
    parts = _Parts(box, [*items_of(sums, box).values()], sums[-1])
    whole = parts.whole()
    assert parts.evaluate(whole) == by_intervals(sums, box)
    for part, half in zip(parts.halves(whole, side), box[side].halves(), strict=True):
        assert parts.evaluate(part) == by_intervals(sums, box | {side: half})


# A cut takes long: no shorter example is sought.
@settings(max_examples=20, phases=(Phase.explicit, Phase.generate))
@given(chains(), st.fixed_dictionaries(dict.fromkeys(INPUTS, intervals)))
def test_no_value_at_a_corner_or_inside_leaves_its_range(sums, box):
    items = items_of([], box)
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
    items = items_of([], {"x": x, "z": z})
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
    items = items_of([], {"x": side})
    terms = {("x",): Fraction(sign), ("x", "x"): Fraction(-5, 4)}
    ranges = Ranges(items, {"x": side})
    assert ranges.enclosure(terms.items()) == Interval.of(-5, 2)
    known = ranges.of_sum("v", terms, 3.0)
    assert -4 <= known.lowest <= -3
    assert Fraction(1, 5) <= known.highest <= 2


def test_the_side_that_is_cut_is_the_one_of_which_most_is_left():
    box = {"x": Interval.of(-4, 0), "y": Interval.of(0, 1)}
    parts = _Parts(box, [*items_of([], box).values()], Sum(((("x", "y"), Fraction(1)),)))
    _, upper = parts.halves(parts.whole(), "y")
    assert parts.widest(upper, box) == "x"
    for half in parts.halves(parts.whole(), "x"):
        assert parts.widest(half, box) == "y"
