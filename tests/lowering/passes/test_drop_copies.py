"""The pass `drop_copies`: names that stand for nothing and hold what another holds."""

import pytest

from strapgen.ir.program import Constant, Reference
from strapgen.lowering.passes import drop_copies


def test_a_copy_is_replaced_by_what_it_was_copied_from(parse, show):
    before = parse("part = x + 1; shared_1 = part; y = shared_1 * shared_1; z = sin(shared_1)")
    assert show(drop_copies(before)) == "part = x + 1; y = part * part; z = sin(part)"


def test_a_copy_of_an_input(parse, show):
    assert show(drop_copies(parse("factor_1 = x; y = factor_1 * z"))) == "y = x * z"


def test_copies_of_copies(parse, show):
    before = parse("shared_1 = x; shared_2 = shared_1; factor_1 = shared_2; y = 2 * factor_1")
    assert show(drop_copies(before)) == "y = 2 * x"


def test_a_number_is_used_directly(parse, show):
    assert show(drop_copies(parse("shared_1 = q(1, 3); y = shared_1 * x"))) == "y = q(1, 3) * x"


def test_a_name_that_means_something_stays(parse, show):
    # ... even if it holds what another name holds; what copies it refers to it, not past it.
    assert show(drop_copies(parse("part = x; shared_1 = part; y = 2 * shared_1"))) == "part = x; y = 2 * part"


def test_results_that_held_a_copy_hold_the_original(parse):
    before = parse(
        "part = x * x; shared_1 = part; shared_2 = 3", "shared_1 shared_2 part", "shared_2 shared_1"
    )
    after = drop_copies(before)
    assert [result.nodes for result in after.outputs] == [
        (Reference("part"),),
        (Constant(3),),
        (Reference("part"),),
    ]
    assert after.transition.nodes == (Constant(3), Reference("part"))
    assert after.transition.signal == before.transition.signal
    assert after.run({"x": 5}) == before.run({"x": 5})


@pytest.mark.parametrize("text", ["y = x * x", "part = x; y = 2 * part", "shared_1 = -x; y = z * shared_1"])
def test_without_copies_the_program_stays_the_same(parse, text):
    program = parse(text)
    assert drop_copies(program) is program
