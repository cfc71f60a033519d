"""Rounds sums of products to integers, which `Quantization` collects with their ranges and error bounds."""

from __future__ import annotations

import itertools
import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

from strapgen.fixedpoint.filters import Factor, filter_words, longest, nearest_word
from strapgen.fixedpoint.format_plan import FormatPlan, carried_input
from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import (
    Aligned,
    InputElement,
    Monomial,
    Placed,
    Quantities,
    Quantity,
    Sum,
    aligned,
    binary,
    exponent,
    is_dyadic,
    is_power_of_two,
    largest_wide,
    nearest,
    up,
    used_by,
)
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import LOST, ROUNDINGS, Format, finest, from_digits, signed_digits
from strapgen.ir.integer_program import Coefficient, IntegerOperation, IntegerSum, Term, Value
from strapgen.ir.interfaces import ErrorFeedback
from strapgen.ir.program import Program

#: What a sum may grow by in its roundings, when there is room for it.
_ROOM = 1 + Fraction(1, 1 << 10)
#: Part of the smaller end of a checked range that an error may take, so that proper input passes the check.
_LARGEST_PART = Fraction(1, 2)


@dataclass(frozen=True)
class HighWords:
    """Choices where sums of products are narrowed by taking their high words."""

    fine: frozenset[str] = frozenset()  # values as fine as their words allow, narrowed by fewer bits
    kept: frozenset[str] = (
        frozenset()
    )  # values not made coarser where products lie at other places: those are shifted
    down: frozenset[str] = frozenset()  # values rounded down, which takes no instruction
    alone: bool = False  # whether every product is narrowed by itself, and sums are added up in words


@dataclass(frozen=True)
class Lowered:
    """What came of a sum: its value, those that it added before, and the formats wanted of its factors."""

    value: Value
    added: tuple[Value, ...]
    wanted: Mapping[str, int]
    factors: tuple[Value | None, ...]  # kept, as they are told apart by identity


@dataclass
class Quantization:
    """The state of a walk over the exact quantities of a program."""

    program: Program
    settings: Settings
    quantities: Quantities
    plan: FormatPlan
    most: Mapping[str, int]  # most fraction bits of quantities that need not be finer
    feedback_names: Mapping[str, str]  # error feedbacks by the quantity whose rounding error they hand on
    high: HighWords | None = None  # the choices where sums are narrowed to their high words
    #: What came of sums in walks with other choices, which the same sum of the same values takes again.
    known: dict[Hashable, Lowered] = field(default_factory=dict)
    word: int = field(init=False)  # bits
    rounding_error: Fraction = field(init=False)  # largest error of a rounding, in units of the last place
    values: dict[str, Value] = field(init=False)  # the integers so far, those of the inputs included
    body: list[Value] = field(default_factory=list)  # the integers so far, in the order of the code
    resets: set[str] = field(default_factory=set)  # quantities whose computed value is exact from there on
    #: Fraction bits of factors with which the products of a sum would lie at one place.
    wanted: dict[str, int] = field(default_factory=dict)
    #: Largest magnitudes in calls that pass the checks.
    checked: dict[str, Fraction] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.word, self.rounding_error = self.settings.word, ROUNDINGS[self.settings.rounding]
        self.values = dict(self.plan.values)
        self._proved: dict[str, Fraction] = {}

    def largest(self, fraction: int) -> int:
        """Return the largest integer that a word of so many fraction bits holds."""
        return Format(self.word, fraction).largest

    def size(self, name: str) -> Fraction:
        """Return the largest magnitude of a quantity in calls that pass the checks so far."""
        proved = self._proved.get(name)
        if proved is None:
            proved = self._proved[name] = self.quantities.items[name].range.magnitude
        return min(proved, self.checked.get(name, proved))

    def too_short(self, name: str) -> InputError:
        """Return the error that says that a word does not hold a quantity."""
        return InputError(f"{self.program.kernel}: words of {self.word} bits are too short for {name}")

    def add(self, value: Value) -> None:
        """Add a value to the code."""
        self.values[value.name] = value
        self.body.append(value)


