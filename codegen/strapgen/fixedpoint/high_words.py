"""Chooses formats with which sums of products are narrowed by taking their high words.

Processors multiply words into wide numbers of two registers and accumulate there; the high word of such a sum is a
register. Any other shift of it, and every rounding to the nearest, takes further instructions, so that they stay where
the error needs them: this starts from the coarsest formats and refines those with the largest part in the error for
what they cost.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from strapgen.fixedpoint.integer_sums import HighWords, Quantization
from strapgen.fixedpoint.quantities import (
    InputElement,
    Quantities,
    Quantity,
    Sum,
    Terms,
    combined,
    is_power_of_two,
    used_by,
)
from strapgen.fixedpoint.ranges import Ranges
from strapgen.ir.formats import finest
from strapgen.ir.integer_program import IntegerOperation, IntegerSum, Value
from strapgen.ir.integer_program import used_by as used_by_value

#: Most choices that are tried, and most walks for the places of the products of one.
_MOST_CHOICES, _MOST_WALKS = 12, 6
#: Excess of a result's error, in parts of its limit, above which several refinements are made at once.
_FAR = 0.25
#: Registers that common processors have for words.
_REGISTERS = 11
#: Values that are refined together, and whether they are kept so.
Step = tuple[frozenset[str], bool]
#: A walk of the quantities with the most fraction bits of values, and its choices.
Walk = Callable[[Quantities, Mapping[str, int], HighWords], Quantization]


def with_exact_parts_apart(quantities: Quantities, words: Container[str]) -> Quantities:
    """Return quantities where a sum that no word is needed of leaves its exact words to those that use it.

    What is left is smaller, so that there is room for finer products beside it.
    """
    items = dict(quantities.items)
    results = {name for names in quantities.results.values() for name in names if isinstance(name, str)}
    for name, quantity in quantities.items.items():
        definition, rest_name = items[name].definition, f"{name}_rest"
        if name in words or name in results or quantity.range_checked or not isinstance(definition, Sum):
            continue
        apart: Terms = {
            m: c
            for m, c in definition.terms
            if len(m) == 1 and is_power_of_two(c) and _is_linear(items, m[0])
        }
        rest = tuple((m, c) for m, c in definition.terms if m not in apart)
        users = [one for one in items.values() if name in used_by(one)]
        if not apart or not any(m for m, _ in rest) or not all(_adds(one, name) for one in users):
            continue
        meaning = quantity.meaning and f"{quantity.meaning}, without what is linear"
        inside = Ranges(items, {}).enclosure(rest)
        other = replace(quantity, name=rest_name, definition=Sum(rest), range=inside, meaning=meaning)
        for user in users:
            assert isinstance(user.definition, Sum)
            terms = dict(user.definition.terms)
            factor = terms.pop((name,))
            more = combined({**terms, (rest_name,): factor}, apart, factor)
            items[user.name] = replace(user, definition=Sum(tuple(more.items())))
        items = {one.name: one for one in (other if one.name == name else one for one in items.values())}
    return Quantities(items, dict(quantities.results))


def _adds(quantity: Quantity, name: str) -> bool:
    """Return whether a quantity is a sum with a shifted value among its terms, and has no other use of it."""
    if not isinstance(quantity.definition, Sum) or quantity.inherited_error is not None:
        return False
    terms = [(m, c) for m, c in quantity.definition.terms if name in m]
    return [m for m, _ in terms] == [(name,)] and is_power_of_two(terms[0][1])


def _is_linear(items: Mapping[str, Quantity], name: str) -> bool:
    """Return whether a quantity is an input, or a sum of some."""
    definition = items[name].definition
    if isinstance(definition, Sum):
        return all(len(m) == 1 and _is_linear(items, m[0]) for m, _ in definition.terms)
    return isinstance(definition, InputElement)


def high_words(
    walk: Walk, quantities: Quantities, limits: Mapping[str, Fraction], biases: Mapping[str, Fraction]
) -> Quantization | None:
    """Return the walk with the fewest instructions of which every result has an error within its limit; None if none.

    `limits` are by the name of the result's element, as `biases` are: what values that are rounded down may add to it.
    Formats depend on which values are fine alone, so that these are chosen first, with every sum rounded to the
    nearest.
    """
    context = _at_one_place(walk, quantities, HighWords())
    if not all(limits.values()) or not any(_may_change(context, value) for value in context.body):
        return None
    context, taken = _refined(walk, context, limits)
    if _excess(context, limits):
        return None
    for step in list(taken):  # what was refined early may do without, after others were
        fewer = [one for one in taken if one != step]
        other = _at_one_place(walk, quantities, _with(HighWords(), fewer))
        if not _excess(other, limits):
            context, taken = other, fewer
    # A value that is rounded down is half a unit too low on average, in every call.
    room = {name: context.values[name].error + biases[name] for name in limits}
    return _rounded_down(walk, context, {name: min(limit, room[name]) for name, limit in limits.items()})


def high_products(walk: Walk, quantities: Quantities, limits: Mapping[str, Fraction]) -> Quantization:
    """Return the walk in which every product is narrowed to its high word alone.

    Values are refined until every result has an error within its limit, or as far as that goes.
    """
    context = _at_one_place(walk, quantities, HighWords(alone=True))
    return _refined(walk, context, {name: limit for name, limit in limits.items() if limit})[0]


def _refined(
    walk: Walk, context: Quantization, limits: Mapping[str, Fraction]
) -> tuple[Quantization, list[Step]]:
    """Return a walk with values refined until its results are within their limits, and what was refined."""
    assert context.high is not None
    refused: set[frozenset[str]] = set()
    taken: list[Step] = []
    for _ in range(_MOST_CHOICES):
        excess = _excess(context, limits)
        steps = _steps(context, limits, excess, refused) if excess else []
        if not steps:
            break
        other = _at_one_place(walk, context.quantities, _with(context.high, steps))
        if sum(_excess(other, limits).values()) < sum(excess.values()):
            context, taken = other, taken + steps
        else:  # it brings the products of other sums to a coarser place
            refused.add(steps[0][0])
    return context, taken


def _with(high: HighWords | None, steps: Iterable[Step]) -> HighWords:
    """Return choices with some values more that are fine, or kept where that is stated."""
    assert high is not None
    for names, kept in steps:
        fine = (
            high.fine if high.alone else high.fine | names
        )  # the places of high words alone are those of factors
        high = replace(high, fine=fine, kept=high.kept | names if kept else high.kept)
    return high


def _excess(context: Quantization, limits: Mapping[str, Fraction]) -> dict[str, float]:
    """Return by what part of its limit the error of a result lies above it, where it does."""
    errors = {name: context.values[name].error for name in limits}
    return {name: float(errors[name] / limit) - 1 for name, limit in limits.items() if errors[name] > limit}


def _at_one_place(walk: Walk, quantities: Quantities, high: HighWords) -> Quantization:
    """Return a walk where the products of a sum lie at one place as far as coarser factors can bring them there."""
    most: dict[str, int] = {}
    for _ in range(_MOST_WALKS):
        context = walk(quantities, most, high)
        new = {name: bits for name, bits in context.wanted.items() if bits < most.get(name, bits + 1)}
        if not new:
            break
        most |= new
    return context


def _rounded_down(walk: Walk, context: Quantization, limits: Mapping[str, Fraction]) -> Quantization:
    """Return a walk of the same formats where as many values are rounded down as the limits allow."""
    assert context.high is not None
    shares = _shares(context, {name: float(limit) for name, limit in limits.items()})
    room = {name: 1 - float(context.values[name].error / limit) for name, limit in limits.items()}
    more = {
        value.name: {one: share * 2.0 ** (-value.fraction - 1) for one, share in shares[value.name].items()}
        for value in context.body
        if value.name in shares and _may_change(context, value)
    }
    down: list[str] = []
    for name in sorted(more, key=lambda one: max(more[one].values())):
        if all(part <= room[one] for one, part in more[name].items()):
            down.append(name)
            room = {one: part - more[name].get(one, 0.0) for one, part in room.items()}
    while down:
        other = walk(context.quantities, context.most, replace(context.high, down=frozenset(down)))
        if not _excess(other, limits):
            return other
        down = down[: len(down) // 2]  # the room is an estimate
    return context


def _steps(
    context: Quantization,
    limits: Mapping[str, Fraction],
    excess: Mapping[str, float],
    refused: Container[frozenset[str]],
) -> list[Step]:
    """Return values to make as fine as words allow, and whether to keep them so; far from the limits several.

    Values of one format and of the same use, as the elements of a vector, are refined together. What is kept has its
    products shifted, which costs more: it comes last.
    """
    shares = _shares(context, {name: float(limits[name]) for name in excess})
    assert context.high is not None
    for kept in (True,) if context.high.alone else (False, True):
        alike: dict[tuple[int, int, str], dict[str, float]] = {}
        for value in context.body:
            bits = _bits_to_gain(context, value, kept)
            if bits > 0 and value.name in shares:
                unit = 2.0 ** (-value.fraction - 1) * (1 - 2.0**-bits)
                taken = sum(min(excess[one], share * unit) for one, share in shares[value.name].items())
                use = f"{sum(shares[value.name].values()):.3g}"
                alike.setdefault((value.fraction, bits, use), {})[value.name] = taken
        ranked = sorted(alike.values(), key=lambda group: -sum(group.values()) / len(group))
        free = [group for group in ranked if frozenset(group) not in refused]
        left = sum(excess.values())
        goal = left / 2 if left > _FAR * len(excess) else left - 1e-12  # near the limits one step at a time
        chosen = []
        for group in free:
            if left > goal:
                chosen.append((frozenset(group), kept))
                left -= sum(group.values())
        if chosen:
            return chosen
    return []


def _bits_to_gain(context: Quantization, value: Value, kept: bool) -> int:
    """Return by how many bits a value may be finer, also where products lie at other places if it is kept so."""
    quantity, high = context.quantities.items.get(value.name), context.high
    assert high is not None
    if (
        quantity is None
        or not _may_change(context, value)
        or value.name in (high.kept if kept else high.fine)
    ):
        return 0
    natural = finest(quantity.range.magnitude, context.word)
    return (natural if kept else min(natural, context.most.get(value.name, natural))) - value.fraction


def _may_change(context: Quantization, value: Value) -> bool:
    """Return whether a value is narrowed to a high word or shifted, in a format of its own."""
    total = value.definition
    if not isinstance(total, IntegerSum) or value.name in context.plan.forced:
        return False
    if not total.shift and not (context.high and context.high.alone and value.error):
        return False
    if value.range_checked or value.name in context.feedback_names:
        return False
    items = context.quantities.items
    return value.name not in items or any(
        len(term.names) == 2 or term.coefficient is not None or any(name not in items for name in term.names)
        for term in total.fine
    )


def in_order(body: Sequence[Value], results: Sequence[str], transition: Sequence[str]) -> list[Value]:
    """Return code in the order for which registers do best: as it is, or each value where it is first used."""
    orders = [list(body), _as_used(body, results), _as_used(body, [*transition, *results])]
    return min(orders, key=_spilled)


def _as_used(body: Sequence[Value], names: Sequence[str]) -> list[Value]:
    """Return code in the order in which values are used for those of some names, and the rest after it."""
    values, ordered = {value.name: value for value in body}, dict[str, Value]()

    def place(name: str) -> None:
        if name in values and name not in ordered:
            for other in used_by_value(values[name]):
                place(other)
            ordered[name] = values[name]

    for name in (*names, *values):
        place(name)
    return [*ordered.values()]


def _spilled(body: Sequence[Value]) -> int:
    """Return the sum over all statements of the words held for later ones that processors have no register for."""
    first = {value.name: place for place, value in enumerate(body)}
    words = {value.name: 1 + value.wide for value in body}
    held = [0] * (len(body) + 1)
    for name, last in {n: place for place, value in enumerate(body) for n in used_by_value(value)}.items():
        for place in range(first.get(name, 0), last):
            held[place] += words.get(name, 1)
    return sum(max(0, count - _REGISTERS) for count in held)


def _shares(context: Quantization, limits: Mapping[str, float]) -> dict[str, dict[str, float]]:
    """Return, by value and result, by what part of its limit a result is off when the value is off by one.

    They are estimates, by which choices are ordered; the errors of a walk are certified.
    """
    shares: dict[str, dict[str, float]] = {name: {name: 1 / limit} for name, limit in limits.items()}
    for value in reversed(context.body):
        mine = shares.get(value.name)
        if mine is None:
            continue
        for name, factor in _slopes(context, value):
            theirs = shares.setdefault(name, {})
            for one, share in mine.items():
                theirs[one] = theirs.get(one, 0.0) + share * factor
    return shares


def _slopes(context: Quantization, value: Value) -> Iterator[tuple[str, float]]:
    """Yield what a value is made from, each with about the largest slope of the value in it."""
    total, values = value.definition, context.values
    if isinstance(total, IntegerSum):
        place = value.fraction + total.shift + total.drop
        for terms, bits in ((total.fine, place), (total.coarse, value.fraction)):
            for term in terms:
                scale = abs(term.factor) * 2.0 ** (term.shift - bits)
                for k, name in enumerate(term.names):
                    others = [values[one] for one in term.names[:k] + term.names[k + 1 :]]
                    yield (
                        name,
                        scale
                        * 2.0 ** values[name].fraction
                        * float(math.prod(one.magnitude for one in others)),
                    )
    elif isinstance(total, IntegerOperation):
        for scaled in total.arguments:
            if isinstance(scaled.value, str):
                yield scaled.value, 1.0
