"""Writes sums of products as integers: products are aligned, added and rounded once, with error feedback or without."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from strapgen.fixedpoint.format_plan import carried_input
from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import Monomial, Quantity, Sum, exponent, is_dyadic, is_power_of_two
from strapgen.fixedpoint.quantization_context import Quantization, integer_value
from strapgen.fixedpoint.terms import Aligned, Placed, aligned, binary, largest_wide, nearest, up
from strapgen.fixedpoint.words.filters import Factor, filter_words, nearest_word
from strapgen.ir.exceptions import InputError
from strapgen.ir.formats import Format, finest, from_digits, signed_digits
from strapgen.ir.integer_program import Coefficient, IntegerSum, Term, Value
from strapgen.ir.interfaces import ErrorFeedback


def lower_sum(context: Quantization, quantity: Quantity, definition: Sum) -> None:
    """Lower a sum of products to a word, or to a wide number where no word is needed."""
    value = _lowered(context, quantity, definition)
    if (
        quantity.range_checked
        and quantity.name not in context.resets
        and _note_squares(context, quantity, definition)
    ):
        # In calls that pass, errors are smaller; the limits of the check are those of any call.
        again = _lowered(context, quantity, definition)
        if again.fraction == value.fraction:
            value = replace(value, error=min(value.error, again.error))
    context.add(value)


def _lowered(context: Quantization, quantity: Quantity, definition: Sum) -> Value:
    """Return the integer of a sum."""
    terms = _integer_terms(context, definition)
    followed = _followed_error(context, quantity)
    if quantity.name not in context.plan.words:
        return _wide(context, quantity, terms, followed)
    natural = finest(quantity.range.magnitude, context.word)
    places = [item.place for item in terms]
    useful = natural if _counts_alone(context, terms) else max(places, default=natural)
    fraction = min(natural, useful, context.most.get(quantity.name, natural))
    fraction = context.plan.forced.get(quantity.name, fraction)
    value = _rounded(context, quantity, terms, fraction, followed)
    while value.magnitude > context.largest(value.fraction):
        if quantity.name in context.plan.forced:
            return _limited(context, quantity, value)
        value = _rounded(context, quantity, terms, value.fraction - 1, followed)
    return value


def _note_squares(context: Quantization, quantity: Quantity, definition: Sum) -> bool:
    """Note bounds of quantities where the sum of their squares has passed its check; False of other sums."""
    terms = dict(definition.terms)
    room = quantity.range.highest + quantity.approximation_error - terms.pop((), Fraction(0))
    if not terms or any(len({*m}) != 1 or len(m) != 2 or c <= 0 for m, c in terms.items()):
        return False
    for (name, _), coefficient in terms.items():
        context.checked[name] = min(context.size(name), Interval.of(room / coefficient).sqrt().highest)
    return True


def word_of(context: Quantization, name: str) -> str:
    """Return the name of a value as a word, which is rounded from the wide one if it is needed."""
    wide = context.values[name]
    if not wide.wide:
        return name
    rounded = f"{name}_word"
    if rounded not in context.values:
        exact = context.quantities.items[name]
        quantity = replace(
            exact,
            name=rounded,
            meaning="",
            range_checked=False,
            approximation_error=Fraction(0),
            inherited_error=None,
        )
        terms = [Placed(Term((name,), 1), wide.fraction, wide.error)]
        fraction = min(finest(exact.range.magnitude, context.word), wide.fraction)
        value = _rounded(context, quantity, terms, fraction)
        while value.magnitude > context.largest(value.fraction):
            value = _rounded(context, quantity, terms, value.fraction - 1)
        context.add(value)
    return rounded


# Terms


def _counts_alone(context: Quantization, terms: Sequence[Placed]) -> bool:
    """Tell whether a sum is one of a gyro's counts; it fills its word, so that its products need fewer shifts."""
    counts = {n for a in context.plan.inputs if a.sensor is not None for n in a.signal.elements}
    return all(len(item.term.names) == 1 and counts.issuperset(item.term.names) for item in terms) and bool(
        counts
    )


def _integer_terms(context: Quantization, definition: Sum) -> list[Placed]:
    """Return the terms of a sum as integers, each with its fraction bits and its error."""
    words = filter_words(context.quantities, context.program.inputs, definition, context.word)
    terms = [
        _product_term(context, monomial, coefficient, words.get(monomial))
        for monomial, coefficient in definition.terms
        if monomial
    ]
    constant = next((coefficient for monomial, coefficient in definition.terms if not monomial), Fraction(0))
    if constant:
        terms.append(_constant_term(constant, [item.place for item in terms], context.word))
    return terms