def integer_value(
    context: Quantization,
    quantity: Quantity,
    definition: IntegerSum | IntegerOperation,
    fraction: int,
    error: Fraction,
    peak: int,
    wide: bool = False,
    followed: Fraction = Fraction(0),
) -> Value:
    """Return a value with the range of its integer: that of the quantity, widened by the error.

    `error` is due to rounding and to operands, `followed` to quantities that were taken as exact on the way; `peak`
    bounds every partial sum.
    """
    unit = Fraction(2) ** fraction
    local = up(error + quantity.approximation_error)
    total = local + followed
    low, high = quantity.range.lowest, quantity.range.highest
    if quantity.range_checked and total > min(abs(low), abs(high)) * _LARGEST_PART:
        _reset(context, quantity)
        total, limits = Fraction(0), (math.ceil(low * unit), math.floor(high * unit))
    elif quantity.range_checked:
        # What passes the check is so far inside that the exact value is in the range too.
        limits = (math.ceil((low + total) * unit), math.floor((high - total) * unit))
    else:
        # What was taken as exact lies in its range too, so that its error does not lead out of this one.
        limits = (math.floor((low - local) * unit), math.ceil((high + local) * unit))
    return Value(
        quantity.name,
        definition,
        fraction,
        wide,
        *limits,
        quantity.offset,
        total,
        peak,
        quantity.range_checked,
        quantity.meaning,
    )


def _reset(context: Quantization, quantity: Quantity) -> None:
    """Take the computed value as exact from here on, because nothing is known of its distance from the exact one.

    What comes after is bounded as a function of the computed value, so that it stays inside its formats; an output
    that depends on it is certified by the range of its signal alone.
    """
    items = context.quantities.items
    only_checked = all(quantity.name not in used_by(item) for item in items.values())
    # Every output has a range by what it is: an attitude.
    limited = all(r.signal.constraint and r.signal.bound is not None for r in context.program.outputs)
    if only_checked or not limited or _is_polynomial(context.quantities, quantity.name):
        raise InputError(
            f"{context.program.kernel}: words of {context.word} bits are too short for {quantity.name}, its error may "
            "be as large as itself"
        )
    context.resets.add(quantity.name)


def _is_polynomial(quantities: Quantities, name: str) -> bool:
    """Return whether a quantity is a polynomial of the inputs, on which ranges of later ones may rest."""
    pending, seen = [name], set[str]()
    while pending:
        definition = quantities.items[pending.pop()].definition
        if isinstance(definition, Sum):
            factors = {factor for monomial, _ in definition.terms for factor in monomial}
            pending += factors - seen
            seen |= factors
        elif not isinstance(definition, InputElement):
            return False
    return True


def lower_sum(context: Quantization, quantity: Quantity, definition: Sum) -> None:
    """Lower a sum of products to a word, or to a wide number where no word is needed."""
    value = _lower(context, quantity, definition)
    if (
        quantity.range_checked
        and quantity.name not in context.resets
        and _note_squares(context, quantity, definition)
    ):
        # In calls that pass, errors are smaller; the limits of the check are those of any call.
        again = _lower(context, quantity, definition)
        if again.fraction == value.fraction:
            value = replace(value, error=min(value.error, again.error))
    context.add(value)


def _lower(context: Quantization, quantity: Quantity, definition: Sum) -> Value:
    """Return the integer of a sum."""
    followed = _followed_error(context, quantity)
    is_word = quantity.name in context.plan.words
    checked = quantity.range_checked or quantity.name in context.feedback_names
    if context.high is not None and not checked:
        return _lowered_again(context, context.high, quantity, definition, followed, is_word)
    terms = _integer_terms(context, definition)
    if not is_word:
        return _wide(context, quantity, terms, followed)
    natural = finest(quantity.range.magnitude, context.word)
    places = [item.place for item in terms]
    useful = natural if _counts_alone(context, terms) else max(places, default=natural)
    fraction = min(natural, useful, context.most.get(quantity.name, natural))
    fraction = context.plan.forced.get(quantity.name, fraction)
    value = _round(context, quantity, terms, fraction, followed)
    while value.magnitude > context.largest(value.fraction):
        if quantity.name in context.plan.forced:
            return _limit(context, quantity, value)
        value = _round(context, quantity, terms, value.fraction - 1, followed)
    return value


