"""Quantities and integers: what is chosen, what a user may fix, what is refused."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise, product

import numpy as np
import pytest
from derived import FIXED_POINT, program
from hypothesis import given, settings
from hypothesis import strategies as st

from strapgen import generate, quantize
from strapgen.catalogue import Choice
from strapgen.fixedpoint.derivation import quantities
from strapgen.fixedpoint.integer_sums import _is_polynomial
from strapgen.fixedpoint.intervals import Interval
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import IntegerSum
from strapgen.ir.kernel_info import KernelInfo
from strapgen.ir.program import Assignment, Constant, Operation, Program, Reference, Result
from strapgen.ir.signals import Signal
from strapgen.run.compiled_code import ModelEvaluator

EULER = Choice("euler", "rk4", 2)


def hand_made(body: dict[str, object], *outputs: str, bound: object = 1) -> Program:
    """Return a program of three inputs up to a bound."""
    x = Signal("x", (3,), ("x_1", "x_2", "x_3"), bound=Fraction(bound))
    y = Signal("y", (len(outputs),), tuple(f"y_{k}" for k in range(len(outputs))))
    assignments = tuple(Assignment(name, value) for name, value in body.items())
    return Program(
        KernelInfo("made", "Made by hand", "", arguments="made"),
        (x,),
        assignments,
        (Result(y, tuple(map(Reference, outputs))),),
    )


def op(kind, *arguments):
    return Operation(kind, tuple(Reference(a) if isinstance(a, str) else a for a in arguments))


def number(value):
    return Constant(Fraction(value))


@st.composite
def polynomials(draw):
    """Programs of sums and products, of up to six assignments."""
    names = ["x_1", "x_2", "x_3"]
    body = {}
    for k in range(draw(st.integers(1, 6))):

        def leaf():
            if draw(st.integers(0, 4)) == 0:
                return Constant(draw(st.fractions(min_value=-2, max_value=2, max_denominator=48)))
            return Reference(draw(st.sampled_from(names)))

        def tree(depth):
            if depth == 0:
                return leaf()
            kind = draw(st.sampled_from(["add", "subtract", "multiply"]))
            return Operation(kind, (tree(depth - 1), tree(draw(st.integers(0, depth - 1)))))

        body[f"v_{k}"] = tree(draw(st.integers(1, 2)))
        names.append(f"v_{k}")
    return hand_made(body, names[-1])


@settings(max_examples=30, deadline=None)
@given(polynomials(), st.sampled_from([8, 16, 32, 64]), st.sampled_from(["nearest", "truncation"]), st.data())
def test_any_polynomial_keeps_its_bound(made, word, rounding, data):
    try:
        fixed = quantize(made, Settings(word, rounding=rounding))
    except InputError as error:
        assert word == 8 and "too short" in str(error)
        return
    model = ModelEvaluator(generate(fixed, "fixed-model"))
    (given_,), (result,) = fixed.interface.inputs, fixed.interface.outputs
    for _ in range(5):
        integers = [data.draw(st.integers(given_.low, given_.high)) for _ in range(3)]
        (computed,) = model.step(integers)
        values = {n: i * given_.format.unit for n, i in zip(given_.signal.elements, integers, strict=True)}
        (wanted,) = made.run(values).values()
        assert abs(computed[0] * result.format.unit - wanted[0]) <= result.errors[0]


@pytest.mark.parametrize("word", [8, 32])
def test_product_with_zero_is_zero(word):
    body = {
        "zero": op("subtract", "x_1", "x_1"),
        "again": op("add", "x_2", "zero"),
        "none": op("subtract", "x_2", "again"),
        "y": op("multiply", "x_1", "none"),
    }
    fixed = quantize(hand_made(body, "y"), Settings(word))
    assert ModelEvaluator(generate(fixed, "fixed-model")).step([5, -3, 2]) == ((0,),)
    assert fixed.error_bounds["y"] <= Fraction(1, 1 << word)


@pytest.mark.parametrize(
    ("near", "apart"),
    [
        (op("add", "x_1", op("multiply", number(2), "x_2")), True),
        (op("multiply", number(Fraction(1, 3)), "x_1"), False),
        (op("multiply", "x_1", "x_2"), False),
    ],
)
def test_only_exact_sums_of_inputs_are_split_off(near, apart):
    box = {name: Interval.symmetric(Fraction(1, 8)) for name in ("x_1", "x_2", "x_3")}
    small = op("multiply", op("multiply", "x_3", "x_2"), number(Fraction(1, 64)))
    body = {"near": near, "sum": op("add", "near", small), "y": op("multiply", "sum", "x_1")}
    total = quantities(hand_made(body, "y"), box, split=True).items["sum"]
    assert total.exact_addends == (((("near",), Fraction(1)),) if apart else ())
    assert (("near",) in dict(total.definition.terms)) is not apart
    assert not quantities(hand_made(body, "y"), box).items["sum"].exact_addends


def test_values_near_a_constant_are_stored_as_distances():
    box = {name: Interval.symmetric(Fraction(1, 8)) for name in ("x_1", "x_2", "x_3")}
    body = {
        "near": op("subtract", number(1), op("multiply", "x_1", "x_2")),
        "y": op("multiply", "near", "x_3"),
    }
    made = quantities(hand_made(body, "y"), box).items
    assert made["near"].offset == 1
    assert made["near"].range.magnitude == Fraction(1, 64)
    # 1 x_3 exactly, and a product.
    assert dict(made["y"].definition.terms) == {("x_3",): 1, ("near", "x_3"): 1}


def test_ranges_are_tighter_than_plain_intervals():
    box = {name: Interval.symmetric(1) for name in ("x_1", "x_2", "x_3")}
    body = {
        "sum": op("add", "x_1", "x_2"),
        "back": op("subtract", "sum", "x_2"),  # x_1: plain intervals give 3
        "square": op("multiply", "sum", "sum"),  # not negative
        "cubic": op("multiply", op("multiply", "x_1", "x_1"), op("subtract", "x_1", number(1))),
        "last": op("add", op("add", "back", "square"), "cubic"),
    }
    made = quantities(hand_made(body, "last"), box).items
    assert made["back"].range == Interval.symmetric(1)
    assert made["square"].range == Interval.of(0, 4)


def test_the_largest_of_several_is_at_least_their_mean():
    # x and 1 - x are both as low as -1 and 0, but the larger one is 1/2 or more.
    box = {name: Interval.symmetric(1) for name in ("x_1", "x_2", "x_3")}
    body = {"y": op("maximum", "x_1", op("subtract", number(1), "x_1"))}
    assert quantities(hand_made(body, "y"), box).items["y"].range == Interval.of(Fraction(1, 2), 2)


def test_a_cut_of_the_box_saves_a_bit():
    # x (1 - x) on [0, 1] is at most 1/4; an interval of the product alone gives 1, of the expansion 1.
    box = {name: Interval.of(0, 1) for name in ("x_1", "x_2", "x_3")}
    body = {
        "rest": op("subtract", number(1), "x_1"),
        "cube": op("multiply", op("multiply", "x_1", "rest"), op("multiply", "x_1", "rest")),
        "y": op("add", "cube", "x_2"),
    }
    made = quantities(hand_made(body, "y"), box).items
    product = next(q for name, q in made.items() if name.startswith("cube_factor"))
    assert product.range.magnitude <= Fraction(1, 2)


def test_products_by_a_value_and_by_a_number_are_counted_and_shifts_are_not():
    terms = [op("multiply", number(3), "x_1"), op("multiply", "x_2", "x_3"), op("multiply", number(4), "x_2")]
    counts = []
    for used in (terms[:1], terms[:2], terms):
        total = used[0]
        for term in used[1:]:
            total = op("add", total, term)
        counts.append(quantize(hand_made({"y": total}, "y"), Settings(32)).operations["multiply"])
    assert counts == [1, 2, 2]


def test_values_with_a_root_are_no_polynomials():
    box = {name: Interval.symmetric(1) for name in ("x_1", "x_2", "x_3")}
    body = {
        "sum": op("add", op("multiply", "x_1", "x_1"), number(1)),
        "cube": op("multiply", "sum", "x_3"),
        "root": op("sqrt", "sum"),
        "y": op("multiply", "root", "x_2"),
    }
    made = quantities(hand_made(body, "cube", "y"), box)
    assert {name: _is_polynomial(made, name) for name in body} == {
        "sum": True,
        "cube": True,
        "root": False,
        "y": False,
    }


def test_sums_of_increments_are_exact():
    for count in (2, 3, 4):
        fixed = quantize(program(Choice("euler", "rk2", count)), Settings(16))
        for value in fixed.body:
            if value.name in ("sigma_x", "sigma_y", "sigma_z"):
                assert value.error == 0 and value.definition.shift == 0


def test_a_user_fixes_formats():
    settings_ = Settings(32, formats={"increments": "Q0.31", "p_x": "Q0.31", "state": "Q2.29"})
    fixed = quantize(program(EULER), settings_)
    formats = {name: str(format_) for name, format_ in fixed.formats.items()}
    assert formats["increments"] == formats["p_x"] == "Q0.31"
    assert formats["state"] == formats["next"] == "Q2.29"
    assert formats["p_y"] != "Q0.31"


@pytest.mark.parametrize(
    ("formats", "said"),
    [
        ({"increments": "Q-9.40"}, "format Q-9.40 of increments does not hold its range of \\+-0.125"),
        ({"p_x": "Q-9.40"}, "format Q-9.40 of p_x does not hold its range"),
        ({"q_x": "Q0.31"}, "has no value 'q_x'; its values are: state, increments"),
        ({"d1_x": "Q0.31"}, "give the format of the whole input"),
        ({"state": "Q0.31"}, "format Q0.31 of state does not hold its range of \\+-1.0625"),
        ({"next": "Q0.31"}, "format Q0.31 of next_s does not hold its range \\[-1.0625, 1.0625\\]"),
        (
            {"next_x": "Q2.29"},
            "elements of next share one format; fix the format of next, not of one element",
        ),
    ],
)
def test_formats_that_do_not_hold_their_values(formats, said):
    with pytest.raises(InputError, match=said):
        quantize(program(EULER), Settings(32, formats=formats))


def test_next_input_is_checked_in_the_output_format():
    # The sum of angles is accepted up to 0.4, and its successor is not proved to be below.
    formats = {"angle_sum": "Q3.28", "next_angle_sum": "Q-1.32"}
    ranges = {"angle_sum": Fraction(2, 5), "coning": Fraction(1, 10)}
    ranges |= dict.fromkeys(("previous_increment", "increment"), Fraction(1, 8))
    fixed = quantize(program(Choice("coning-fast")), Settings(ranges=ranges, formats=formats))
    assert fixed.ranges["next_angle_sum"][1] == pytest.approx(0.4)


def test_ranges_of_inputs_must_be_known():
    with pytest.raises(InputError, match="constant-increments: the range of input middle is not known"):
        quantize(program(Choice("constant-increments")), Settings())
    with pytest.raises(InputError, match="has no input 'speed'; its inputs are: state, increments"):
        quantize(program(EULER), Settings(ranges={"speed": Fraction(1)}))


def test_products_meet_at_one_place_where_that_costs_nothing():
    fixed = quantize(program(EULER), Settings.of(max_rate_deg_s=12, step="0.125", increments=2))
    values = {value.name: value for value in fixed.body}
    for name in ("p_x", "p_y", "p_z"):
        definition = values[name].definition
        assert isinstance(definition, IntegerSum)
        assert all(term.shift >= 0 for term in definition.fine)
    assert fixed.error_bounds["next"] < Fraction(52, 100) * Fraction(1, 2**30)


def test_longer_words_have_smaller_bounds():
    bounds = [quantize(program(EULER), Settings(word)).error_bounds["next"] for word in range(8, 65, 4)]
    assert all(a > b for a, b in pairwise(bounds))
    assert bounds[0] / bounds[-1] > 2**55


#: Kernels for integers; of the longest steps, many seconds each in all settings, the longest with the long tests.
LOWERED = [
    pytest.param(c, marks=pytest.mark.long if c.kernel == "dcm-rk4-2" else (), id=c.kernel)
    for c in FIXED_POINT
    if c.kernel != "dcm-rk3-2"
]


CARRIES, ANGLES, ROUNDINGS = (
    ("none", "state", "full"),
    (Fraction(1, 10**6), Fraction(1, 8), Fraction(1)),
    ("nearest", "truncation"),
)
#: Every angle with every carry, and every rounding with each of both.
IN_PAIRS = [
    (CARRIES[i], ANGLES[k], ROUNDINGS[(i + k) % 2]) for i in range(len(CARRIES)) for k in range(len(ANGLES))
]


def test_the_settings_in_pairs_have_all_pairs():
    for one, other, count in ((0, 1, 9), (0, 2, 6), (1, 2, 6)):
        assert len({(row[one], row[other]) for row in IN_PAIRS}) == count


@pytest.mark.long
@pytest.mark.parametrize("word", (8, 16, 32, 64))
@pytest.mark.parametrize("choice", LOWERED)
def test_no_value_and_no_partial_sum_leaves_its_type(choice, word):
    # Small and large angles where words are shortest and as most use them; the others differ in their last bits only.
    if word in (8, 16):
        several = IN_PAIRS if choice.method else [*product(CARRIES, ANGLES[1:2], ROUNDINGS)]
    else:
        several = [row for row in IN_PAIRS if row[1] == ANGLES[1]]
        assert {rounding for _, _, rounding in several} == {*ROUNDINGS}
    for carry, angle, rounding in several:
        too_short = {
            "dcm-orthonormalize-optimal": ("nearest", "truncation"),
            "euler-angles-from-dcm": ("truncation",),
        }
        if word == 8 and rounding in too_short.get(choice.name, ()):
            with pytest.raises(InputError, match="words of 8 bits are too short"):
                quantize(program(choice), Settings(word, angle, rounding, carry))
            continue
        fixed = quantize(program(choice), Settings(word, angle, rounding, carry))
        for value in fixed.body:
            bits = word * (1 + value.wide)
            assert -(2 ** (bits - 1)) <= value.low <= value.high < 2 ** (bits - 1), value.name
            assert value.peak < 2 ** (2 * word - 1), value.name
            if isinstance(value.definition, IntegerSum):
                terms = (*value.definition.fine, *value.definition.coarse)
                shifts = [value.definition.shift, value.definition.drop, *(abs(t.shift) for t in terms)]
                assert max(shifts) < 2 * word, value.name


def test_large_terms_that_cancel_are_refused():
    # The sum is proved to be small; what is added up on the way is not.
    large = number(2**40)
    body = {
        "sum": op("add", "x_1", "x_2"),
        "kept": op("multiply", "sum", "x_3"),
        "less": op("subtract", op("multiply", large, "sum"), op("multiply", large, "x_1")),
        "y": op("add", op("subtract", "less", op("multiply", large, "x_2")), "x_3"),
    }
    made = hand_made(body, "kept", "y")
    assert quantize(made, Settings(64)).ranges["y"][1] < 2
    with pytest.raises(InputError, match="words of 16 bits are too short for y"):
        quantize(made, Settings(16))


def test_a_word_whose_errors_go_beyond_the_range_of_a_result_is_too_short():
    # Its range is [-1.8, 1]; truncation in words of 8 bits adds more than the format of that range holds.
    body = {
        "v_0": op("multiply", op("add", "x_1", "x_1"), op("add", "x_1", number(Fraction(1, 6)))),
        "v_2": op("multiply", op("add", "x_1", "v_0"), op("subtract", "x_1", number(Fraction(22, 23)))),
    }
    with pytest.raises(InputError, match="words of 8 bits are too short for v_2"):
        quantize(hand_made(body, "v_2"), Settings(8, rounding="truncation"))


def test_full_feedback_has_a_residual_for_each_element_of_state_and_transition():
    assert len(quantize(program(EULER), Settings(16, carry="full")).interface.residuals) == 8


def test_a_division_by_zero_is_refused():
    body = {"y": op("divide", "x_1", op("subtract", number(1), number(1)))}
    with pytest.raises(InputError, match="made has no fixed point: a program divides by zero"):
        quantize(hand_made(body, "y"), Settings(16))


def test_a_constant_output_and_a_repeated_one():
    body = {"one": number(1), "twice": op("multiply", number(2), "x_1")}
    fixed = quantize(hand_made(body, "one", "twice", "twice"), Settings(16))
    (result,) = fixed.interface.outputs
    assert result.errors == (0, 0, 0)
    assert len(set(result.values)) == 3
    assert np.isfinite(float(result.format.unit))
