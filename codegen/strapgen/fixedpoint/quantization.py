"""Turns exact quantities into integers: chooses formats from ranges, rounds each sum once, and bounds every error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from strapgen.fixedpoint import derivation
from strapgen.fixedpoint.format_plan import FormatPlan, format_plan, sums_of_inputs_are_exact
from strapgen.fixedpoint.integer_operations import LOWER
from strapgen.fixedpoint.limits import Limit, limits
from strapgen.fixedpoint.quantities import ExactOperation, Quantities, Quantity, Sum
from strapgen.fixedpoint.quantization_context import Quantization
from strapgen.fixedpoint.runs.accumulation import accumulation, step_errors
from strapgen.fixedpoint.runs.angle_accumulation import angle_accumulation
from strapgen.fixedpoint.sums import lower_sum
from strapgen.fixedpoint.words.alignment import aligning
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import Format
from strapgen.ir.integer_program import FixedProgram, IntegerSum, Value, operation_counts, used_by
from strapgen.ir.interfaces import Argument, ErrorFeedback, Interface
from strapgen.ir.program import Program, Result
from strapgen.ir.signals import CYCLE, Signal

#: Bits that inputs may be stored below their finest format, so that sums of them are exact.
_MOST_GUARD_BITS = 3
#: Shorter formats are chosen where they cost no more than a hundredth in error.
_WORSE = Fraction(101, 100)


def lowered(program: Program, settings: Settings) -> FixedProgram:
    """Lower a program to integers; parameters and errors are those of `strapgen.fixedpoint.quantize`."""
    quantities, plan = _planned(program, settings)
    finest = _walked(program, settings, quantities, plan, {})
    coarser = aligning(finest.body, finest.values, plan.forced)
    shorter = _walked(program, settings, quantities, plan, coarser)
    context, fixed = finest, _fixed_program(finest)
    aligned = _fixed_program(shorter)
    if not _is_worse(aligned, fixed):
        context, fixed = shorter, aligned
    if program.attitude_step is None or program.transition is None:
        return fixed
    (result,) = fixed.interface.outputs
    errors = step_errors(context, program.transition, result)
    if errors is None:
        return fixed
    interface = replace(
        fixed.interface,
        accumulation=accumulation(context, program.transition, errors),
        angle_accumulation=angle_accumulation(context, program.transition, errors),
    )
    return replace(fixed, interface=interface)


def _planned(program: Program, settings: Settings) -> tuple[Quantities, FormatPlan]:
    """Return the exact quantities and the formats of the inputs, with guard bits if they make sums of inputs exact."""
    stated = limits(program, settings)
    first = _with_guard_bits(program, settings, stated, 0)
    # What is handed on from call to call keeps its finest format: it is no increment.
    if program.recursion is not None or sums_of_inputs_are_exact(first[1], first[0], settings.word):
        return first
    for guard_bits in range(1, _MOST_GUARD_BITS + 1):
        quantities, plan = _with_guard_bits(program, settings, stated, guard_bits)
        if sums_of_inputs_are_exact(plan, quantities, settings.word):
            return quantities, plan
    return first


def _with_guard_bits(
    program: Program, settings: Settings, stated: Sequence[Limit], guard_bits: int
) -> tuple[Quantities, FormatPlan]:
    """Return the exact quantities and the formats of the inputs when sums of inputs have so many bits more."""
    box = {name: limit.range(guard_bits) for limit in stated for name in limit.signal.elements}
    quantities = derivation.quantities(program, box, split=_splits(program, settings), word=settings.word)
    return quantities, format_plan(program, settings, stated, quantities, guard_bits)


def _splits(program: Program, settings: Settings) -> bool:
    """Tell whether the increments are split off the transition: where the rounding of that has no feedback of its own.

    A rotation vector that is a word of its own is rounded before the transition, out of reach of the feedback.
    """
    kernels = program.attitude_step
    through_vector = kernels is not None and kernels.truncation is not None
    return settings.carry == "state" or (settings.carry == "full" and through_vector)


def _walked(
    program: Program, settings: Settings, quantities: Quantities, plan: FormatPlan, most: Mapping[str, int]
) -> Quantization:
    """Lower the quantities one by one, and return all that is known then."""
    names = _feedback_names(program, settings, quantities)
    context = Quantization(program, settings, quantities, plan, most, names)
    for quantity in quantities.items.values():
        match quantity.definition:
            case Sum() as total if not _is_unused_constant(context, quantity, total):
                lower_sum(context, quantity, total)
            case ExactOperation(kind) as operation:
                LOWER[kind](context, quantity, operation)
    return context


def _is_unused_constant(context: Quantization, quantity: Quantity, total: Sum) -> bool:
    """Tell whether a sum is a constant that no word needs to hold, or is there already."""
    exact = not quantity.offset and not quantity.approximation_error
    constant = exact and all(not monomial for monomial, _ in total.terms)
    unused = (not total.terms or constant) and quantity.name not in context.plan.words
    return unused or quantity.name in context.values


def _feedback_names(program: Program, settings: Settings, quantities: Quantities) -> dict[str, str]:
    """Return the name of the error feedback of every quantity whose rounding error goes into the next call."""
    if settings.carry == "none":
        return {}
    elements = [
        name for result in _handed_on(program, settings) for name in quantities.results[result.signal.name]
    ]
    return {name: f"residual_{name}" for name in elements if isinstance(name, str)}


def _handed_on(program: Program, settings: Settings) -> list[Result]:
    """Return the results whose rounding errors go into the next call."""
    first, result = program.inputs[0], program.outputs[0]
    is_state = (first.shape, first.constraint) == (result.signal.shape, result.signal.constraint)
    handed_on = [result] if is_state else []
    if settings.carry == "all":
        states = program.recursion.inputs if program.recursion else {}
        others = [r for r in program.outputs if r.signal.name in states or r.signal.over == CYCLE]
        handed_on += [other for other in others if other not in handed_on]
    if settings.carry != "state" and handed_on and program.transition is not None:
        handed_on.append(program.transition)
    return handed_on


def _is_worse(one: FixedProgram, other: FixedProgram) -> bool:
    """Tell whether an output of one program has an error bound that is notably above that of another."""
    return any(
        error > other_error * _WORSE
        for output, other_output in zip(one.interface.outputs, other.interface.outputs, strict=True)
        for error, other_error in zip(output.errors, other_output.errors, strict=True)
    )


# Around the code


def _fixed_program(context: Quantization) -> FixedProgram:
    """Return the lowered values as a program."""
    outputs = tuple(_output(context, result.signal) for result in context.program.outputs)
    interface = Interface(context.settings, context.plan.inputs, outputs, _feedbacks(context), None)
    _require_last(context)
    counts = operation_counts(context.body, context.settings.rounding)
    return FixedProgram(context.program, interface, tuple(context.body), counts)


def _require_last(context: Quantization) -> None:
    """Refuse a program that goes on with a value that saturates: it may be far from the exact one."""
    saturated = {value.name for value in context.body if value.saturated}
    for value in context.body:
        if saturated.intersection(used_by(value)):
            raise InputError(
                f"{context.program.kernel} computes {value.name} from its output; state "
                f"{context.settings.state} does not go with it"
            )


def _feedbacks(context: Quantization) -> tuple[ErrorFeedback, ...]:
    """Return the error feedback of all values that are rounded with it."""
    values = [context.values[name] for name in context.feedback_names if name in context.values]
    feedbacks = [value.definition.residual for value in values if isinstance(value.definition, IntegerSum)]
    return tuple(feedback for feedback in feedbacks if feedback is not None)


def _output(context: Quantization, signal: Signal) -> Argument:
    """Return an output with its format, range and error bounds."""
    names = tuple(name for name in context.quantities.results[signal.name] if isinstance(name, str))
    values = [context.values[name] for name in names]
    fractions = {value.fraction for value in values}
    if len(fractions) > 1:
        raise InputError(
            f"the elements of {signal.name} share one format; fix the format of {signal.name}, not of one element"
        )
    low, high = min(value.low for value in values), max(value.high for value in values)
    format_ = Format(context.word, fractions.pop())
    return Argument(signal, format_, names, low, high, _errors(context, signal, values))


def _errors(context: Quantization, signal: Signal, values: Sequence[Value]) -> tuple[Fraction, ...]:
    """Return the error bounds of the elements of an output; after a reset, its range is all that is known."""
    uncertain = set(context.resets)
    for value in context.body:
        if uncertain.intersection(used_by(value)):
            uncertain.add(value.name)
    bound = signal.bound or Fraction(0)
    return tuple(
        bound + value.magnitude / Fraction(2) ** value.fraction
        if value.name in uncertain
        # What exceeds the largest number of a format by no more than a unit is stored as that number.
        else max(value.error, value.saturated * Fraction(2) ** -value.fraction)
        for value in values
    )
