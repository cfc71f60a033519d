"""Ranges of inputs as integers: which end is rounded up, and which down."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import pytest
from derived import quantized
from small_programs import node, program

from strapgen.catalogue import Choice
from strapgen.fixedpoint.format_plan import largest_magnitude, limits
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import Format
from strapgen.ir.signals import Signal

CODE = program({"y": node("add", "a", "b")}, {"a": Fraction(1, 60), "b": 3})
STATE = Signal("state", (4,), ("s_x", "s_y", "s_z", "s_s"), constraint="unit")


def test_limits_are_rounded_up_and_those_of_an_attitude_down():
    """An attitude that exceeds its allowance by less than a unit is refused; an increment at its limit is not."""
    code = replace(CODE, inputs=(STATE, *CODE.inputs))
    state, a, b = limits(code, Settings(16, allowance=Fraction(1, 60)))
    assert (state.fraction, a.fraction, b.fraction) == (14, 20, 13)
    assert state.largest_integer(0) == 16657  # of 16657.07
    assert a.largest_integer(0) == 17477  # of 17476.27
    assert a.range(0).highest == Fraction(17477, 1 << 20)
    # Guard bits are for what is added up; an attitude has none.
    assert (a.places(2), a.largest_integer(2), state.largest_integer(2)) == (18, 4370, 16657)
    argument = a.argument(0)
    assert (argument.low, argument.high) == (-17477, 17477)


def test_what_a_type_cannot_hold_needs_no_check():
    """A gyro of 8 bits counts to -128 and to 127; a limit of 128 counts is that of its type."""
    (limit, _) = limits(CODE, Settings(16, ranges={"a": Fraction(1)}))
    narrow = replace(limit, largest=Fraction(128), fraction=0, bits=8)
    argument = narrow.argument(0)
    assert (argument.low, argument.high) == (-128, 127)


@pytest.mark.parametrize("name", ["state", "increments"])
def test_the_range_of_an_attitude_and_of_increments_is_stated_otherwise(name):
    code = replace(CODE, inputs=(STATE, replace(CODE.inputs[0], name="increments"), CODE.inputs[1]))
    with pytest.raises(InputError, match=f"the range of {name} follows from the drift allowance"):
        limits(code, Settings(16, ranges={name: Fraction(1, 4)}))


def test_an_attitude_may_exceed_its_bound_by_the_allowance():
    settings = Settings(16, allowance=Fraction(1, 60))
    assert largest_magnitude(CODE, STATE, settings) == Fraction(61, 60)
    assert largest_magnitude(CODE, replace(STATE, bound=Fraction(1, 2)), settings) == Fraction(31, 60)
    assert largest_magnitude(CODE, CODE.inputs[1], settings) == 3


@pytest.mark.parametrize("word", [8, 16])
def test_the_next_call_takes_whatever_a_step_returns(word):
    """An attitude whose range is not proved is checked: against the largest number that the next call accepts."""

    settings = Settings(word, Fraction(1), allowance=Fraction(1, 60))
    fixed = quantized(Choice("dcm", "rk3", 2), settings)
    (result,) = fixed.interface.outputs
    range_checked = [value for value in fixed.body if value.name in result.values and value.range_checked]
    assert range_checked
    limit = Fraction(61, 60) / result.format.unit
    assert limit.denominator > 1
    for value in range_checked:
        assert -limit <= value.low <= value.high <= limit < value.high + 1
    assert fixed.interface.inputs[0].high == range_checked[0].high
    assert result.format == Format(word, word - 2)
