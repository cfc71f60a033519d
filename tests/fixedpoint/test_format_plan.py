"""Ranges and formats that are fixed beforehand: inputs hold what is accepted, results have room."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace

import pytest
from derived import FIXED_POINT, quantized
from derived import program as lowered
from small_programs import node, program

from strapgen.catalogue import Choice
from strapgen.fixedpoint.derivation import quantities
from strapgen.fixedpoint.format_plan import (
    FormatPlan,
    _result_fraction,
    format_plan,
    largest_magnitude,
    limits,
    sums_of_inputs_are_exact,
)
from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import Quantities
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import Format
from strapgen.ir.program import Program, Reference, Result
from strapgen.ir.signals import Signal

WORD = 8


def plan_of(code: Program, guard_bits: int = 0) -> tuple[FormatPlan, Quantities]:
    known = quantities(code, {s.name: Interval.symmetric(s.bound) for s in code.inputs}, word=WORD)
    settings = Settings(WORD)
    return format_plan(code, settings, limits(code, settings), known, guard_bits), known


@pytest.mark.parametrize("guard_bits", [0, 2])
def test_an_input_may_be_as_large_as_its_limit(guard_bits):
    code = program({"y": node("multiply", "a", "b")}, {"a": Fraction(5, 7), "b": 3})
    plan, _ = plan_of(code, guard_bits)
    for limit, argument in zip(limits(code, Settings(WORD)), plan.inputs, strict=True):
        value = plan.values[limit.signal.name]
        top = limit.largest_integer(guard_bits)
        assert (value.low, value.high, value.peak) == (-top, top, top)
        assert (argument.low, argument.high, argument.format.fraction) == (-top, top, value.fraction)
        assert value.error == 0


@pytest.mark.parametrize(("largest", "fraction"), [(119, 7), (120, 6)])
def test_a_result_has_room_for_a_sixteenth_of_errors(largest, fraction):
    """A sixteenth above 119 is 126, and above 120 it is 127 and a half, more than 8 bits hold."""
    plan, _ = plan_of(
        program({"y": node("multiply", "a", "b")}, {"a": Fraction(largest, 8), "b": Fraction(1, 16)})
    )
    assert plan.forced["y"] == fraction


@pytest.mark.parametrize(
    ("sizes", "fraction"), [((32, 32, 32, 32), 6), ((32, 32, 32, 31), 7), ((64, 1, 1, 1), 6)]
)
def test_a_transition_leaves_room_for_a_state_that_fills_its_word(sizes, fraction):
    """Four products with a state of up to 2^7 stay below 2^15 if the magnitudes add up to less than 2^8."""
    signal = Signal("transition", (4,), tuple("pqrs"))
    result = Result(signal, tuple(map(Reference, "pqrs")))
    state = Signal("state", (4,), tuple("abcd"), constraint="unit")
    code = SimpleNamespace(inputs=(state,), outputs=(), transition=result, recursion=None, attitude_step=None)
    ranges = (SimpleNamespace(range=Interval.symmetric(Fraction(size, 64))) for size in sizes)
    known = SimpleNamespace(
        items=dict(zip("pqrs", ranges, strict=True)), results={"transition": tuple("pqrs")}
    )
    settings = SimpleNamespace(word=WORD, formats={}, state="q7")
    assert _result_fraction(code, settings, known, (), result) == fraction


def test_a_divisor_is_a_word():
    code = program({"d": node("add", "a", 3), "y": node("divide", "b", "d")}, {"a": 1, "b": 1})
    plan, _ = plan_of(code)
    assert "y_denominator" in plan.words


@pytest.mark.parametrize(("bound", "exact"), [(Fraction(1, 60), False), (Fraction(1), True)])
def test_a_sum_of_inputs_is_exact_in_the_format_of_the_finest_of_them(bound, exact):
    """In 8 bits a sum of up to 61/60 has 6 places; an input of up to 1/60 has 12 of them."""
    code = program(
        {"s": node("add", "a", "b"), "y": node("multiply", "s", "a")}, {"a": Fraction(3, 4), "b": bound}
    )
    plan, known = plan_of(code, guard_bits=1)
    assert plan.values["b"].fraction == (11 if not exact else 5)
    assert sums_of_inputs_are_exact(plan, known, WORD) is exact


def test_fed_back_values_keep_their_format():
    seen = 0
    for choice in FIXED_POINT:
        recursion = lowered(choice).recursion
        if recursion is None:
            continue
        interface = quantized(choice, Settings(16)).interface
        inputs = {argument.signal.name: argument.format for argument in interface.inputs}
        for output in interface.outputs:
            name = recursion.inputs.get(output.signal.name)
            assert name is None or output.format == inputs[name]
            seen += name is not None
    assert seen


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


def test_ranges_of_a_full_type_need_no_check():
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
