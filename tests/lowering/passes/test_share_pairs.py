"""The pass `share_pairs`: sums and products are sets of terms and factors."""

import pytest

from strapgen.lowering.passes import share_pairs


def saved(parse, text: str, results: str = "") -> dict[str, int]:
    """Return how many operations are saved, by kind."""
    before = parse(text, results)
    after = share_pairs(before).operations
    return {kind: n - after[kind] for kind, n in before.operations.items() if n != after[kind]}


@pytest.mark.parametrize(
    ("text", "operations"),
    [
        ("y = x * x + z * z; w = a * a + z * z + x * x", {"add": 1, "multiply": 2}),
        ("y = a + b + c; z = c + d + a", {"add": 1}),
        ("y = a + (b + c); z = (c + a) + d", {"add": 1}),
        ("y = a - b; z = c + b - a", {"add": 1}),
        ("y = a - b - c; z = d + c + b", {"add": 1}),
        ("y = a * b * c; z = d * (c * a)", {"multiply": 1}),
        ("y = a * b * c; z = a * c * d; w = c * e * a", {"multiply": 2}),
        ("y = sin(a + b + c); z = select(at_least(c + a, 0), x, z_0)", {"add": 1}),
        ("y = a + b + c + d; z = d + c + b + a", {"add": 3}),
    ],
)
def test_a_pair_is_computed_once(parse, text, operations):
    assert saved(parse, text) == operations


def test_squares_are_found_in_any_order_and_with_any_signs(parse, show):
    before = parse("y = 1 - x * x - z * z; w = z * z + a * a + x * x")
    after = share_pairs(before)
    assert (after.operations["add"], after.operations["multiply"]) == (3, 3)
    point = {"x": 3, "z": 5, "a": 7}
    assert after.run(point) == before.run(point) == {"output_y": [-33], "output_w": [83]}


def test_opposite_pairs_are_one_difference(parse, show):
    assert (
        show(share_pairs(parse("y = a - b; z = c + b - a")))
        == "shared_1 = a - b; y = shared_1; z = c - shared_1"
    )


@pytest.mark.parametrize(
    "text",
    [
        "y = a + b; z = a - b",
        "y = a * b; z = a + b",
        "y = a * b; z = a / b",
        "y = a + b; z = c + d",
        "y = a + 2 * b; z = a + 3 * b",
        "y = sin(a); z = sin(a)",  # equal operations are the work of reuse_values
        "y = select(at_least(a, b), c, d); z = select(at_least(a, b), d, c)",
        "y = atan2(a, b); z = atan2(a, b)",
        "y = a * a * a * a",  # within one product nothing is paired twice
    ],
)
def test_where_no_pair_stands_twice_the_program_stays_the_same(parse, text):
    program = parse(text)
    assert share_pairs(program) is program


def test_the_most_frequent_pair_comes_first(parse, show):
    # b + c stands in three sums; a + b, if it were taken first, would leave two of them.
    after = share_pairs(parse("x = a + b + c; y = b + c + d; z = c + e + b; w = a + b + f"))
    assert show(after).startswith("shared_1 = b + c; x = ")
    assert after.operations["add"] == 6


def test_a_name_that_stands_for_nothing_and_is_used_once_is_opened(parse, show):
    # As it stands a + c hides the a that b could be paired with.
    assert show(share_pairs(parse("shared_1 = a + c; y = shared_1 + b; z = a + b"))) == (
        "shared_1 = a + b; y = shared_1 + c; z = shared_1"
    )


@pytest.mark.parametrize(
    ("text", "results"),
    [
        ("part = a + c; y = part + b; z = a + b", "y z"),  # it means something
        ("shared_1 = a + c; y = shared_1 + b; z = a + b; w = sin(shared_1)", ""),  # it is used twice
        ("shared_1 = a + c; y = shared_1 + b; z = a + b", "y z shared_1"),  # it is a result
    ],
)
def test_other_names_stay_closed(parse, text, results):
    program = parse(text, results)
    assert share_pairs(program) is program


def test_a_pair_is_computed_before_its_first_use_and_after_its_parts(parse, show):
    before = parse("part = sin(x); u = 2 * x; y = part + u + 1; z = u - 3 + part")
    assert show(share_pairs(before)) == (
        "part = sin(x); u = 2 * x; shared_1 = part + u; y = shared_1 + 1; z = shared_1 - 3"
    )


def test_names_that_are_taken_are_not_given_again(parse, show):
    before = parse("shared_1 = sin(x); w = shared_1 * shared_1; y = a + b + c; z = b + a - shared_1")
    assert show(share_pairs(before)) == (
        "shared_1 = sin(x); w = shared_1 * shared_1; shared_2 = a + b; y = shared_2 + c; z = shared_2 - shared_1"
    )


def test_a_sum_and_a_difference_in_one_value_stay_apart(parse):
    before = parse("y = (a + b + c) * (a - b + d); z = a + b + e")
    after = share_pairs(before)
    assert after.operations["add"] == before.operations["add"] - 1
    point = {"a": 3, "b": 5, "c": 7, "d": 11, "e": 13}
    assert after.run(point) == before.run(point)
