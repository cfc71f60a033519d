"""Names that stand for nothing: told from others, and never given twice."""

from itertools import islice

import pytest
from derived import program

from strapgen.catalogue import Choice
from strapgen.lowering.trees import FACTOR, SHARED, is_temporary, shared_names


@pytest.mark.parametrize("name", [f"{SHARED}1", f"{FACTOR}2"])
def test_names_of_common_parts_stand_for_nothing(name):
    assert is_temporary(name)


@pytest.mark.parametrize("name", ["sigma_x", "factor", "next_s", "partner_shared_x"])
def test_names_of_quantities_stand_for_something(name):
    assert not is_temporary(name)


def test_names_on_offer_are_free_and_differ():
    made = program(Choice("dcm", "rk3", 2))
    taken = {assignment.name for assignment in made.body}
    assert f"{SHARED}1" in taken
    offered = list(islice(shared_names(made), 5))
    assert len(set(offered)) == 5 and not taken & set(offered) and all(map(is_temporary, offered))