def _lowered_again(
    context: Quantization,
    high: HighWords,
    quantity: Quantity,
    definition: Sum,
    followed: Fraction,
    is_word: bool,
) -> Value:
    """Return the integer of a sum, that of an earlier walk where its values, formats and choices are the same."""
    name, values = quantity.name, context.values
    used = list(dict.fromkeys(factor for monomial, _ in definition.terms for factor in monomial))
    factors = tuple(values.get(one) for factor in used for one in (factor, f"{factor}_word"))
    down = frozenset(one for one in high.down if one == name or one.startswith(f"{name}_part"))
    kept = high.kept.intersection(used)
    choices = name in high.fine, down, kept, context.most.get(name), followed
    key = (name, choices, *map(id, factors))
    known = context.known.get(key)
    if known is None:
        wanted, before = context.wanted, len(context.body)
        context.wanted = {}
        if is_word:
            value = _narrowed(context, high, quantity, definition, followed)
        else:
            value = _unrounded(context, quantity, definition, followed)
        known = Lowered(value, tuple(context.body[before:]), context.wanted, factors)
        context.known[key], context.wanted = known, wanted
    else:
        for value in known.added:
            context.add(value)
    for one, bits in known.wanted.items():
        context.wanted[one] = min(bits, context.wanted.get(one, bits))
    return known.value


@dataclass
class _Gathered:
    """The terms of a sum by how they can be brought to a place."""

    #: Products, and wide numbers: at the place of their factors.
    products: list[Placed] = field(default_factory=list)
    #: Multiples of words, each with the place of its longest coefficient: at any place below that.
    multiples: list[tuple[Monomial, Fraction, int]] = field(default_factory=list)
    #: Words times powers of two, which are shifted.
    shifted: list[Placed] = field(default_factory=list)
    constant: Fraction = Fraction(0)


def _gathered(context: Quantization, name: str, definition: Sum) -> _Gathered:
    """Return the terms of a sum by how they can be brought to a place."""
    linear = [monomial for monomial, _ in definition.terms if len(monomial) == 1]
    # A filter that is fine keeps the longest coefficients, whose products lie at several places.
    fine = context.high is not None and name in context.high.fine
    fractions = None if fine else {factor: context.values[factor].fraction for (factor,) in linear}
    words = filter_words(context.quantities, context.program.inputs, definition, context.word, fractions)
    terms = _Gathered()
    for monomial, coefficient in definition.terms:
        if not monomial:
            terms.constant = coefficient
        elif len(monomial) == 2 or monomial in words:
            terms.products.append(_product_term(context, monomial, coefficient, words.get(monomial)))
        elif is_power_of_two(coefficient):
            item = _product_term(context, monomial, coefficient)
            if context.values[monomial[0]].wide and not (context.high and context.high.alone):
                terms.products.append(item)
            else:
                terms.shifted.append(item)
        else:
            most = context.values[word_of(context, monomial[0])].fraction + longest(coefficient, context.word)
            terms.multiples.append((monomial, coefficient, most))
    return terms


def _top(context: Quantization, definition: Sum, terms: _Gathered, fraction: int) -> int | None:
    """Return the place at which a sum of so many fraction bits adds up its products; None where it has none."""
    tops = [*(item.place for item in terms.products), *(most for *_, most in terms.multiples)]
    if not tops:
        return None
    after = {item.term.names for item in terms.shifted if item.place <= fraction}
    sizes = (
        abs(coefficient) * math.prod((context.size(name) for name in monomial), start=Fraction(1))
        for monomial, coefficient in definition.terms
        if monomial and monomial not in after
    )
    return min(*tops, finest(sum(sizes, Fraction(0)) * _ROOM, 2 * context.word))


