"""Certified bounds are printed on the safe side, in every header and in every report."""

from __future__ import annotations

import re
from fractions import Fraction

import pytest
from derived import program, quantized

from strapgen import catalogue, fixedpoint, pipeline
from strapgen.catalogue import Choice
from strapgen.ir import formats
from strapgen.ir.fixed_settings import Settings
from strapgen.targets import contract

ERROR = re.compile(r"error <= (\S+) \((\S+) ulp\)")
RANGE = re.compile(r"range (-?\d+) to (-?\d+) \((\S+) to (\S+)\)")


def test_headers_of_the_catalogue_state_no_less_than_is_certified():
    stated = 0
    for choice in catalogue.standard():
        if not fixedpoint.can_lower(program(choice)):
            continue
        fixed = quantized(choice, Settings())
        for argument in (*fixed.interface.inputs, *fixed.interface.outputs):
            text = contract.argument_text(argument)
            low, high = map(Fraction, RANGE.search(text).groups()[2:])
            assert low <= argument.low * argument.unit
            assert argument.high * argument.unit <= high
            if (shown := ERROR.search(text)) is not None:
                worst, places = map(Fraction, shown.groups())
                exact = max(argument.errors)
                assert exact <= worst < exact * (1 + Fraction(1, 10**5))
                assert exact / argument.unit <= places < exact / argument.unit + Fraction(1, 10**4)
                stated += 1
        for name, error in fixed.as_data()["error_bound"].items():
            assert Fraction(error) >= fixed.error_bounds[name]
        for name, ends in fixed.as_data()["ranges"].items():
            assert Fraction(ends[0]) <= fixed.ranges[name][0]
            assert Fraction(ends[1]) >= fixed.ranges[name][1]
    assert stated > 30


def test_bound_that_a_call_attains_is_not_rounded_down():
    """A call of this kernel is off by 2^-24."""
    ranges = dict.fromkeys(("navigation_rotation", "previous_turn", "turn"), Fraction(1, 300))
    fixed = pipeline.fixed_program(Choice("navigation-rotation"), Settings(word=16, ranges=ranges))
    shown = [ERROR.search(contract.argument_text(output)) for output in fixed.interface.outputs]
    assert max(Fraction(text[1]) for text in shown if text) >= Fraction(1, 2**24)


@pytest.mark.parametrize(
    "value", [Fraction(1, 3), Fraction(-1, 3), Fraction(10**20, 7), Fraction(1, 3 * 10**9)]
)
def test_rounding_goes_one_way(value):
    for digits in (2, 4, 6):
        for style in "ge":
            low = Fraction(formats.below(value, digits, style))
            high = Fraction(formats.above(value, digits, style))
            assert low < value < high < value + abs(value) / 10 ** (digits - 2)
    assert Fraction(formats.float_below(value)) < value < Fraction(formats.float_above(value))
    assert value < Fraction(formats.places_above(value, 3)) <= value + Fraction(1, 1000)