def _product_term(
    context: Quantization, monomial: Monomial, coefficient: Fraction, rounded: Factor | None = None
) -> Placed:
    """Return a multiple of one or two values as an integer term, of the nearest coefficient or of a stated one."""
    shifts = is_power_of_two(coefficient)
    names = tuple(word_of(context, n) if len(monomial) == 2 or not shifts else n for n in monomial)
    values = [context.values[name] for name in names]
    error = _product_error(context, values, monomial) * abs(coefficient)
    places = sum(value.fraction for value in values)
    if shifts:
        sign = 1 if coefficient > 0 else -1
        return Placed(Term(names, sign), places - exponent(coefficient), up(error))
    factor, bits = rounded or nearest_word(coefficient, context.word)
    if context.settings.digits and rounded is None:
        factor = from_digits(signed_digits(factor, context.settings.digits))
    wrong = abs(binary(factor, bits) - coefficient)
    stored = binary(values[0].magnitude, values[0].fraction)
    term = Term(names, factor, coefficient=Coefficient(coefficient, bits))
    return Placed(term, places + bits, up(error + wrong * stored))


def _product_error(context: Quantization, values: Sequence[Value], monomial: Monomial) -> Fraction:
    """Return the error of an exact product of inexact values."""
    if len(values) == 1:
        return values[0].error
    a, b = values
    size_a, size_b = map(context.size, monomial)
    return size_a * b.error + size_b * a.error + a.error * b.error


def _constant_term(constant: Fraction, places: Sequence[int], word: int) -> Placed:
    """Return a constant as an integer term: exact if it is dyadic, else as fine as the other terms or finer."""
    longest = 2 * word - 3
    if is_dyadic(constant):
        place = constant.denominator.bit_length() - 1
    else:
        place = max([*places, finest(abs(constant), longest)])
    place = min(place, longest - math.ceil(abs(constant)).bit_length())
    integer = nearest(constant * Fraction(2) ** place)
    wrong = abs(integer / Fraction(2) ** place - constant)
    return Placed(Term((), integer, coefficient=Coefficient(constant, place)), place, up(wrong))


# Rounding


@dataclass(frozen=True)
class _FineTerms:
    """The terms of a sum that are rounded, as they are added up."""

    aligned: Aligned
    shift: int  # places that the rounding drops
    added: int  # bound of what is added before it: half a unit, or the error feedback
    feedback: ErrorFeedback | None
    error: Fraction  # bound of the error before rounding

    @property
    def peak(self) -> int:
        """Bound of the magnitude of every partial sum."""
        return self.aligned.peak + self.added


def _wide(context: Quantization, quantity: Quantity, terms: Sequence[Placed], followed: Fraction) -> Value:
    """Return a sum at full precision: it is only added, compared or drawn a root from."""
    fraction = max((item.place for item in terms), default=context.word - 1)
    while True:
        total = aligned(terms, fraction, context.word, context.values)
        if total.fits(context.word, context.values):
            break
        fraction -= 1
    definition = IntegerSum(total.terms)
    return integer_value(context, quantity, definition, fraction, total.error, total.peak, True, followed)


def _rounded(
    context: Quantization,
    quantity: Quantity,
    terms: Sequence[Placed],
    fraction: int,
    followed: Fraction = Fraction(0),
) -> Value:
    """Return a sum as a word of so many fraction bits."""
    word, values = context.word, context.values
    fine_terms = [item for item in terms if item.place > fraction]
    coarse = aligned([item for item in terms if item.place <= fraction], fraction, word, values)
    if not coarse.fits(word, values):
        raise context.too_short(quantity.name)
    largest_word = context.largest(fraction)
    if not fine_terms:
        definition = IntegerSum(coarse.terms, in_words=coarse.peak <= largest_word)
        return integer_value(
            context, quantity, definition, fraction, coarse.error, coarse.peak, followed=followed
        )
    fine = _fine(context, quantity.name, fine_terms, fraction)
    rounded_peak = (fine.peak >> fine.shift) + 1
    if not coarse.fits(word, values, rounded_peak) or fine.peak > largest_wide(word):
        raise context.too_short(quantity.name)
    feedback = fine.feedback
    drop = max(0, fraction + fine.shift - feedback.fraction) if feedback is not None else 0
    # With error feedback, the result is off by what was left before and what is left now.
    roundings = 2 if feedback is not None else 1
    error = fine.error + coarse.error + roundings * context.rounding_error / Fraction(2) ** fraction
    value = integer_value(
        context,
        quantity,
        IntegerSum(
            fine.aligned.terms,
            fine.shift - drop,
            coarse.terms,
            feedback,
            drop,
            in_words=coarse.peak + rounded_peak <= largest_word,
        ),
        fraction,
        error,
        max(fine.peak, coarse.peak + rounded_peak),
        followed=followed,
    )
    if feedback is not None:  # whatever integer a caller hands over as a residual
        value = replace(value, low=value.low - 1, high=value.high + 1)
    return value


