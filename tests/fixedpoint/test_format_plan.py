"""Formats that are fixed beforehand: inputs hold what is accepted, results have room, and recursions keep theirs."""

from __future__ import annotations

from fractions import Fraction
from types import SimpleNamespace

import pytest
from derived import FIXED_POINT, quantized
from derived import program as lowered
from small_programs import node, program

from strapgen.fixedpoint.derivation import quantities
from strapgen.fixedpoint.format_plan import (
    FormatPlan,
    _result_fraction,
    format_plan,
    limits,
    sums_of_inputs_are_exact,
)
from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import Quantities
from strapgen.ir.fixed_settings import Settings
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


def test_what_goes_into_the_next_call_keeps_its_format():
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
