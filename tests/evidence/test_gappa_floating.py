"""Gappa proves what headers state of a call in double and in float, where no product and sum are contracted."""

from __future__ import annotations

import re
from dataclasses import replace
from fractions import Fraction

import pytest
from derived import program

from strapgen.catalogue import Choice, choose, choose_step
from strapgen.evidence import gappa
from strapgen.evidence.gappa_floating import floating_script
from strapgen.evidence.gappa_scripts import CannotFollowError, Script
from strapgen.fixedpoint.floating.bounds import rounding_bounds
from strapgen.fixedpoint.floating.errors import NUMBERS
from strapgen.ir.program import Program

pytestmark = pytest.mark.skipif(not gappa.TOOL.installed(), reason="gappa is not installed")

EULER = choose_step("euler", "rk1", 2)


def script(code: Program, number: str) -> Script:
    return floating_script(code, rounding_bounds(code, number))


def judged(text: Script, folder) -> tuple[str, str]:
    file = folder / "script.g"
    file.write_text(text.question())
    return gappa.judged(text, gappa.answered(file))


@pytest.mark.long
@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize(
    "choice",
    [EULER, choose("dcm-from-euler")],
    ids=lambda choice: str(choice.method or choice.name),
)
def test_the_error_bound_of_the_header_is_proved_and_is_as_small_as_gappas(choice: Choice, number, tmp_path):
    text = script(program(choice), number)
    assert judged(text, tmp_path)[0] == "proved"
    smaller = replace(text, goals={goal: bound * Fraction(19, 20) for goal, bound in text.goals.items()})
    assert judged(smaller, tmp_path)[0] == "fails"


@pytest.mark.long
def test_a_bound_of_double_does_not_hold_in_float(tmp_path):
    code = program(choose("euler-product"))
    text = replace(script(code, "float"), goals=script(code, "double").goals)
    assert judged(text, tmp_path)[0] == "fails"


def test_a_literal_that_is_off_is_noticed(tmp_path):
    off = script(program(choose("coning-fast")), "float")
    place = next(k for k, line in enumerate(off.definitions) if re.fullmatch(r"c_\d+ = \d{8}b-\d+;", line))
    off.definitions[place] = re.sub(r"\d{8}", lambda digits: str(int(digits[0]) + 64), off.definitions[place])
    assert judged(off, tmp_path)[0] == "fails"


@pytest.mark.parametrize("name", ["euler-normalize", "euler-from-dcm", "dcm-from-euler-angles"])
def test_conditions_comparisons_and_functions_are_told(name):
    with pytest.raises(CannotFollowError, match=r"condition|comparison|cos"):
        script(program(choose(name)), "double")
