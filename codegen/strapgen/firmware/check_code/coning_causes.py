"""Names the likely cause of a wrong coning correction from the measured coefficients of a function."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from strapgen.catalogue.methods.coning_coefficients import FORMS, Design, design
from strapgen.firmware.check_code.probes import LATE as _LATER_CALLS
from strapgen.firmware.check_code.probes import MOST_PREVIOUS, Products, Table

ABSENT = "correction absent or zero"
WRONG_SIGN = "correction of the wrong sign"
LATE = "correction one sample late"
FACTOR_TWO = "correction off by a factor of 2"
SUM_LATE = "the sum of the samples before lacks the last one (one sample late)"
REVERSED = "the samples of a call are taken in reverse order"
EARLIER_REVERSED = "the samples from before a call are taken in reverse order, the newest first"
STAYS = "the correction of a call is not reset: later calls apply it again"
STATE_KEPT = "state kept between runs"
#: What stands beside causes where the coefficients have none.
RIGHT = "no fault of the coefficients"

#: Most coefficients that a line shows; those come first that differ most from what is wanted.
_MOST_SHOWN = 4
#: Smallest coefficient that counts as one.
LEAST = 0.001
#: Largest departure from a known pattern of coefficients, by the largest of these.
_CLOSE = 0.01
#: Alignment of coefficients that are a multiple of others, and how much better than another one it has to be.
_MULTIPLE, _AS_GOOD = 0.999, 1e-6
#: Largest denominator of a coefficient as a fraction.
_DENOMINATOR = 10**6
#: Largest departure of a ratio of corrections from 1 that is no fault in itself.
_RATIO_WITHIN = 0.005
#: The same for weights of samples.
_WEIGHT_WITHIN = 0.01


@dataclass(frozen=True)
class MeasuredCoefficient:
    """The coefficient of the cross product of two samples, older times newer."""

    #: Samples of a call have the numbers from 0, those before it are negative
    older: int
    newer: int
    #: That of the function, and that of the published correction whose pattern is nearest
    seen: float
    wanted: float


def measured(products: Products) -> tuple[MeasuredCoefficient, ...]:
    """Return the coefficients that are seen or wanted."""
    return tuple(
        MeasuredCoefficient(older, newer, products.at_once[older, newer], value)
        for (older, newer), value in wanted(products).items()
        if value or abs(products.at_once[older, newer]) > LEAST
    )


def in_words(products: Products, what: str = "coning") -> str:
    """Return the coefficients of a correction in words, and how much of it they are."""
    coefficients, newer = measured(products), "d" if what == "coning" else "v"
    by_difference = sorted(coefficients, key=lambda each: -abs(each.seen - each.wanted))
    parts = [
        f"d{each.older} x {newer}{each.newer} {each.seen:.4g} ({each.wanted:.4g})"
        for each in by_difference[:_MOST_SHOWN]
    ]
    rest = f" and {len(by_difference) - _MOST_SHOWN} more" if len(by_difference) > _MOST_SHOWN else ""
    later = "with what later calls add " if _any(_less(products.finally_, products.at_once)) else ""
    return f"seen (wanted): {', '.join(parts)}{rest}; {later}{ratio(products):.3f} of what {what} needs"


def standard_design(products: Products) -> Design:
    """Return the published correction with which a function is compared.

    It has the samples of a call, and from before the call as many as the function is seen to use rightly, but for one
    sample a call at least one, without which nothing can be corrected. A function that turns by every sample on its own
    with the correction of one sample is measured by that.
    """
    samples = products.samples
    if not corrects_coning(products):
        return plain_design(samples)
    ideal, base = _one_by_one(samples)
    if _alike(_less(products.at_once, base), ideal, products.noise):
        return design(1, 1)
    used = [-older for (older, _), c in products.at_once.items() if older < 0 and abs(c) > LEAST]
    return design(samples, min(MOST_PREVIOUS, max([plain_design(samples).previous, *used])))


def plain_design(samples: int) -> Design:
    """Return the published correction on the samples of a call, for one sample that with one from before it."""
    return design(samples, 1 if samples == 1 else 0)


def measured_design(products: Products) -> Design:
    """Return the measured correction of a function as a design on the probed samples."""
    previous = -min(older for older, _ in products.finally_)
    table = {
        (older + previous, newer + previous): Fraction(c).limit_denominator(_DENOMINATOR)
        for (older, newer), c in products.finally_.items()
    }
    return Design("seen", products.samples, previous, table)


def wanted(products: Products) -> Table:
    """Return the coefficients of the published correction whose pattern is nearest to that of a function."""
    return nearest(products)[0]


def nearest(products: Products) -> tuple[Table, Design]:
    """Return the published correction whose pattern is nearest to that of a function: coefficients, and design."""
    pairs, seen = list(products.at_once), products.at_once
    known = [*_published(products.samples)]
    tables = [{pair: ideal.get(pair, 0.0) for pair in pairs} for ideal, _, _ in known]
    totals = [_plus(table, base) for table, (_, base, _) in zip(tables, known, strict=True)]
    number = min(range(len(known)), key=lambda number: _size(_less(seen, totals[number])))
    most = _MULTIPLE
    for k, (table, (_, base, _)) in enumerate(zip(tables, known, strict=True)):
        alike = _alignment(_less(seen, base), table)
        if alike > most:
            most, number = alike + _AS_GOOD, k
    return {pair: totals[number].get(pair, 0.0) for pair in pairs}, known[number][2]


def ratio(products: Products) -> float:
    """Return the coefficients by what annuls the drift on coning to leading order, 1 where they are right."""
    return _moment(products.finally_) / _needed(products.samples)


def tolerance(products: Products) -> float:
    """Return the largest departure of `ratio` from 1 that is no fault, rounding included."""
    distances = sum(newer - older for older, newer in products.finally_)
    return _RATIO_WITHIN + products.noise * distances / _needed(products.samples)


def corrects_coning(products: Products) -> bool:
    """Return whether the coefficients annul the drift on coning to leading order, about every axis."""
    needed = _needed(products.samples)
    tables = (products.finally_, *products.by_axis)
    return all(abs(_moment(table) / needed - 1) < tolerance(products) for table in tables)


def comes_late(products: Products) -> bool:
    """Return whether a call adds no correction, and a later one does."""
    for base in _bases(products.at_once, products.samples):
        if not _any(_less(products.at_once, base)):
            return _any(_less(products.finally_, base))
    return False


def stays(products: Products) -> bool:
    """Return whether every later call adds the correction of a call again."""
    later = _less(products.finally_, products.at_once)
    corrections = [_less(products.at_once, base) for base in _bases(products.at_once, products.samples)]
    again = [{pair: _LATER_CALLS * c for pair, c in each.items()} for each in corrections]
    return any(_alike(later, each, products.noise) for each in again)


def weights_off(products: Products) -> bool:
    """Return whether the attitude turns by more or less of a sample than it is."""
    return any(abs(weight - 1) > _WEIGHT_WITHIN for weight in products.weights)


def cause(products: Products) -> str | None:
    """Return the likely cause of coefficients that do not correct coning.

    A cause is named where all coefficients are those of the fault; other ones are told by their size.

    One sample a call and one from before it: 1/12 is right.

    >>> tables = [{(-3, 0): 0.0, (-2, 0): 0.0, (-1, 0): c} for c in (1 / 12, 0.0, -1 / 12, 1 / 6)]
    >>> [cause(Products(1, table, table)) for table in tables]
    [None, 'correction absent or zero', 'correction of the wrong sign', 'correction off by a factor of 2']
    """
    if weights_off(products):
        weights = ", ".join(f"{weight:.3g}" for weight in products.weights)
        return f"samples weighted by {weights} in place of 1"
    if (uneven := _uneven(products)) is not None:
        return uneven
    if comes_late(products):
        return LATE
    if stays(products):
        return STAYS
    for said, base, table in _faults(products):
        if _fits(products, base, table):
            return said
    return None if corrects_coning(products) else _by_size(products)


def one_sided(sides: tuple[Table, Table], noise: float, samples: int) -> str | None:
    """Return the cause where the products of one side alone are wrong: d_i x v_j, or v_i x d_j, i the older sample."""
    for ideal, base in _ideals(samples):
        right = [_alike(_less(side, base), ideal, noise) for side in sides]
        if right.count(True) == 1:
            wrong, visible = _beside(ideal, sides[right.index(False)], base)
            names = ("d_i x v_j", "v_i x d_j") if right[1] else ("v_i x d_j", "d_i x v_j")
            size = f"{_moment(wrong) / _moment(visible):.3g} times as large as needed"
            said = (
                "absent" if not _any(wrong) else size if _alignment(wrong, visible) > _MULTIPLE else "wrong"
            )
            return f"of an older sample i and a newer j {names[0]} is {said}, {names[1]} right"
    return None


def _faults(products: Products) -> Iterator[tuple[str, Table, Table]]:
    """Yield the known faults: in words, the products that a correction is added to, and that correction."""
    now, samples, noise = products.at_once, products.samples, products.noise
    ideals, right = [*_ideals(samples)], corrects_coning(products)
    for base in [] if right else _bases(now, samples):
        yield ABSENT, base, {}
    for ideal, base in ideals:
        for factor, said in ((-1.0, WRONG_SIGN), (2.0, FACTOR_TWO), (0.5, FACTOR_TWO)):
            yield said, base, {pair: factor * c for pair, c in ideal.items()}
        for shifted in _delayed(ideal, samples):
            yield LATE, base, shifted
    # Else those from before a call are too small to tell.
    if not right and not any(_alike(_less(now, base), ideal, noise) for ideal, base in ideals):
        for ideal, base in ideals:
            for turned in _earlier_reversed(ideal):
                yield EARLIER_REVERSED, base, turned
    if samples > 1:
        ideal, turned = _one_by_one(samples)
        yield SUM_LATE, {pair: c for pair, c in turned.items() if pair[1] - pair[0] > 1}, ideal
        if not right:
            yield f"{REVERSED}; {ABSENT}", {}, _reversed(turned, samples, now)
            for each in ideals:
                yield REVERSED, {}, _reversed(_plus(*each), samples, now)


def _fits(products: Products, base: Table, table: Table) -> bool:
    """Return whether the coefficients are those of a correction beside the products that it is added to."""
    correction = _less(products.at_once, base)
    return _alike(correction, table, products.noise) if table else not _any(correction)


def confidence(products: Products, said: str) -> tuple[float, str] | None:
    """Return how sure a cause is, from 0 to 1, and what explains the coefficients next best.

    It is 1 less the ratio of what the cause leaves of the coefficients to what the next best one leaves. None if the
    cause is not one of these.

    >>> table = {(-3, 0): 0.0, (-2, 0): 0.0, (-1, 0): -0.09}
    >>> value, other = confidence(Products(1, table, table), WRONG_SIGN)
    >>> round(value, 3), other
    (0.926, 'correction absent or zero')
    """
    if weights_off(products) or _uneven(products) is not None or comes_late(products) or stays(products):
        return None
    left: dict[str, float] = {}
    ideals = [(RIGHT, base, ideal) for ideal, base in _ideals(products.samples)]
    for words, base, table in [*_faults(products), *ideals]:
        if words != ABSENT and not _any(table):
            continue  # nothing of it can be seen
        rest = _size(_plus(products.at_once, {pair: -c for pair, c in _plus(base, table).items()}))
        left[words] = min(left.get(words, math.inf), rest)
    if said == _by_size(products):
        left[said] = min(_scaled_rest(products, base, ideal) for _, base, ideal in ideals)
    if said not in left:
        return None
    best = max(left.pop(said), products.noise)
    other = min(left, key=lambda words: left[words])
    return max(0.0, 1.0 - best / left[other]) if left[other] else 0.0, other


def sureness(products: Products, said: str) -> dict[str, float | str]:
    """Return the confidence as a result has it; nothing where there is none."""
    known = confidence(products, said)
    return {"cause_confidence": known[0], "next_cause": known[1]} if known else {}


def _beside(ideal: Table, table: Table, base: Table) -> tuple[Table, Table]:
    """Return the correction that a table is beside a base, and what can be seen there of an ideal one."""
    correction = _less(table, base)
    return correction, {pair: ideal.get(pair, 0.0) for pair in correction}


def _scaled_rest(products: Products, base: Table, ideal: Table) -> float:
    """Return what the multiple of a correction leaves that fits best."""
    correction, visible = _beside(ideal, products.at_once, base)
    size = _size(visible) ** 2
    factor = sum(c * visible[pair] for pair, c in correction.items()) / size if size else 0.0
    return _size({pair: c - factor * visible[pair] for pair, c in correction.items()})


def _by_size(products: Products) -> str:
    """Return the cause in words for a multiple of a known correction, or for no correction."""
    for ideal, base in _ideals(products.samples):
        correction, visible = _beside(ideal, products.finally_, base)
        if _alignment(correction, visible) > _MULTIPLE:
            size = _moment(correction) / _moment(visible)
            return f"correction {size:.3g} times as large as needed"
    return f"coefficients of no single fault that is known, {ratio(products):.3g} of what coning needs"


def _uneven(products: Products) -> str | None:
    """Return the size of the correction about each axis; None where they are alike."""
    mean = products.finally_
    allowed = LEAST + products.noise
    if all(abs(table[pair] - mean[pair]) < allowed for table in products.by_axis for pair in mean):
        return None
    sizes = ", ".join(f"{_moment(table) / _needed(products.samples):.3g}" for table in products.by_axis)
    return f"the corrections about x, y, z differ: {sizes} of what is needed"


def _bases(now: Table, samples: int) -> list[Table]:
    """Return the products of a call without correction: samples added up, or each of them turned on its own.

    The likelier one comes first: with a memory of samples before the call, each sample is turned on its own.
    """
    added: Table = {}
    turned = {pair: 0.5 for pair in now if pair[0] >= 0}
    remembers = _any({pair: c for pair, c in now.items() if pair[0] < 0})
    bases = [turned, added] if remembers else [added, turned]
    return bases[:1] if samples == 1 else bases


def _ideals(samples: int) -> Iterator[tuple[Table, Table]]:
    """Yield corrections that are right, by their coefficients, each with the products that it is added to."""
    yield from ((ideal, base) for ideal, base, _ in _published(samples))


def _published(samples: int) -> Iterator[tuple[Table, Table, Design]]:
    """Yield the same with their designs."""
    for previous in range(MOST_PREVIOUS + 1):
        for form in FORMS:
            one = design(samples, previous, form)
            table = {
                (older - previous, newer - previous): float(c)
                for (older, newer), c in one.pairs.items()
                if newer >= previous
            }
            if any(table.values()):
                yield table, {}, one
    if samples > 1:
        yield *_one_by_one(samples), design(1, 1)


def _one_by_one(samples: int) -> tuple[Table, Table]:
    """Return the right correction of a function that rotates by each sample separately, and its base products."""
    coefficient = float(design(1, 1).pairs[0, 1])
    turned = {(older, newer): 0.5 for newer in range(samples) for older in range(newer)}
    return {(newer - 1, newer): coefficient for newer in range(samples)}, turned


def _delayed(ideal: Table, samples: int) -> Iterator[Table]:
    """Yield corrections with one sample of delay: of the older factor, of both, and of a whole call."""
    yield {(older - 1, newer): c for (older, newer), c in ideal.items()}
    both = {(older - 1, newer - 1): c for (older, newer), c in ideal.items()}
    yield {pair: c for pair, c in both.items() if pair[1] >= 0}
    yield {(older - samples, newer): c for (older, newer), c in ideal.items()}


def _reversed(table: Table, samples: int, visible: Table) -> Table:
    """Return the measured coefficients if the samples of each call are taken in reverse order.

    Of a correction that is even in this order, as that of added samples often is, it is the wrong sign.
    """
    seen: Table = {}
    for pair, c in table.items():
        older, newer = (number - number % samples + samples - 1 - number % samples for number in pair)
        place, value = ((older, newer), c) if older < newer else ((newer, older), -c)
        if place in visible:
            seen[place] = value
    return seen


def _earlier_reversed(ideal: Table) -> Iterator[Table]:
    """Yield a correction with two samples from before a call or more, from the newest to the oldest."""
    for count in range(max(2, -min(older for older, _ in ideal)), MOST_PREVIOUS + 1):
        yield {(-1 - count - older if older < 0 else older, newer): c for (older, newer), c in ideal.items()}


def _any(table: Table) -> bool:
    return any(abs(c) > LEAST for c in table.values())


def _less(table: Table, base: Table) -> Table:
    return {pair: c - base.get(pair, 0.0) for pair, c in table.items()}


def _plus(table: Table, other: Table) -> Table:
    return {pair: table.get(pair, 0.0) + other.get(pair, 0.0) for pair in {*table, *other}}


def _alike(table: Table, other: Table, noise: float) -> bool:
    """Return whether a table is a known one, of which it has every pair."""
    allowed = _CLOSE * max(map(abs, other.values()), default=0.0) + noise
    pairs = {*table, *(pair for pair, c in other.items() if c)}
    return _any(other) and all(abs(table.get(pair, 0.0) - other.get(pair, 0.0)) < allowed for pair in pairs)


def _alignment(table: Table, other: Table) -> float:
    """Return how far a table is a multiple of another one with the same pairs: 1 if it is, of either sign."""
    size = _size(table) * _size(other)
    return abs(sum(c * other[pair] for pair, c in table.items())) / size if size else 0.0


def _size(table: Table) -> float:
    return math.hypot(*table.values())


def _moment(table: Table) -> float:
    """Return the sum of coefficients times distances, which sets the drift on coning to leading order."""
    return sum(c * (newer - older) for (older, newer), c in table.items())


def _needed(samples: int) -> float:
    """Return the moment of a correction that annuls the drift to leading order, that of a published one."""
    pairs = plain_design(samples).pairs
    return float(sum(c * (newer - older) for (older, newer), c in pairs.items()))
