"""Fixes the formats that follow from inputs, user and results alone, before any quantity becomes an integer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from strapgen.fixedpoint.limits import Limit, state_fraction, stated_format
from strapgen.fixedpoint.quantities import (
    ExactOperation,
    InputElement,
    Quantities,
    Sum,
    exponent,
    is_power_of_two,
)
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import Format, finest
from strapgen.ir.integer_program import Value
from strapgen.ir.interfaces import Argument
from strapgen.ir.program import Program, Result
from strapgen.ir.signals import Signal


@dataclass(frozen=True)
class FormatPlan:
    """The formats that are fixed before anything is lowered."""

    inputs: tuple[Argument, ...]
    values: Mapping[str, Value]  # the elements of the inputs
    forced: Mapping[str, int]  # fraction bits that the user states, or that the elements of a result share
    words: frozenset[str]  # quantities that must be rounded to words: these, and the factors and divisors


def format_plan(
    program: Program,
    settings: Settings,
    limits: Sequence[Limit],
    quantities: Quantities,
    guard_bits: int,
) -> FormatPlan:
    """Fix the formats that follow from inputs, user and results, with `guard_bits` below an input's finest format."""
    values: dict[str, Value] = {}
    inputs: list[Argument] = []
    for limit in limits:
        signal = limit.signal
        fraction, top = limit.places(guard_bits), limit.largest_integer(guard_bits)
        exact = Fraction(0)
        for name in signal.elements:
            values[name] = Value(name, None, fraction, False, -top, top, exact, exact, top)
        inputs.append(limit.argument(guard_bits))
    forced = _stated_formats(program, settings, quantities)
    for result in program.results:
        names = [name for name in quantities.results[result.signal.name] if isinstance(name, str)]
        fraction = _result_fraction(program, settings, quantities, inputs, result)
        forced |= {name: forced.get(name, fraction) for name in names}
    divisors = {
        str(quantity.definition.arguments[1])
        for quantity in quantities.items.values()
        if isinstance(quantity.definition, ExactOperation) and quantity.definition.kind == "divide"
    }
    words = frozenset(forced) | quantities.factors() | divisors
    return FormatPlan(tuple(inputs), values, forced, words)


def carried_input(program: Program, inputs: Sequence[Argument], signal: Signal) -> Argument | None:
    """Return the input that an output is in the next call."""
    name = program.recursion.inputs.get(signal.name) if program.recursion else None
    return next((argument for argument in inputs if argument.signal.name == name), None)


def sums_of_inputs_are_exact(plan: FormatPlan, quantities: Quantities, word: int) -> bool:
    """Tell whether every sum of inputs that is needed as a word is one without rounding.

    A rounding error of a sum of inputs would be the same in every step of a steady motion.
    """
    for name, quantity in quantities.items.items():
        definition = quantity.definition
        if name not in plan.words or name in plan.forced or not isinstance(definition, Sum):
            continue
        if not _is_sum_of_inputs(definition, quantities):
            continue
        needed = max(plan.values[m[0]].fraction - exponent(c) for m, c in definition.terms)
        if needed > finest(quantity.range.magnitude, word):
            return False
    return True


def _is_sum_of_inputs(definition: Sum, quantities: Quantities) -> bool:
    """Tell whether a sum is one of inputs times powers of two."""
    return all(
        len(monomial) == 1
        and is_power_of_two(coefficient)
        and isinstance(quantities.items[monomial[0]].definition, InputElement)
        for monomial, coefficient in definition.terms
    )


def _stated_formats(program: Program, settings: Settings, quantities: Quantities) -> dict[str, int]:
    """Return the fraction bits of the quantities whose format the user states one by one."""
    arguments = ["state", *(signal.name for signal in program.inputs)]
    arguments += [result.signal.name for result in program.results]
    stated: dict[str, int] = {}
    for name, text in settings.formats.items():
        if name in arguments:
            continue
        if name not in quantities.items:
            values = ", ".join(dict.fromkeys([*arguments, *quantities.items]))
            raise InputError(f"{program.kernel} has no value {name!r}; its values are: {values}")
        if isinstance(quantities.items[name].definition, InputElement):
            raise InputError(f"the format of {name} is that of its input; give the format of the whole input")
        stated[name] = Format.parse(text, settings.word).fraction
    return stated


def _result_fraction(
    program: Program,
    settings: Settings,
    quantities: Quantities,
    inputs: Sequence[Argument],
    result: Result,
) -> int:
    """Return the fraction bits that the elements of a result share."""
    signal, word = result.signal, settings.word
    is_output = result in program.outputs
    text = stated_format(settings, signal) if is_output else settings.formats.get(signal.name)
    if text is not None:
        return Format.parse(text, word).fraction
    carried = carried_input(program, inputs, signal) if is_output else None
    if carried is not None:
        return carried.format.fraction
    if is_output and (signal.constraint or program.attitude_step is not None):
        return _attitude_fraction(settings, inputs, signal)
    names = [name for name in quantities.results[signal.name] if isinstance(name, str)]
    sizes = sorted(quantities.items[name].range.magnitude for name in names) or [Fraction(1)]
    fraction = finest(sizes[-1] * (Fraction(1) + Fraction(1, 1 << (word - 4))), word)
    if settings.state and result is program.transition:
        # A state that fills its word leaves no room in sums of products: this has to.
        width = (program.inputs[0].shape or (1,))[-1]
        return fraction - (sum(sizes[-width:]) * Fraction(2) ** fraction >= 1 << word)
    return fraction


def _attitude_fraction(settings: Settings, inputs: Sequence[Argument], signal: Signal) -> int:
    """Return the fraction bits of an output that is an attitude: those of an input like it, or of every state."""
    for argument in inputs:
        if argument.signal.constraint == signal.constraint and argument.signal.shape == signal.shape:
            return argument.format.fraction
    return state_fraction(settings.word, Fraction(1) + settings.allowance)