def _unrounded(context: Quantization, quantity: Quantity, definition: Sum, followed: Fraction) -> Value:
    """Return a sum that no word is needed of, with its products at one place."""
    terms = _gathered(context, quantity.name, definition)
    top = _top(context, definition, terms, 0)
    placed = [*terms.products, *terms.shifted]
    if top is None:
        return _wide(context, quantity, _integer_terms(context, definition), followed)
    top = min(top, context.most.get(quantity.name, top))
    _note_wanted(context, terms.products, top)
    placed += [_multiple(context, monomial, c, top) for monomial, c, _ in terms.multiples]
    if terms.constant:
        placed.append(_constant_at(terms.constant, top))
    return _wide(context, quantity, placed, followed, top)


def _constant_at(constant: Fraction, place: int) -> Placed:
    """Return a constant as an integer term at a place."""
    integer = nearest(constant * Fraction(2) ** place)
    wrong = abs(integer / Fraction(2) ** place - constant)
    return Placed(Term((), integer, coefficient=Coefficient(constant, place)), place, up(wrong))


def _narrowed(
    context: Quantization, high: HighWords, quantity: Quantity, definition: Sum, followed: Fraction
) -> Value:
    """Return the integer of a sum whose products lie at one place, a word above that of the result."""
    name, word, forced = quantity.name, context.word, quantity.name in context.plan.forced
    terms = _gathered(context, quantity.name, definition)
    natural = finest(quantity.range.magnitude, word)
    fraction = context.plan.forced.get(name, min(natural, context.most.get(name, natural)))
    top = _top(context, definition, terms, fraction)
    if top is not None and name not in high.fine:
        fraction = min(fraction, top - word)
    elif top is None and (not terms.constant or is_dyadic(terms.constant)):
        fraction = min(fraction, max([item.place for item in terms.shifted] or [fraction]))
    fraction = context.plan.forced.get(name, fraction)
    products = list(terms.products)
    if top is not None:
        beyond = top - word - fraction
        narrowed = len(terms.products) + len(terms.multiples) + sum(i.place > fraction for i in terms.shifted)
        if not products or (high.alone and beyond > 0 and narrowed * (1 - Fraction(1, 1 << beyond)) <= 1):
            top = min(top, fraction + word)  # then nothing is left to round
        _note_wanted(context, products, top)
        products += [_multiple(context, monomial, c, top) for monomial, c, _ in terms.multiples]
    down = name in high.down
    before = len(context.body)
    while True:
        # The place of the high word, to which words are added before it is shifted on.
        high_place = fraction if top is None else max(fraction, top - word)
        if high.alone:
            value = _of_words(context, high, quantity, terms, products, high_place, fraction, followed)
        else:
            placed = list(products)
            for item in terms.shifted:
                apart = item.place > high_place
                placed.append(_part(context, high, quantity, item, high_place) if apart else item)
            if terms.constant:
                exact = (terms.constant * Fraction(2) ** fraction).denominator == 1
                placed.append(_constant_at(terms.constant, fraction if exact else high_place))
            value = _round(context, quantity, placed, fraction, followed, top, down)
        if value.magnitude <= context.largest(fraction):
            return value
        if forced:
            return _limit(context, quantity, value)
        fraction -= 1
        for part in context.body[before:]:
            del context.values[part.name]
        del context.body[before:]


