"""Error bounds of sums: each term is attained by integers of a few bits, so that none may be left out or halved."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import product
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_integers import GRID, Known, at_corners, computed, context, quantity, with_feedback, worst

from strapgen.fixedpoint.integer_sums import _is_attitude, lower_sum, word_of
from strapgen.fixedpoint.quantities import ErrorPropagation, Placed, Sum, aligned, largest_wide, nearest, up
from strapgen.fixedpoint.quantization import aligning
from strapgen.ir.integer_program import IntegerOperation, IntegerSum, Scaled, Term, Value
from strapgen.ir.interfaces import ErrorFeedback

EXACT = Known(4, -7, 7)
OFF = Known(4, -9, 9, Fraction(1, 40))
LESS = Known(3, -5, 5, Fraction(1, 30))
AB = ("a", "b")
ONE = Fraction(1)


def terms(*pairs: tuple[tuple[str, ...], object]) -> Sum:
    return Sum(tuple((names, Fraction(coefficient)) for names, coefficient in pairs))


@dataclass(frozen=True)
class Case:
    """A sum of known quantities, its value, and by how much less than the bound the worst input is off."""

    known: dict[str, Known]
    definition: Sum
    exact: Callable[..., Fraction]
    slack: Fraction = Fraction(0)
    word: bool = False
    settings: dict = field(default_factory=dict)
    forced: dict = field(default_factory=dict)
    wider: int = 0


#: What is only added at full precision is not rounded: the errors of its terms are all there is.
CASES = {
    "a product of two inexact factors": Case({"a": OFF, "b": LESS}, terms((AB, 1)), lambda a, b: a * b),
    "four times an inexact value": Case({"a": OFF}, terms((("a",), 4)), lambda a: 4 * a),
    "an eighth of a product": Case(
        {"a": OFF, "b": LESS}, terms((AB, Fraction(-1, 8))), lambda a, b: -a * b / 8
    ),
    # The factor is 77/128, more than 3/5: its error acts on the computed value, whose end is the farthest.
    "three fifths of an inexact value": Case(
        {"a": OFF}, terms((("a",), Fraction(3, 5))), lambda a: a * Fraction(3, 5)
    ),
    "a third, which has no finite expansion": Case(
        {"a": EXACT}, terms((("a",), 1), ((), Fraction(1, 3))), lambda a: a + Fraction(1, 3)
    ),
    # Half a unit of the last place, and none of the two values is inexact.
    "one rounding to the nearest": Case(
        {"a": EXACT, "b": EXACT}, terms((AB, 1)), lambda a, b: a * b, word=True, forced={"y": 5}
    ),
    # All but the last bit of a unit is cut off.
    "one truncation": Case(
        {"a": EXACT, "b": EXACT},
        terms((AB, 1)),
        lambda a, b: a * b,
        Fraction(1, 1 << 8),
        True,
        {"rounding": "truncation"},
        {"y": 5},
        wider=1,  # nothing is cut off upwards
    ),
    # What is finer than the last place is rounded, and what is not is added to it, each with its error.
    "fine and coarse terms": Case(
        {"a": OFF, "c": LESS},
        terms((("a",), Fraction(1, 16)), (("c",), 1)),
        lambda a, c: a / 16 + c,
        word=True,
        forced={"y": 5},
    ),
    # The wide number has no room for the last places of the small term: they are cut off, up to a unit of its last.
    "a term shifted down": Case(
        {"a": Known(18, -33, 33), "b": Known(4, -7, 7)},
        terms((("a",), 1), (("b",), 1)),
        lambda a, b: a + b,
        Fraction(1, 1 << 18),
        wider=1,
    ),
    # A seventh is rounded down to the places of the finest term, and down again to those that there is room for.
    "a constant shifted down": Case(
        {"a": Known(13, -33, 33), "b": Known(0, -24, 24)},
        terms((("a",), 1), (("b",), 1), ((), Fraction(1, 7))),
        lambda a, b: a + b + Fraction(1, 7),
        Fraction(1, 1 << 13),
        wider=2,
    ),
    # The rounded part is -2 at most, one more than the eighth of its integer: that is the largest partial sum.
    "a truncation beside a large term": Case(
        {"a": Known(2, -3, 3), "b": Known(2, -3, 3), "c": Known(1, -20, 20)},
        terms((AB, 1), (("c",), 1)),
        lambda a, b, c: a * b + c,
        Fraction(1, 1 << 4),
        True,
        {"rounding": "truncation"},
        {"y": 1},
        wider=1,
    ),
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES)
def test_the_bound_of_a_sum_is_attained(case):
    item = quantity("y", case.definition, *at_corners(case.known, case.exact))
    walk = context(case.known, item, words=["y"] if case.word else [], forced=case.forced, **case.settings)
    lower_sum(walk, item, case.definition)
    value, measured = walk.values["y"], worst(walk, "y", case.known, case.exact)
    assert measured.error + case.slack <= value.error <= measured.error + case.slack + GRID
    # Ends are exact but for an integer, and so are partial sums but for what shifts may add.
    assert value.low <= measured.low <= value.low + 1 + case.wider
    assert value.high - 1 - case.wider <= measured.high <= value.high
    assert measured.peak <= value.peak <= measured.peak + 2


def lowered(known: dict[str, Known], item, **options):
    """Return the value of a sum, and the walk that has it."""
    walk = context(known, item, **options)
    lower_sum(walk, item, item.definition)
    return walk.values[item.name], walk


@pytest.mark.parametrize("rounding", ["nearest", "truncation"])
@pytest.mark.parametrize(("places", "fraction"), [(8, 5), (15, 2), (12, 4)])
def test_error_bound_of_feedback_is_attained(places, fraction, rounding):
    """Of an exact product, the word and what it feeds back lack no more than the error less two roundings of a unit.

    Feedback of 8 bits begins 8 places below the word: a finer sum is cut off there, a coarser one cuts off feedback.
    """
    known = {"a": Known(places - 1, -7, 7), "b": Known(1, -7, 7)}
    item = quantity("y", terms((AB, 1)), *at_corners(known, lambda a, b: a * b))
    value, walk = lowered(
        known,
        item,
        forced={"y": fraction},
        feedback={"y": "left"},
        carry="state",
        rounding=rounding,
    )
    definition, unit = value.definition, Fraction(1, 1 << (fraction + 8))
    lost, errors, sizes = [], [], []
    for a in range(-7, 8):
        for b in range(-7, 8):
            for left in (0, 1, 127, 128, 255):
                inside = with_feedback(definition, {"a": a, "b": b, "left": left})
                after = (inside << -definition.residual.shift) & 255
                integer = inside >> definition.shift
                exact = Fraction(a * b, 1 << places)
                word = integer * Fraction(2) ** -value.fraction
                errors.append(abs(word - exact))
                lost.append(abs(word + after * unit - exact - left * unit))
                again, partial = computed(definition, {"a": a, "b": b, "left": left}, rounding == "nearest")
                assert value.low <= integer == again <= value.high
                sizes += partial
    assert max(sizes) <= value.peak
    if not definition.drop:  # else the sum is larger before places are dropped
        assert value.peak <= max(sizes) + 2 ** max(0, definition.shift - 8)
    two = 2 * walk.rounding_error / (1 << fraction)
    finest = Fraction(1, 1 << min(places, fraction + 8))
    assert max(lost) <= value.error - two == finest
    # All of a unit but the last bit of the coarser of both, unless neither is cut off.
    if places != fraction + 8:
        assert max(lost) >= finest - Fraction(1, 1 << max(places, fraction + 8))
    assert max(errors) <= value.error
    if rounding == "nearest":  # then two roundings are a unit of the last place
        assert max(errors) >= two - 2 * finest


def test_no_shift_drops_all_bits_of_a_wide_number_but_its_sign():
    known = {"a": Known(15, -99, 99, wide=True)}
    item = quantity("y", terms((("a",), 1)), *at_corners(known, lambda a: a))
    value, walk = lowered(known, item, words=["y"], forced={"y": 0})
    measured = worst(walk, "y", known, lambda a: a)
    assert (value.definition.shift, [term.shift for term in value.definition.fine]) == (14, [-1])
    assert measured.error <= value.error


#: A value that is only added up, one that is rounded, and a word that is not.
FORMS = {"wide": {}, "rounded": {"forced": {"y": 2}}, "word": {"forced": {"y": 4}}}


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_functions_add_slope_times_error_or_their_whole_range(form):
    known = {"a": OFF, "b": LESS, "c": EXACT}
    plain = quantity("y", terms((("a",), 1)), -2, 2)
    base = lowered(known, plain, **form)[0]

    def added(slopes, most) -> Fraction:
        value = lowered(known, replace(plain, inherited_error=ErrorPropagation(slopes, most)), **form)[0]
        assert (value.low, value.high) == (
            base.low,
            base.high,
        )  # an exact value lies in its range wherever it is
        return value.error - base.error

    most = Fraction(4)
    steep, jump = (("a", Fraction(3)), ("b", Fraction(1, 2))), (("a", Fraction(1)), ("c", None))
    assert 0 <= added(steep, most) - 3 * OFF.error - LESS.error / 2 < GRID
    assert 0 <= added(steep, Fraction(1, 100)) - Fraction(1, 100) < GRID
    assert 0 <= added(jump, most) - OFF.error < GRID  # nothing is wrong with the value at which it jumps
    assert added((("b", None),), most) == most


def test_truncation_is_added_to_error_and_range():
    left_out = Fraction(1, 9)
    item = quantity("y", terms((("a",), 1)), -2, 2)
    base, more = (
        lowered({"a": OFF}, replace(item, approximation_error=by))[0] for by in (Fraction(0), left_out)
    )
    assert left_out <= more.error - base.error < left_out + GRID
    assert (more.low, more.high) == (base.low - 2, base.high + 2)  # a ninth is nearly two sixteenths


def test_a_wide_value_is_rounded_to_a_word_with_the_error_that_it_has():
    wide = {"a": Known(12, 900, 1100, Fraction(1, 900), wide=True)}
    walk = context(wide)
    rounded = walk.values[word_of(walk, "a")]
    measured = worst(walk, rounded.name, wide, lambda a: a)
    # Half a unit less half of the last place of the wide number, which rounds to the nearest exactly.
    assert measured.error <= rounded.error <= measured.error + GRID
    assert rounded.magnitude <= 127
    assert word_of(walk, "a") == rounded.name
    assert word_of(walk, rounded.name) == rounded.name


@pytest.mark.parametrize(
    ("constraint", "name", "attitude"), [("unit", "a", True), ("unit", "b", False), ("", "a", False)]
)
def test_only_elements_of_an_output_that_is_an_attitude_saturate(constraint, name, attitude):
    walk = context({"a": EXACT, "b": EXACT})
    walk.quantities.results["next"] = ("a",)
    walk.program.outputs = (SimpleNamespace(signal=SimpleNamespace(name="next", constraint=constraint)),)
    assert _is_attitude(walk, name) is attitude


# What a check of a sum of squares says of its parts


def in_accepted_calls(walk, name: str, known: dict[str, Known], exact) -> tuple[Fraction, Fraction]:
    """Return the largest error of a value, and the largest exact sum of squares, where the check of "y" passes."""
    check, value = walk.values["y"], walk.values[name]
    error = largest = Fraction(0)
    for integers in product(*(range(item.low, item.high + 1) for item in known.values())):
        whole = dict(zip(known, integers, strict=True))
        whole["y"], _ = computed(check.definition, whole, nearest=True)
        if not check.low <= whole["y"] <= check.high:
            continue
        integer, _ = computed(value.definition, whole, nearest=True)
        for row in product(*(item.exact(whole[key]) for key, item in known.items())):
            error = max(error, abs(integer * Fraction(2) ** -value.fraction - exact(*row)))
            largest = max(largest, sum((x * x for x in row[:2]), Fraction(0)))
    return error, largest


@pytest.mark.long
def test_checked_sum_of_squares_bounds_the_factors():
    """An element of 15/4 is possible, but with squares of 4 together none above 2 is accepted."""
    known = {name: Known(2, -15, 15, Fraction(1, 50)) for name in "ab"} | {
        "c": Known(3, -7, 7, Fraction(1, 90))
    }
    check = quantity("y", Sum(((("a", "a"), ONE), (("b", "b"), ONE))), 1, 4, range_checked=True)
    scaled = quantity("z", Sum(((("a", "c"), ONE),)), -4, 4)
    walk = context(known, check, scaled)
    lower_sum(walk, check, check.definition)
    lower_sum(walk, scaled, scaled.definition)
    assert walk.size("a") == 2
    error, largest = in_accepted_calls(walk, "y", known, lambda a, b, c: a * a + b * b)
    assert largest <= 4  # which is what the check promises
    # Two elements of 2 each would be accepted by none: those of root 2 have the largest error together.
    assert Fraction(3, 5) * walk.values["y"].error < error <= walk.values["y"].error < Fraction(1, 6)
    error, _ = in_accepted_calls(walk, "z", known, lambda a, b, c: a * c)
    assert Fraction(9, 10) * walk.values["z"].error < error <= walk.values["z"].error
    unchecked = context(known, scaled)
    lower_sum(unchecked, scaled, scaled.definition)
    assert walk.values["z"].error < unchecked.values["z"].error


@pytest.mark.parametrize(
    ("terms", "size"),
    [
        (((("a", "a"), ONE), ((), ONE)), math.sqrt(3)),  # 1 is there already
        (((("a", "a"), 4 * ONE), (("b", "b"), ONE)), 1),
        (((("a", "a"), ONE), (("b", "b"), -ONE)), 3.745),  # a difference of squares may be small all the same
        (((("a", "b"), ONE), (("b", "b"), ONE)), 3.745),
        (((("a",), ONE), (("b", "b"), ONE)), 3.745),
    ],
)
def test_only_sums_of_squares_bound_their_terms(terms, size):
    known = {name: Known(2, -15, 15, Fraction(1, 200)) for name in "ab"}
    check = quantity("y", Sum(terms), 1, 4, range_checked=True)
    walk = context(known, check)
    lower_sum(walk, check, check.definition)
    assert float(walk.size("a")) == pytest.approx(size, rel=1e-2)


def test_a_check_whose_value_is_taken_as_exact_says_nothing_of_its_parts(monkeypatch):
    known = {name: Known(2, -15, 15, Fraction(1, 2)) for name in "ab"}
    check = quantity("y", Sum(((("a", "a"), ONE), (("b", "b"), ONE))), Fraction(1, 64), 4, range_checked=True)
    walk = context(known, check)
    monkeypatch.setattr(
        "strapgen.fixedpoint.integer_sums._reset", lambda walk, item: walk.resets.add(item.name)
    )
    lower_sum(walk, check, check.definition)
    assert walk.size("a") > 3


numbers = st.fractions(min_value=-100, max_value=100, max_denominator=10**4)
SETTINGS = settings(derandomize=True, database=None, deadline=None, max_examples=25)


@SETTINGS
@given(numbers)
def test_the_nearest_integer_is_at_most_half_a_unit_away_and_halves_go_up(value):
    assert -Fraction(1, 2) < nearest(value) - value <= Fraction(1, 2)
    assert [nearest(Fraction(n, 2)) for n in (-3, -1, 1, 3)] == [-1, 0, 1, 2]


@SETTINGS
@given(numbers)
def test_bound_is_rounded_up_by_less_than_a_unit(value):
    assert value <= up(value) < value + Fraction(1, 2**100)


@SETTINGS
@given(st.integers(-(10**4), 10**4), st.integers(0, 20), st.integers(0, 20))
def test_constant_at_a_coarser_place_has_its_rounding_error(factor, place, dropped):
    exact = Fraction(factor, 2 ** (place + dropped))
    total = aligned([Placed(Term((), factor), place + dropped, Fraction(1, 8))], place, 32, {})
    written = sum(term.factor * Fraction(2) ** (term.shift - place) for term in total.terms)
    assert (
        abs(written - exact)
        <= total.error - Fraction(1, 8)
        <= Fraction(1, 2 ** (place + 1)) + Fraction(1, 2**100)
    )
    assert total.peak == sum(abs(term.factor) for term in total.terms)


def test_a_wide_number_holds_two_words():
    assert [largest_wide(word) for word in (8, 16, 32)] == [2**15 - 1, 2**31 - 1, 2**63 - 1]


ZERO = Fraction(0)


def value(name: str, definition, fraction: int, magnitude: int) -> Value:
    return Value(name, definition, fraction, False, -magnitude, magnitude, ZERO, ZERO, magnitude)


def names_and_bits(*body: Value, fixed: tuple[str, ...] = ()) -> dict[str, int]:
    """Return by how many bits values may be coarser; the input s has 4 fraction bits and stays below 1."""
    inputs = value("s", None, 4, 16)
    values = {item.name: item for item in (inputs, *body)}
    return {name: values[name].fraction - most for name, most in aligning(body, values, fixed).items()}


@pytest.mark.parametrize("drop", [0, 3, 8])
def test_error_feedback_that_is_coarser_than_a_sum_changes_no_place(drop):
    """The places below the feedback are dropped first, and belong to the sum all the same."""
    # a s ends at place 28, c at place 16, which is 8 bits below the result: of these 12 bits, an error of a that
    # s is multiplied with may add a sixteenth of a unit of the feedback, which is 4 bits finer than the result.
    a = value("a", IntegerSum((Term(("s",), 1),), 4), 24, 1 << 24)
    c = value("c", None, 16, 1 << 10)
    feedback = ErrorFeedback("r", 0, 20, 0)
    total = IntegerSum((Term(("a", "s"), 1), Term(("c",), 1, 12)), 20 - drop, (), feedback, drop)
    assert names_and_bits(a, c, value("y", total, 8, 1 << 8)) == {"a": 8}


def test_values_of_which_every_bit_counts_stay_as_they_are():
    a = value("a", IntegerSum((Term(("s",), 1),), 4), 24, 1 << 24)
    c = value("c", None, 16, 1 << 10)
    total = IntegerSum((Term(("a", "s"), 1), Term(("c",), 1, 12)), 20)
    y = value("y", total, 8, 1 << 8)
    assert names_and_bits(a, c, y) == {"a": 12}
    assert names_and_bits(a, c, y, fixed=("a",)) == {}
    larger = IntegerOperation("maximum", (Scaled("a"), Scaled("a", 1)))
    assert names_and_bits(a, c, y, value("z", larger, 24, 1 << 25)) == {}


def test_factor_of_zero_has_any_format():
    a = value("a", IntegerSum((Term(("s",), 1),), 4), 24, 1 << 24)
    c, nothing = value("c", None, 16, 1 << 10), value("n", None, 4, 0)
    total = IntegerSum((Term(("a", "n"), 1), Term(("c",), 1, 12)), 20)
    # A sum is computed down to 8 bits below its last place, and a n ends 12 bits below those.
    assert names_and_bits(a, c, nothing, value("y", total, 8, 1 << 8)) == {"a": 12}
