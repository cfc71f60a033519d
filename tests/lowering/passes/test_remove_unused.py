"""The pass `remove_unused`: what no result needs."""

from strapgen.lowering.passes import remove_unused


def test_what_only_unused_names_need_is_dropped_with_them(parse, show):
    before = parse("dead = x * x; y = x + 1; deader = sqrt(dead); shared_1 = deader + y", results="y")
    assert show(remove_unused(before)) == "y = x + 1"


def test_what_a_result_needs_is_kept_in_its_order(parse, show):
    text = "shared_1 = x * x; part = shared_1 + 1; y = part * shared_1"
    assert show(remove_unused(parse(text + "; z = -y", results="y"))) == text


def test_the_transition_needs_names_too(parse, show):
    before = parse("part = x * x; other = x + 1; y = z * z", "y", transition="part")
    assert show(remove_unused(before)) == "part = x * x; y = z * z"


def test_what_a_condition_needs_is_kept(parse):
    program = parse("shared_1 = x * x; y = select(at_least(shared_1, 2), x, z)")
    assert remove_unused(program) is program


def test_where_everything_is_needed_the_program_stays_the_same(parse):
    program = parse("part = x * x; y = part + 1", "y")
    assert remove_unused(program) is program