def _of_words(
    context: Quantization,
    high: HighWords,
    quantity: Quantity,
    terms: _Gathered,
    products: Sequence[Placed],
    place: int,
    fraction: int,
    followed: Fraction,
) -> Value:
    """Return a sum whose products are narrowed to their high words one by one and added up in words at a place.

    The mean of what is cut off is in the constant of the sum.
    """
    word = context.word
    halves = context.settings.multiply == "half"
    if len(products) == 1 and not terms.shifted and not terms.constant and not halves:
        shift = products[0].place - fraction
        return _round(context, quantity, products, fraction, followed, down=shift == word)
    placed: list[Placed] = []
    constant, left = terms.constant, Fraction(0)
    for unnarrowed in (*products, *terms.shifted):
        item, mean = unnarrowed, Fraction(0)
        if _is_multiplied(item.term):
            bits = item.place - word if halves else min(item.place - word, place)
            item = _part(context, high, quantity, item, bits)
            mean = Fraction(LOST[context.settings.multiply], 2) * Fraction(2) ** -bits
        if item.place > place or any(context.values[name].wide for name in item.term.names):
            item = _part(context, high, quantity, item, min(item.place, place))
            mean += Fraction(1, 2) * Fraction(2) ** -item.place
        placed.append(replace(item, error=item.error - mean))
        constant += mean * item.term.factor
    if constant:
        integer = nearest(constant * Fraction(2) ** place)
        left = abs(integer / Fraction(2) ** place - constant)
        if integer:
            term = Term((), integer, coefficient=Coefficient(terms.constant, place))
            placed.append(Placed(term, place, up(left)))
        else:
            placed[0] = replace(placed[0], error=placed[0].error + up(left))
    return _round(context, quantity, placed, fraction, followed, place)


def _is_multiplied(term: Term) -> bool:
    """Return whether a term is a product, or a value times a number that is no shift."""
    return len(term.names) == 2 or abs(term.factor) != 1


def _note_wanted(context: Quantization, products: Sequence[Placed], top: int) -> None:
    """Note by how much factors would be coarser if the products that lie below a place lay at it."""
    for item in products:
        names = {*item.term.names}
        free = [name for name in names if _is_rounded(context.values[name]) and not _is_kept(context, name)]
        if item.place > top and free and len(names) == len(item.term.names):
            name = max(free, key=[*context.values].index)  # the last of them, on which no other depends
            wanted = context.values[name].fraction - (item.place - top)
            context.wanted[name] = min(wanted, context.wanted.get(name, wanted))


def _is_kept(context: Quantization, name: str) -> bool:
    """Return whether a quantity keeps its format: its products are shifted where others lie at another place."""
    return name in context.plan.forced or (context.high is not None and name in context.high.kept)


def _is_rounded(value: Value) -> bool:
    """Return whether a value is an inexact sum, which may be coarser."""
    return isinstance(value.definition, IntegerSum) and bool(value.error)


def _multiple(context: Quantization, monomial: Monomial, coefficient: Fraction, top: int) -> Placed:
    """Return a multiple of a value as a term at a place, or with the longest coefficient where that is above it."""
    value = context.values[word_of(context, monomial[0])]
    bits = min(top - value.fraction, longest(coefficient, context.word))
    factor = nearest(coefficient * Fraction(2) ** bits)
    if not factor:
        return _product_term(context, monomial, coefficient)
    return _product_term(context, monomial, coefficient, (factor, bits))


def _part(context: Quantization, high: HighWords, quantity: Quantity, item: Placed, fraction: int) -> Placed:
    """Return a term as one narrowed by itself, which is added to the high word or to others in words."""
    name = next(
        name
        for number in itertools.count(1)
        if (name := f"{quantity.name}_part{'' if number == 1 else f'_{number}'}") not in context.values
        and name not in context.quantities.items
    )
    sign = 1 if item.term.factor > 0 or item.term.coefficient is not None else -1
    term = replace(item.term, factor=sign * item.term.factor)
    part = Quantity(name, quantity.definition, Fraction(0), _range_of(context, term, item.place))
    down = high.alone or name in high.down
    halves = context.settings.multiply == "half" and _is_multiplied(term)
    value = _round(context, part, [replace(item, term=term)], fraction, down=down, halves=halves)
    context.add(value)
    return Placed(Term((name,), sign), fraction, value.error)