def _fine(context: Quantization, name: str, terms: Sequence[Placed], fraction: int) -> _FineTerms:
    """Return the terms that are rounded at the finest place at which they have room."""
    word, values = context.word, context.values
    rounds_to_nearest = context.settings.rounding == "nearest"
    feedback_name = context.feedback_names.get(name)
    for place in range(max(item.place for item in terms), fraction, -1):
        shift = place - fraction
        total = aligned(terms, place, word, values)
        error, feedback = total.error, None
        added = 1 << (shift - 1) if rounds_to_nearest else 0
        if feedback_name is not None:
            below = fraction + word  # fraction bits of the feedback
            fresh = 1 << (word - 1) if rounds_to_nearest else 0
            feedback = ErrorFeedback(feedback_name, below, min(0, place - below), fresh)
            added = 1 << shift
            error += Fraction(2) ** -min(below, place)
        if shift < 2 * word - 1 and total.fits(word, values, added):
            return _FineTerms(total, shift, added, feedback, error)
    raise context.too_short(name)


def _limited(context: Quantization, quantity: Quantity, value: Value) -> Value:
    """Return a value in a fixed format that does not hold its range: it is checked if its range is otherwise known."""
    largest = context.largest(value.fraction)
    if context.settings.state and _is_attitude(context, quantity.name):
        return replace(value, low=max(value.low, -largest - 1), high=min(value.high, largest), saturated=True)
    known = _known_limit(context, quantity.name)
    inside = quantity.range + Interval.of(quantity.offset) if known is None else Interval.symmetric(known)
    limit = None if known is None else math.floor(known * Fraction(2) ** value.fraction)
    if limit is None or limit > largest:
        if not _is_stated(context, quantity.name):  # chosen from the range, and errors go beyond it
            raise context.too_short(quantity.name)
        raise InputError(
            f"format {Format(context.word, value.fraction)} of {quantity.name} does not hold its range "
            f"{inside.text()}{', less ' + str(quantity.offset) if quantity.offset else ''}"
        )
    return replace(value, low=max(value.low, -limit), high=min(value.high, limit), range_checked=True)


def _is_attitude(context: Quantization, name: str) -> bool:
    """Tell whether a quantity is an element of an output that is an attitude."""
    results = context.quantities.results
    return any(r.signal.constraint and name in results[r.signal.name] for r in context.program.outputs)


def _is_stated(context: Quantization, name: str) -> bool:
    """Tell whether the user states the format of a quantity, or of an output or the transition that it belongs to."""
    signals = {signal for signal, names in context.quantities.results.items() if name in names}
    return bool({name, "state", *signals} & context.settings.formats.keys())


def _known_limit(context: Quantization, name: str) -> Fraction | None:
    """Return the largest magnitude of an output whose range is known but not proved."""
    program, inputs = context.program, context.plan.inputs
    for result in program.outputs:
        if name in context.quantities.results[result.signal.name]:
            if result.signal.constraint:
                return Fraction(1) + context.settings.allowance
            following = carried_input(program, inputs, result.signal)
            if following is None and program.attitude_step is not None:  # the state of the next step
                following = inputs[0]
            if following is not None:
                return following.high * following.format.unit
    return None


def _followed_error(context: Quantization, quantity: Quantity) -> Fraction:
    """Return the error inherited from quantities that were taken as exact on the way to this one."""
    if quantity.inherited_error is None:
        return Fraction(0)
    errors = {
        name: context.values[word_of(context, name)].error for name, _ in quantity.inherited_error.slopes
    }
    return up(quantity.inherited_error.bound(errors))
