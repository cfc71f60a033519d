"""What headers in double and in float say of rounding: the bounds, rounded up, and all that they hold for."""

from __future__ import annotations

import re
from fractions import Fraction

import pytest
from derived import programs

from strapgen.fixedpoint.floating import rounding_bounds
from strapgen.ir.interfaces import RoundingBounds
from strapgen.targets import emit
from strapgen.targets.contract import rounding_text


def said(name: str, number: str = "double") -> tuple[RoundingBounds, str]:
    code = programs()[name]
    bounds = rounding_bounds(code, number)
    return bounds, rounding_text(bounds, code)


@pytest.mark.long
@pytest.mark.parametrize("target", ["c", "c-float"])
def test_every_header_has_a_line_on_rounding_beside_the_operations(target):
    for name, code in programs().items():
        sources = emit(code, target)
        header = next(text for file, text in sources.step_files.items() if file.endswith(".h"))
        head = " ".join(re.sub(r"^ \* ?", "", header, flags=re.MULTILINE).split())
        expected = " ".join(rounding_text(sources.rounding, code).split())
        assert re.search(r"temporaries\. Rounding: ", head), name
        assert f"Rounding: {expected}." in head, name


@pytest.mark.long
@pytest.mark.parametrize("number", ["double", "float"])
def test_the_text_says_no_less_than_what_is_proved(number):
    for name in programs():
        bounds, text = said(name, number)
        for output, worst in bounds.worst.items():
            if any(bounds.worst.values()) and worst:
                shown = re.search(rf"\berror of {output} <= (\S+?)( \(|,|;|\.(?!\d))", text)
                assert shown, text
                assert worst <= Fraction(shown[1]) <= worst * Fraction(102, 100)


def test_the_text_of_a_step_is_a_bound_of_runs():
    bounds, text = said("dcm-rk4-2")
    per_step, growth = re.search(
        r"the row of the error after N steps is at most (\S+) N exp\((\S+) N\) long", text
    ).groups()
    assert Fraction(per_step) >= bounds.accumulation.per_step
    assert 1 + Fraction(growth) >= bounds.accumulation.growth


@pytest.mark.long
def test_all_conditions_are_told():
    assert "from 0.75 to 1.34375" in said("euler-normalize")[1]
    assert "sin of the C library within 1 ulp" in said("dcm-update")[1]
    for name in programs():
        bounds, text = said(name)
        if any(bounds.worst.values()):
            assert "-ffp-contract=off" in text
            assert all(condition.value in text for condition in (*bounds.inputs, *bounds.conditions))


def test_what_has_no_error_or_no_bound_says_so():
    assert said("euler-from-cayley-klein")[1] == "none; every output is exact"
    assert said("euler-from-dcm")[1].startswith("no bound: rounding may turn a comparison")
