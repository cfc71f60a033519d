"""The pass `fold_constants`: numbers meet numbers, exactly."""

import pytest

from strapgen.lowering.passes import fold_constants


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("y = 2 * (3 * x)", "y = 6 * x"),
        ("y = x * 3", "y = 3 * x"),
        ("y = x * 2 * 3 * z", "y = 6 * (x * z)"),
        ("y = 2 * x * (3 * z)", "y = 6 * (x * z)"),
        ("y = 2 * x / 4", "y = q(1, 2) * x"),
        ("y = x / 3 * 3", "y = x"),
        ("y = q(1, 2) * (q(2, 3) * x)", "y = q(1, 3) * x"),
        ("y = 1 * x", "y = x"),
        ("y = 2 * (3 * (4 * sqrt(2 * (5 * x))))", "y = 24 * sqrt(10 * x)"),
    ],
)
def test_the_numbers_of_a_product_are_gathered_in_front_of_it(parse, show, before, after):
    assert show(fold_constants(parse(before))) == after


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("y = x / 3", "y = q(1, 3) * x"),
        ("y = x / 2 / 3", "y = q(1, 6) * x"),
        ("y = x / q(2, 3)", "y = q(3, 2) * x"),
        ("y = x / -3", "y = -(q(1, 3) * x)"),
        ("y = x / 1", "y = x"),
        ("y = x * z / 7 + 1", "y = q(1, 7) * (x * z) + 1"),
    ],
)
def test_a_division_by_a_number_is_one_multiplication(parse, show, before, after):
    assert show(fold_constants(parse(before))) == after


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("y = 2 / (3 * x)", "y = q(2, 3) / x"),
        ("y = -2 / (3 * x)", "y = -(q(2, 3) / x)"),
        ("y = 1 / (x / 5)", "y = 5 / x"),
        ("y = 2 * x / (6 * z)", "y = q(1, 3) * (x / z)"),
        ("y = 2 / x", "y = 2 / x"),
    ],
)
def test_a_quotient_keeps_one_number(parse, show, before, after):
    # The numerator of a reciprocal is the place for it: 2/x is one operation.
    assert show(fold_constants(parse(before))) == after


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("y = 1 + 2 * 3", "y = 7"),
        ("y = 1 / 3 - q(1, 3)", "y = 0"),
        ("y = -(2 * 3)", "y = -6"),
        ("y = x + (1 - 1)", "y = x"),
        ("y = 0 + x", "y = x"),
        ("y = x - 0", "y = x"),
        ("y = 0 - x", "y = -x"),
        ("y = 0 * x + z", "y = z"),
        ("y = sin(x) * (2 - 2)", "y = 0"),
        ("y = select(at_least(x, 1 + 1), 2 * 2, x)", "y = select(at_least(x, 2), 4, x)"),
    ],
)
def test_what_is_known_is_carried_out(parse, show, before, after):
    assert show(fold_constants(parse(before))) == after


def test_signs_are_taken_out_of_products(parse, show):
    assert show(fold_constants(parse("y = -x * (2 * z)"))) == "y = -(2 * (x * z))"
    assert show(fold_constants(parse("y = -x * -z"))) == "y = x * z"
    assert show(fold_constants(parse("y = 3 * -(2 * x)"))) == "y = -(6 * x)"


@pytest.mark.parametrize("text", ["y = sqrt(2) * x", "y = sin(1)", "y = maximum(1, 2)", "y = atan2(0, 1)"])
def test_only_what_is_exact_is_carried_out(parse, text):
    program = parse(text)
    assert fold_constants(program) == program


@pytest.mark.parametrize("text", ["y = x / 0", "y = 3 / 0", "y = 0 / 0", "y = x * z / 0", "y = 1 / (1 / 0)"])
def test_a_division_by_zero_is_left_to_the_one_who_runs_it(parse, text):
    program = parse(text)
    assert fold_constants(program) == program
    with pytest.raises(ZeroDivisionError):
        program.run({"x": 1, "z": 1})


@pytest.mark.parametrize("text", ["y = x * z", "y = 2 * x + 3", "y = -(2 * x)", "y = x - z", "y = 3 / x"])
def test_where_no_numbers_meet_the_program_stays_the_same(parse, text):
    program = parse(text)
    assert fold_constants(program) == program


def test_without_products_nothing_is_even_copied(parse):
    program = parse("y = x - z; w = sqrt(y) + 2")
    assert fold_constants(program) is program


def test_a_scaling_moves_through_a_name_that_is_only_scaled_again(parse, show):
    before = parse("shared_1 = 2 * (x + z); a = 3 * shared_1; b = shared_1 / 4 + z")
    assert show(fold_constants(before)) == "shared_1 = x + z; a = 6 * shared_1; b = q(1, 2) * shared_1 + z"


def test_a_scaling_moves_through_several_names(parse, show):
    before = parse("shared_1 = 2 * x * x; factor_1 = 3 * shared_1; a = 5 * factor_1")
    once = fold_constants(before)
    assert show(once) == "shared_1 = x * x; factor_1 = 2 * shared_1; a = 15 * factor_1"
    assert show(fold_constants(once)) == "shared_1 = x * x; factor_1 = shared_1; a = 30 * factor_1"


@pytest.mark.parametrize(
    "text",
    [
        "shared_1 = 2 * x; a = 3 * shared_1; b = shared_1 + z",  # one use takes it as it is
        "shared_1 = 2 * x; a = 3 * shared_1; b = -shared_1",  # a sign is no operation that would be saved
        "shared_1 = 2 * x; a = shared_1 * z",
        "part = 2 * x; a = 3 * part",  # the name says what it holds
        "shared_1 = x + z; a = 3 * shared_1",
    ],
)
def test_a_scaling_stays_where_it_is_needed(parse, text):
    program = parse(text)
    assert fold_constants(program) == program


def test_a_scaling_stays_in_a_result(parse):
    program = parse("shared_1 = 2 * x; a = 3 * shared_1", results="a shared_1")
    assert fold_constants(program) == program
    program = parse("shared_1 = 2 * x; a = 3 * shared_1", results="a", transition="shared_1")
    assert fold_constants(program) == program
