"""Turns exact quantities into integers: chooses formats from ranges, rounds each sum once, and bounds every error."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from strapgen.fixedpoint import derivation
from strapgen.fixedpoint.accumulation import accumulation, step_errors
from strapgen.fixedpoint.angle_accumulation import angle_accumulation
from strapgen.fixedpoint.format_plan import (
    MOST_GUARD_BITS,
    FormatPlan,
    Limit,
    format_plan,
    limits,
    sums_of_inputs_are_exact,
)
from strapgen.fixedpoint.high_words import (
    Walk,
    high_products,
    high_words,
    in_order,
    with_exact_parts_apart,
)
from strapgen.fixedpoint.integer_sums import (
    HighWords,
    Lowered,
    Quantization,
    integer_value,
    lower_sum,
    word_of,
)
from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import (
    ExactOperation,
    Operand,
    Quantities,
    Quantity,
    Sum,
    is_dyadic,
    is_power_of_two,
    largest_wide,
    nearest,
)
from strapgen.fixedpoint.quantities import used_by as used_by_quantity
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import LOST, Format, finest
from strapgen.ir.integer_program import (
    FixedProgram,
    IntegerOperation,
    IntegerSum,
    Scaled,
    Term,
    Value,
    cases_of,
    operation_counts,
    used_by,
)
from strapgen.ir.interfaces import Argument, ErrorFeedback, Interface
from strapgen.ir.program import Program, Result
from strapgen.ir.signals import CYCLE, Signal

#: Shorter formats are chosen where they cost no more than a hundredth in error.
_WORSE = Fraction(101, 100)
#: High words are taken where they cost no more than a sixtieth in error.
_NARROWED = Fraction(61, 60)
#: Part of a unit in the last place that values may be too low by on average, as they are rounded down.
_BIAS = Fraction(1, 128)


@dataclass(frozen=True)
class Planned:
    """A program in integers before the search for high words, which takes most of the time."""

    quantities: Quantities
    plan: FormatPlan
    context: Quantization
    fixed: FixedProgram


def planned(program: Program, settings: Settings) -> Planned:
    """Lower a program to integers; parameters and errors are those of `strapgen.fixedpoint.quantize`."""
    quantities, plan = _plan(program, settings)
    finest = _walk(program, settings, quantities, plan, {})
    if settings.multiply in LOST:
        context = _high_products(program, settings, quantities, plan, finest)
        return Planned(quantities, plan, context, _fixed_program(context))
    coarser = aligning(finest.body, finest.values, plan.forced)
    shorter = _walk(program, settings, quantities, plan, coarser)
    one, other = (Planned(quantities, plan, walk, _fixed_program(walk)) for walk in (finest, shorter))
    return one if _is_worse(other.fixed, one.fixed) else other


def finished(planned: Planned) -> FixedProgram:
    """Return the program, with sums narrowed to high words where that saves operations, and with its accumulation."""
    context, fixed = planned.context, planned.fixed
    if not context.settings.digits and context.settings.multiply not in LOST:
        narrowed = _high_words(planned)
        if narrowed is not None:
            program_of = _fixed_program(narrowed)
            if sum(program_of.operations.values()) < sum(fixed.operations.values()):
                context, fixed = narrowed, program_of
    return _with_accumulation(context, fixed)


def _with_accumulation(context: Quantization, fixed: FixedProgram) -> FixedProgram:
    """Return a program with what its errors add up to in a run, where it is a step."""
    program = context.program
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


def _high_words(planned: Planned) -> Quantization | None:
    """Return a walk that narrows sums to their high words, where that costs no more than a sixtieth in error."""
    other, quantities, plan = planned.context, planned.quantities, planned.plan
    program, settings = other.program, other.settings
    if other.resets:
        return None
    outputs, transition = _result_names(program, quantities)
    # Where the rounding of the state comes back in the next call, what adds up is the error of the transition.
    limited = outputs if settings.carry == "none" else [*outputs, *transition]
    limits = {name: other.values[name].error * _NARROWED for name in limited if name in other.values}
    # Over a run biases add up, where errors of rounding to the nearest do not, nor those that come back.
    biases = dict(limits)
    if program.attitude_step is not None or program.recursion is not None:
        bias = _BIAS if settings.carry == "none" else Fraction(0)
        biases = {name: bias / 2 ** other.values[name].fraction for name in limits}

    parted = with_exact_parts_apart(quantities, {*plan.words, *plan.forced})
    try:
        narrowed = high_words(_walks(program, settings, plan), parted, limits, biases)
    except (InputError, ArithmeticError):  # a word is too short, or a coarse divisor may be zero
        return None
    if narrowed is not None:
        narrowed.body = in_order(narrowed.body, outputs, transition)
    return narrowed


def _high_products(
    program: Program, settings: Settings, quantities: Quantities, plan: FormatPlan, finest: Quantization
) -> Quantization:
    """Return the walk that narrows every product to its high word, with an error of few times the finest."""
    outputs, transition = _result_names(program, quantities)
    # A product loses that much in place of half a unit.
    times = 1 + LOST[settings.multiply]
    limits = {name: times * finest.values[name].error for name in outputs if name in finest.values}
    parted = with_exact_parts_apart(quantities, {*plan.words, *plan.forced})
    # A sum of products is one of words, except where a root or a comparison takes it.
    compared = {
        name
        for quantity in parted.items.values()
        if not isinstance(quantity.definition, Sum)
        for name in used_by_quantity(quantity)
    }
    multiplied = {
        name
        for name, quantity in parted.items.items()
        if isinstance(quantity.definition, Sum)
        and any(len(m) == 2 or (m and not is_power_of_two(c)) for m, c in quantity.definition.terms)
    }
    plan = replace(plan, words=plan.words | (multiplied - compared))
    try:
        context = high_products(_walks(program, settings, plan), parted, limits)
    except InputError as error:
        raise InputError(f"{error} with multiply {settings.multiply}") from None
    context.body = in_order(context.body, outputs, transition)
    return context


def _walks(program: Program, settings: Settings, plan: FormatPlan) -> Walk:
    """Return the walks of a plan, which share what comes out the same."""
    known: dict[Hashable, Lowered] = {}

    def walk(some: Quantities, most: Mapping[str, int], high: HighWords) -> Quantization:
        return _walk(program, settings, some, plan, most, high, known)

    return walk


def _result_names(program: Program, quantities: Quantities) -> tuple[list[str], list[str]]:
    """Return the quantities that hold elements of the outputs, and those of the transition."""
    results = {
        signal: [name for name in names if isinstance(name, str)]
        for signal, names in quantities.results.items()
    }
    outputs = [name for result in program.outputs for name in results[result.signal.name]]
    transition = [] if program.transition is None else results[program.transition.signal.name]
    return outputs, transition


def _plan(program: Program, settings: Settings) -> tuple[Quantities, FormatPlan]:
    """Return the exact quantities and the formats of the inputs, with guard bits if they make sums of inputs exact."""
    stated = limits(program, settings)
    first = _with_guard_bits(program, settings, stated, 0)
    # What is handed on from call to call keeps its finest format: it is no increment.
    if program.recursion is not None or sums_of_inputs_are_exact(first[1], first[0], settings.word):
        return first
    for guard_bits in range(1, MOST_GUARD_BITS + 1):
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
    """Return whether the increments are split off the transition, whose rounding has no error feedback then.

    A rotation vector that is a word of its own is rounded before the transition, out of reach of the feedback.
    """
    kernels = program.attitude_step
    through_vector = kernels is not None and kernels.truncation is not None
    return settings.carry == "state" or (settings.carry == "full" and through_vector)


def _walk(
    program: Program,
    settings: Settings,
    quantities: Quantities,
    plan: FormatPlan,
    most: Mapping[str, int],
    high: HighWords | None = None,
    known: dict[Hashable, Lowered] | None = None,
) -> Quantization:
    """Lower the quantities one by one, and return the final state of the walk."""
    names = _feedback_names(program, settings, quantities)
    context = Quantization(
        program, settings, quantities, plan, most, names, high, {} if known is None else known
    )
    for quantity in quantities.items.values():
        match quantity.definition:
            case Sum() as total if not _is_unused_constant(context, quantity, total):
                lower_sum(context, quantity, total)
            case ExactOperation(kind) as operation:
                LOWER[kind](context, quantity, operation)
    return context


def _is_unused_constant(context: Quantization, quantity: Quantity, total: Sum) -> bool:
    """Return whether a sum is a constant that needs no word, or that exists already."""
    exact = not quantity.offset and not quantity.approximation_error
    constant = exact and all(not monomial for monomial, _ in total.terms)
    unused = (not total.terms or constant) and quantity.name not in context.plan.words
    return unused or quantity.name in context.values


def _feedback_names(program: Program, settings: Settings, quantities: Quantities) -> dict[str, str]:
    """Return the name of the error feedback of every quantity whose rounding error goes into the next call."""
    if settings.carry == "none":
        return {}
    elements = [
        name for result in _feed_back(program, settings) for name in quantities.results[result.signal.name]
    ]
    return {name: f"residual_{name}" for name in elements if isinstance(name, str)}


def _feed_back(program: Program, settings: Settings) -> list[Result]:
    """Return the results whose rounding errors are fed back into the next call."""
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
    """Return whether an output of one program has an error bound that is notably above that of another."""
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
    """Refuse a program that uses a saturated value further: it may be far from the exact one."""
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


# Operations that are no sums


def lower_quotient(context: Quantization, quantity: Quantity, operation: ExactOperation) -> None:
    """Lower a quotient to a word of the finest format for which the numerator has room."""
    word, values = context.word, context.values
    numerator, denominator = operation.arguments[0], str(operation.arguments[1])
    if values[denominator].error:  # what is exact, a wide number too, stays so
        denominator = word_of(context, denominator)
    if isinstance(numerator, str) and values[numerator].error:
        numerator = word_of(context, numerator)
    below, above = values[denominator], _at_one_fraction(context, [numerator])
    (top,) = above.scaled
    size = abs(top.value) if isinstance(top.value, int) else values[top.value].magnitude
    room = largest_wide(word) - below.magnitude
    least = min(abs(below.low), abs(below.high)) / Fraction(2) ** below.fraction
    inherited = (above.error + quantity.range.magnitude * below.error) / least
    is_forced = quantity.name in context.plan.forced
    fraction = context.plan.forced.get(quantity.name, finest(quantity.range.magnitude, word))
    while True:
        shift = fraction + below.fraction - above.fraction
        value = integer_value(
            context,
            quantity,
            IntegerOperation("divide", (Scaled(top.value, top.shift + shift), Scaled(denominator))),
            fraction,
            inherited + context.rounding_error / Fraction(2) ** fraction,
            size << max(0, shift),
        )
        if value.magnitude <= context.largest(fraction) and shift >= 0 and size << shift <= room:
            break
        if is_forced or fraction < -word:
            raise context.too_short(quantity.name)
        fraction -= 1
    context.add(value)


def lower_root(context: Quantization, quantity: Quantity, operation: ExactOperation) -> None:
    """Lower a square root: as many places below the argument as a wide number has room for, an even number in all."""
    radicand = str(operation.arguments[0])
    argument, inside = context.values[radicand], context.quantities.items[radicand].range
    shift = 2 * context.word - 3 - max(1, argument.high).bit_length()
    shift -= (argument.fraction + shift) % 2
    fraction = (argument.fraction + shift) // 2
    lost = argument.error + (Fraction(2) ** -(2 * fraction) if shift < 0 else 0)
    least = inside.lowest - lost
    near_zero = Interval.of(0, lost).sqrt().highest
    error = lost / (2 * Interval.of(least).sqrt().lowest) if least > 0 else near_zero
    value = integer_value(
        context,
        quantity,
        IntegerOperation("sqrt", (Scaled(radicand, shift),)),
        fraction,
        error + context.rounding_error / Fraction(2) ** fraction,
        argument.high << shift if shift > 0 else argument.high,
    )
    value = replace(value, low=max(value.low, 0), high=min(value.high, 1 << (context.word - 1)))
    if value.magnitude > context.largest(fraction):
        raise context.too_short(quantity.name)
    context.add(value)


def lower_maximum(context: Quantization, quantity: Quantity, operation: ExactOperation) -> None:
    """Lower the largest of several quantities."""
    operands = _at_one_fraction(context, operation.arguments)
    _add(context, quantity, IntegerOperation("maximum", operands.scaled), operands.fraction, operands.error)


def lower_selection(context: Quantization, quantity: Quantity, operation: ExactOperation) -> None:
    """Lower a selection; where a comparison is inexact, another case may be selected, and the error is the range."""
    conditions = cases_of(operation.arguments)
    outcomes = [*(outcome for _, _, outcome in conditions), operation.arguments[-1]]
    values = _at_one_fraction(context, outcomes, lossless=False)
    selected: list[Scaled] = []
    error = values.error
    for (left, right, _), value in zip(conditions, values.scaled, strict=False):
        selected += [*_at_one_fraction(context, [left, right]).scaled, value]
        if any(context.values[side].error for side in (left, right) if isinstance(side, str)):
            error += quantity.range.highest - quantity.range.lowest
    selection = IntegerOperation("select", (*selected, values.scaled[-1]))
    _add(context, quantity, selection, values.fraction, error)


def lower_computed(context: Quantization, quantity: Quantity, operation: ExactOperation) -> None:
    """Keep the computed value inside the range of the exact one, which brings it no farther from that."""
    argument = str(operation.arguments[0])
    name = word_of(context, argument)
    value = context.values[name]
    unit = Fraction(2) ** value.fraction
    low, high = math.ceil(quantity.range.lowest * unit), math.floor(quantity.range.highest * unit)
    if low > high:
        raise context.too_short(argument)
    cases: list[Scaled] = []
    if value.high > high:
        cases += [Scaled(name), Scaled(high), Scaled(high)]
    if value.low < low:
        cases += [Scaled(low), Scaled(name), Scaled(low)]
    whole = IntegerSum((Term((name,), 1),))
    clamped = IntegerOperation("select", (*cases, Scaled(name))) if cases else whole
    inside = integer_value(context, quantity, clamped, value.fraction, Fraction(0), value.magnitude)
    context.add(replace(inside, low=max(low, value.low), high=min(high, value.high)))


def lower_nearest_integer(context: Quantization, quantity: Quantity, operation: ExactOperation) -> None:
    """Round a multiple to an integer, halves up whatever the rounding of words is."""
    argument, multiple = operation.arguments
    name, exact = word_of(context, str(argument)), Fraction(multiple)
    value = context.values[name]
    factor = exact.numerator
    shift = value.fraction + exact.denominator.bit_length() - 1
    if shift < 1:
        raise context.too_short(name)
    half = 1 << (shift - 1)
    terms = [Term((name,), factor)]
    if context.settings.rounding != "nearest":
        terms.append(Term((), half))
    peak = value.magnitude * abs(factor) + half
    integer = integer_value(context, quantity, IntegerSum(tuple(terms), shift), 0, Fraction(0), peak)
    low, high = sorted((end * factor + half) >> shift for end in (value.low, value.high))
    context.add(replace(integer, low=low, high=high))


def _add(
    context: Quantization, quantity: Quantity, definition: IntegerOperation, fraction: int, error: Fraction
) -> None:
    """Add a value that is one of its operands: a wide number if a word does not hold it."""
    value = integer_value(context, quantity, definition, fraction, error, 0)
    peak = value.magnitude
    context.add(replace(value, wide=peak > context.largest(fraction), peak=peak))


# Operands at one fraction


@dataclass(frozen=True)
class _Operands:
    scaled: tuple[Scaled, ...]
    fraction: int  # bits
    error: Fraction  # the largest of all


def _at_one_fraction(context: Quantization, operands: Sequence[Operand], lossless: bool = True) -> _Operands:
    """Return operands as integers of one fraction: the finest of theirs, or if not `lossless` one with room for all."""
    room = largest_wide(context.word)
    fraction = max(_finest_fraction(context, operand) for operand in operands)
    while not lossless and max(_size(context, operand, fraction) for operand in operands) > room:
        fraction -= 1
    scaled: list[Scaled] = []
    error = Fraction(0)
    for operand in operands:
        if isinstance(operand, Fraction):
            integer = nearest(operand * Fraction(2) ** fraction)
            error = max(error, abs(integer / Fraction(2) ** fraction - operand))
            scaled.append(Scaled(integer))
        else:
            value = context.values[operand]
            lost = Fraction(2) ** -fraction if fraction < value.fraction else Fraction(0)
            error = max(error, value.error + lost)
            scaled.append(Scaled(operand, fraction - value.fraction))
        if _size(context, operand, fraction) > room:
            raise InputError(
                f"{context.program.kernel}: words of {context.word} bits are too short to compare {operand}"
            )
    return _Operands(tuple(scaled), fraction, error)


def _finest_fraction(context: Quantization, operand: Operand) -> int:
    """Return the fraction bits at which an operand is exact; of a number without end, those of a word."""
    if isinstance(operand, str):
        return context.values[operand].fraction
    return operand.denominator.bit_length() - 1 if is_dyadic(operand) else context.word


def _size(context: Quantization, operand: Operand, fraction: int) -> int:
    """Return the largest magnitude of an operand as an integer of so many fraction bits."""
    if isinstance(operand, Fraction):
        return abs(nearest(operand * Fraction(2) ** fraction))
    value = context.values[operand]
    return math.ceil(value.magnitude * Fraction(2) ** (fraction - value.fraction))


#: Lowers each kind of operation to integers that stand for a quantity.
LOWER: dict[str, Callable[[Quantization, Quantity, ExactOperation], None]] = {
    "divide": lower_quotient,
    "sqrt": lower_root,
    "maximum": lower_maximum,
    "select": lower_selection,
    "computed": lower_computed,
    "nearest": lower_nearest_integer,
}


# Coarser formats, with which products of a sum are added without shifts

#: Bits below the last place of a sum down to which its products are computed.
_BELOW = 8
#: A coarser format may add a part of the rounding error of a value that it is multiplied into: so many bits less.
_PART = 4
#: Bits by which that is less where the sum's own rounding comes with the next call: other errors add up alone.
_FED_BACK = 4


def aligning(body: Iterable[Value], values: Mapping[str, Value], fixed: Container[str]) -> dict[str, int]:
    """Return, by name, the largest useful number of fraction bits of values that are finer than the sums that use them.

    In `body` every value has its finest format; values in `fixed` keep theirs.
    """
    useful: dict[str, int] = {}
    allowed: dict[str, int] = {}
    for value in body:
        for name, bits, most in _uses(value, values):
            useful[name] = max(bits, useful.get(name, 0))
            allowed[name] = min(most, allowed.get(name, most))
    coarser: dict[str, int] = {}
    for name in useful:
        definition = values[name].definition
        rounded = isinstance(definition, IntegerSum) and definition.shift and definition.residual is None
        bits = min(useful[name], allowed[name])
        if bits > 0 and rounded and name not in fixed:
            coarser[name] = values[name].fraction - bits
    return coarser


def _uses(value: Value, values: Mapping[str, Value]) -> Iterator[tuple[str, int, int]]:
    """Yield the operands of a value, each with the bits by which it should be coarser, and by which it may be."""
    definition = value.definition
    if not isinstance(definition, IntegerSum) or value.wide or not definition.shift:
        # Every bit counts of what is compared, or added at full precision.
        for name in used_by(value):
            yield name, 0, 0
        return
    for term in definition.coarse:
        for name in term.names:
            yield name, 0, 0
    place = value.fraction + definition.shift + definition.drop
    lowest = value.fraction + _BELOW
    goal = max(min((place - term.shift for term in definition.fine if term.names), default=place), lowest)
    for term in definition.fine:
        term_place = place - term.shift
        for name in term.names:
            others = [other for other in term.names if other != name]
            is_square = len(others) < len(term.names) - 1
            room = (
                0 if is_square else _room(term, term_place, value, values[name], [values[o] for o in others])
            )
            finer = len(others) == 1 and values[others[0]].fraction > values[name].fraction
            yield name, 0 if finer else max(0, term_place - goal), min(max(0, term_place - lowest), room)


def _room(term: Term, place: int, value: Value, factor: Value, others: list[Value]) -> int:
    """Return the bits by which a factor of a term may be coarser, so that the error of the sum hardly grows."""
    # What an error of the factor is multiplied with, as an integer with fraction bits.
    size, bits = abs(term.factor), place - factor.fraction
    for other in others:
        size, bits = other.magnitude, other.fraction
    if not size:  # a product with what is always zero
        return place
    is_fed_back = isinstance(value.definition, IntegerSum) and value.definition.residual is not None
    fraction = value.fraction + (_FED_BACK if is_fed_back else 0)
    units = factor.fraction + bits - fraction - _PART
    return max(0, ((1 << units) // size).bit_length() - 1) if units > 0 else 0