def _range_of(context: Quantization, term: Term, place: int) -> Interval:
    """Return the range of a multiple of one or two values, of which integers have so many fraction bits."""
    items, inside = context.quantities.items, Interval.of(1)
    for name in term.names:
        value = context.values[name]
        whole = Interval.symmetric(binary(value.magnitude, value.fraction))
        inside = inside * (items[name].range if name in items else whole)
    if len({*term.names}) < len(term.names):
        inside = Interval(max(0, inside.low), inside.high)
    places = sum(context.values[name].fraction for name in term.names) - place
    return inside.scale(term.factor * Fraction(2) ** places)


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
        value = _round(context, quantity, terms, fraction)
        while value.magnitude > context.largest(value.fraction):
            value = _round(context, quantity, terms, value.fraction - 1)
        context.add(value)
    return rounded


# Terms


def _counts_alone(context: Quantization, terms: Sequence[Placed]) -> bool:
    """Return whether a sum is one of a gyro's counts; it fills its word, so that its products need fewer shifts."""
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
    return _constant_at(constant, place)


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


def _wide(
    context: Quantization,
    quantity: Quantity,
    terms: Sequence[Placed],
    followed: Fraction,
    top: int | None = None,
) -> Value:
    """Return a sum at full precision or at a place, which is only added, compared, or the argument of a root."""
    fraction = max((item.place for item in terms), default=context.word - 1) if top is None else top
    while True:
        total = aligned(terms, fraction, context.word, context.values)
        if total.fits(context.word, context.values):
            break
        fraction -= 1
    definition = IntegerSum(total.terms)
    return integer_value(context, quantity, definition, fraction, total.error, total.peak, True, followed)


def _round(
    context: Quantization,
    quantity: Quantity,
    terms: Sequence[Placed],
    fraction: int,
    followed: Fraction = Fraction(0),
    top: int | None = None,
    down: bool = False,
    halves: bool = False,
) -> Value:
    """Return a sum as a word of so many fraction bits.

    `top` is the place at which what is rounded is added up, by default the finest; `down` rounds it down; `halves` is
    for one product, whose high word comes from half words.
    """
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
    fine = _fine(context, quantity.name, fine_terms, fraction, top, down)
    rounded_peak = (fine.peak >> fine.shift) + 1
    if not coarse.fits(word, values, rounded_peak) or fine.peak > largest_wide(word):
        raise context.too_short(quantity.name)
    feedback = fine.feedback
    drop = max(0, fraction + fine.shift - feedback.fraction) if feedback is not None else 0
    # With error feedback, the result is off by what was left before and what is left now.
    roundings = 2 if feedback is not None else 1
    rounding_error = Fraction(1) if down else context.rounding_error
    if halves:
        rounding_error = Fraction(LOST["half"])
    error = fine.error + coarse.error + roundings * rounding_error / Fraction(2) ** fraction
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
            down=down,
            halves=halves,
        ),
        fraction,
        error,
        max(fine.peak, coarse.peak + rounded_peak),
        followed=followed,
    )
    if feedback is not None:  # whatever integer a caller hands over as a residual
        value = replace(value, low=value.low - 1, high=value.high + 1)
    return value


def _fine(
    context: Quantization,
    name: str,
    terms: Sequence[Placed],
    fraction: int,
    top: int | None = None,
    down: bool = False,
) -> _FineTerms:
    """Return the terms that are rounded at the finest place at which they have room, or from `top` on."""
    word, values = context.word, context.values
    rounds_to_nearest = context.settings.rounding == "nearest" and not down
    first = max(item.place for item in terms)
    feedback_name = context.feedback_names.get(name)
    for place in range(first if top is None else max(min(first, top), fraction + 1), fraction, -1):
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


def _limit(context: Quantization, quantity: Quantity, value: Value) -> Value:
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
    """Return whether a quantity is an element of an output that is an attitude."""
    results = context.quantities.results
    return any(r.signal.constraint and name in results[r.signal.name] for r in context.program.outputs)


def _is_stated(context: Quantization, name: str) -> bool:
    """Return whether the user states the format of a quantity, or of an output or the transition that it belongs to."""
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
