"""What is told of an output: its error, also where a value was taken as exact or saturates, and its range."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace

import pytest
from small_programs import node, program

from strapgen import quantize
from strapgen.fixedpoint.quantities import Quantities
from strapgen.fixedpoint.quantization import _MOST_GUARD_BITS, _errors, _is_worse, _output
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import IntegerSum, Term, Value
from strapgen.ir.signals import Signal

ZERO = Fraction(0)


def value(name, low, high, *uses, error=Fraction(1, 100), **more) -> Value:
    definition = IntegerSum(tuple(Term((use,), 1) for use in uses)) if uses else None
    return Value(name, definition, 4, False, low, high, ZERO, error, 99, **more)


def test_of_what_depends_on_a_reset_nothing_is_known_but_its_range_and_that_of_the_exact_value():
    reset, between, after = value("r", -9, 9), value("m", -7, 7, "r"), value("y", -20, 12, "m")
    other, saturated = value("z", -5, 5), replace(value("s", -5, 5), saturated=True)
    context = SimpleNamespace(resets={"r"}, body=[reset, between, after, other, saturated])
    signal = Signal("out", (3,), ("y", "z", "s"), bound=Fraction(3, 2))
    told = _errors(context, signal, [after, other, saturated])
    # The exact one is at 3/2 and the computed one at -20/16; what saturates may lack a unit, and more if it is inexact.
    assert told == (Fraction(3, 2) + Fraction(20, 16), Fraction(1, 100), Fraction(1, 16))
    assert _errors(context, signal, [replace(saturated, error=Fraction(1, 3))]) == (Fraction(1, 3),)


def test_an_output_has_the_range_of_all_of_its_elements_and_one_format():
    first, second = value("y", -20, 5), value("z", -3, 12)
    context = SimpleNamespace(
        resets=set(),
        body=[first, second],
        values={"y": first, "z": second},
        word=8,
        quantities=Quantities({}, {"out": ("y", Fraction(1), "z")}),
    )
    signal = Signal("out", (2,), ("o_1", "o_2"))
    argument = _output(context, signal)
    assert (argument.low, argument.high, argument.format.fraction) == (-20, 12, 4)
    context.values["z"] = replace(second, fraction=5)
    with pytest.raises(InputError, match="elements of out share one format"):
        _output(context, signal)


@pytest.mark.parametrize("bits", [1, _MOST_GUARD_BITS, _MOST_GUARD_BITS + 1])
def test_inputs_have_up_to_so_many_bits_less_that_their_sum_is_exact(bits):
    largest = {"a": Fraction(1, 2), "b": Fraction(1, 2) / 2**bits}
    code = program({"s": node("add", "a", "b"), "y": node("multiply", "s", "s")}, largest)
    b = quantize(code, Settings(16)).interface.inputs[1]
    # The sum, of 1/2 to 1, has 15 places; an input of up to 1/2 has as many, and a smaller one more.
    assert b.format.fraction == (15 if bits <= _MOST_GUARD_BITS else 15 + bits)


@pytest.mark.parametrize(("percent", "worse"), [(100, False), (101, False), (102, True)])
def test_an_error_that_is_a_hundredth_larger_is_no_worse(percent, worse):
    def told(*errors) -> SimpleNamespace:
        outputs = (SimpleNamespace(errors=(ZERO,)), SimpleNamespace(errors=errors))
        return SimpleNamespace(interface=SimpleNamespace(outputs=outputs))

    one, other = (Fraction(1), Fraction(percent, 100)), (Fraction(2), Fraction(1))
    assert _is_worse(told(*one), told(*other)) is worse
