"""The pass `reuse_values`: equal operations are computed once."""

from strapgen.lowering.passes import reuse_values


def test_equal_operations_get_a_name(parse, show):
    before = parse("y = sin(x * z) + 1; w = 2 - sin(x * z)")
    assert show(reuse_values(before)) == "shared_1 = sin(x * z); y = shared_1 + 1; w = 2 - shared_1"


def test_equal_operations_in_one_tree_get_a_name(parse, show):
    assert show(reuse_values(parse("y = (a + b) * (a + b)"))) == "shared_1 = a + b; y = shared_1 * shared_1"


def test_what_has_a_name_is_referred_to_by_it(parse, show):
    assert show(reuse_values(parse("part = x * z; y = x * z + 1"))) == "part = x * z; y = part + 1"
    assert show(reuse_values(parse("part = x * z; y = x * z"))) == "part = x * z; y = part"
    # Also where the name comes later than a value that then needs one of its own.
    assert show(reuse_values(parse("y = x * z + 1; part = x * z"))) == (
        "shared_1 = x * z; y = shared_1 + 1; part = shared_1"
    )


def test_only_the_largest_equal_part_is_named(parse, show):
    before = parse("y = a * b + c; z = sin(a * b + c)")
    assert show(reuse_values(before)) == "y = a * b + c; z = sin(y)"
    before = parse("y = 2 * (a * b + c); z = sin(a * b + c)")
    assert show(reuse_values(before)) == "shared_1 = a * b + c; y = 2 * shared_1; z = sin(shared_1)"


def test_a_part_that_also_stands_elsewhere_is_named_too(parse, show):
    before = parse("y = 2 * (a * b + c); z = sin(a * b + c); w = 1 - a * b")
    assert show(reuse_values(before)) == (
        "shared_1 = a * b; shared_2 = shared_1 + c; y = 2 * shared_2; z = sin(shared_2); w = 1 - shared_1"
    )


def test_names_that_are_taken_are_not_given_again(parse, show):
    before = parse(
        "shared_1 = a + b; shared_3 = shared_1 * a; y = sin(c) * shared_3 + sin(c) + sin(d * d) - d * d"
    )
    assert show(reuse_values(before)) == (
        "shared_1 = a + b; shared_3 = shared_1 * a; shared_2 = sin(c); shared_4 = d * d; "
        "y = shared_2 * shared_3 + shared_2 + sin(shared_4) - shared_4"
    )


def test_a_condition_is_no_value(parse, show):
    text = "y = select(at_least(a, b), c, d); z = select(at_least(a, b), d, c)"
    assert show(reuse_values(parse(text))) == text
    # What it compares are values.
    before = parse("y = select(at_least(a * b, 0), c, d); z = select(at_least(a * b, 0), d, c)")
    assert show(reuse_values(before)) == (
        "shared_1 = a * b; y = select(at_least(shared_1, 0), c, d); z = select(at_least(shared_1, 0), d, c)"
    )


def test_a_whole_choice_is_a_value(parse, show):
    before = parse("y = 1 + select(at_least(a, b), c, d); z = sin(select(at_least(a, b), c, d))")
    assert show(reuse_values(before)) == (
        "shared_1 = select(at_least(a, b), c, d); y = 1 + shared_1; z = sin(shared_1)"
    )


def test_trees_are_compared_as_they_stand(parse, show):
    # a + b and b + a are no equal trees: those are the work of share_pairs.
    text = "y = sin(a + b); z = cos(b + a)"
    assert show(reuse_values(parse(text))) == text
