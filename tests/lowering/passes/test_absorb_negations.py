"""The pass `absorb_negations`: signs become subtractions, without a change of any value."""

import itertools
from dataclasses import replace
from fractions import Fraction

import pytest

from strapgen.ir.program import Assignment, Constant, Operation, Reference
from strapgen.lowering.passes import absorb_negations


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("y = a + -b", "y = a - b"),
        ("y = -a + b", "y = b - a"),
        ("y = a - -b", "y = a + b"),
        ("y = -a - b", "y = -(a + b)"),
        ("y = -a - -b", "y = b - a"),
        ("y = -a + -b", "y = -(a + b)"),
        ("y = a + b * -c", "y = a - b * c"),
        ("y = a - -b * c / d", "y = a + b * c / d"),
        ("y = a + (-b - c)", "y = a - (b + c)"),
    ],
)
def test_a_sum_takes_signs_in(parse, show, before, after):
    assert show(absorb_negations(parse(before))) == after


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("y = -(-a)", "y = a"),
        ("y = -(a - b)", "y = b - a"),
        ("y = -(c * (a - b))", "y = c * (b - a)"),
        ("y = -((a - b) * c)", "y = (b - a) * c"),
        ("y = -a * (b - c)", "y = a * (c - b)"),
        ("y = -(3 - a)", "y = a - 3"),
    ],
)
def test_a_difference_turns_round(parse, show, before, after):
    assert show(absorb_negations(parse(before))) == after


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("y = -(3 * a)", "y = -3 * a"),
        ("y = -(3 * a + 2 * b)", "y = -3 * a - 2 * b"),
        ("y = -(a + 2 * b + c)", "y = -2 * b - a - c"),
        ("y = a - 3 * b", "y = a - 3 * b"),
        ("y = c - (3 * a + 2 * b)", "y = c - (3 * a + 2 * b)"),
        ("y = -(a * 3)", "y = -(a * 3)"),  # constants stand first, which is another pass's work
        ("y = -(a + b)", "y = -(a + b)"),
    ],
)
def test_a_constant_takes_the_sign_that_no_sum_takes(parse, show, before, after):
    assert show(absorb_negations(parse(before))) == after


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("y = -a * b", "y = -(a * b)"),
        ("y = a * -b", "y = -(a * b)"),
        ("y = -a * -b", "y = a * b"),
        ("y = -a / b", "y = -(a / b)"),
        ("y = a / -b", "y = -(a / b)"),
        ("y = -a / -b", "y = a / b"),
        ("y = a * (-b * -(c * -d))", "y = -(a * (b * (c * d)))"),
    ],
)
def test_products_and_quotients_pass_signs_on(parse, show, before, after):
    assert show(absorb_negations(parse(before))) == after


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("y = cos(-x)", "y = cos(x)"),
        ("y = sinc(-x)", "y = sinc(x)"),
        ("y = sin(-x)", "y = -sin(x)"),
        ("y = a + b * sin(-x)", "y = a - b * sin(x)"),
        ("y = sqrt(-x)", "y = sqrt(-x)"),
        ("y = atan2(-a, b)", "y = atan2(-a, b)"),
        ("y = maximum(-a, -b)", "y = maximum(-a, -b)"),
        ("y = select(at_least(-a, b), -c, d)", "y = select(at_least(-a, b), -c, d)"),
    ],
)
def test_functions_know_whether_they_are_even(parse, show, before, after):
    assert show(absorb_negations(parse(before))) == after


def test_a_name_that_stands_for_nothing_loses_its_sign(parse, show):
    before = parse("shared_1 = -(a * b); y = c + shared_1; z = c - shared_1; w = cos(shared_1)")
    assert show(absorb_negations(before)) == (
        "shared_1 = a * b; y = c - shared_1; z = c + shared_1; w = cos(shared_1)"
    )
    before = parse("factor_1 = a * -b; y = factor_1 * factor_1")
    assert show(absorb_negations(before)) == "factor_1 = a * b; y = factor_1 * factor_1"


@pytest.mark.parametrize("text", ["part = -a; y = c + part", "part = -(a * b); y = c - part"])
def test_a_name_that_means_something_keeps_its_sign(parse, text):
    program = parse(text)
    assert absorb_negations(program) == program


def test_results_keep_their_signs(parse, show):
    text = "shared_1 = -(a * b); y = c + shared_1"
    for results, transition in (("y shared_1", ""), ("y", "shared_1")):
        program = parse(text, results, transition)
        assert absorb_negations(program) == program
    assert show(absorb_negations(parse(text))) == "shared_1 = a * b; y = c - shared_1"


@pytest.mark.parametrize("text", ["y = a - b", "y = -(a * b)", "y = -a", "y = sqrt(-a)", "y = -(sin(x) / 2)"])
def test_without_signs_to_move_the_program_stays_the_same(parse, text):
    program = parse(text)
    assert absorb_negations(program) == program


def test_without_signs_nothing_is_even_copied(parse):
    program = parse("y = a - b * c; w = cos(y) / 2")
    assert absorb_negations(program) is program


def test_a_sign_becomes_part_of_a_number(parse, show):
    assert show(absorb_negations(parse("y = a * -(-(-3))"))) == "y = a * -3"
    program = parse("shared_1 = 2; y = shared_1 - x")
    assert absorb_negations(program) == program


def test_the_negative_of_a_number_is_a_number(parse, show):
    minus = Operation("negate", (Constant(Fraction(3)),))
    body = (Assignment("y", Operation("multiply", (Reference("a"), minus))),)
    assert show(absorb_negations(replace(parse("y = a"), body=body))) == "y = a * -3"


def test_signs_move_through_several_names(parse):
    first = ("-a", "-(a * b)", "b - a", "-(-a)", "-a - b")
    second = (
        "-shared_1",
        "-(shared_1 * c)",
        "-shared_1 - c",
        "c - shared_1",
        "-(c + shared_1)",
        "-a * shared_1",
    )
    last = ("shared_2 + shared_1", "-shared_2", "a * shared_2", "-(shared_1 - shared_2)", "cos(shared_2)")
    point = {"a": Fraction(2), "b": Fraction(-3), "c": Fraction(7, 2)}
    for lines in itertools.product(first, second, last):
        before = parse("shared_1 = {}; shared_2 = {}; y = {}".format(*lines))
        values = {name: point[name] for signal in before.inputs for name in signal.elements}
        assert absorb_negations(before).run(values) == before.run(values), lines
