"""Names the likely cause of a wrong coning correction from the coefficients that a function is seen to have."""

from __future__ import annotations

from collections.abc import Iterator

from strapgen.catalogue.methods.coning_coefficients import FORMS, Design, design
from strapgen.experiments.foreign.probes import Products

ABSENT = "correction absent or zero"
WRONG_SIGN = "correction of the wrong sign"
LATE = "correction one sample late"
FACTOR_TWO = "correction off by a factor of 2"
STATE_KEPT = "state kept between runs"

#: Departure of a coefficient that the probes do not tell from none.
_ALIKE = 0.003
#: The same for a ratio of corrections.
_RATIO_ALIKE = 0.05
#: Most samples from before a call that a published correction takes.
_MOST_PREVIOUS = 3

Table = dict[tuple[int, int], float]


def standard_design(products: Products) -> Design:
    """Return the published correction that a function is measured by.

    It has the samples of a call, and from before the call as many as the function is seen to use rightly, but for one
    sample a call at least one, without which nothing can be corrected. A function that turns by every sample on its own
    with the correction of one sample is measured by that.

    Parameters
    ----------
    products : Products
        The coefficients of the function.

    Returns
    -------
    Design
    """
    samples = products.samples
    least = 1 if samples == 1 else 0
    if not corrects_coning(products):
        return design(samples, least)
    ideal, base = _one_by_one(samples)
    if _alike(_less(products.at_once, base), ideal):
        return design(1, 1)
    used = [-older for (older, _), c in products.at_once.items() if older < 0 and abs(c) > _ALIKE]
    return design(samples, max([least, *used]))


def corrects_coning(products: Products) -> bool:
    """Return whether the coefficients annul the drift on coning to leading order."""
    return abs(_moment(products.finally_) / _needed(products.samples) - 1) < _ALIKE + _tolerance(
        products.samples
    )


def comes_late(products: Products) -> bool:
    """Return whether a call adds no correction, and a later one does."""
    for base in _bases(products.at_once, products.samples):
        if not _any(_less(products.at_once, base)):
            return _any(_less(products.finally_, base))
    return False


def cause(products: Products) -> str | None:
    """Return the likely cause of coefficients that do not correct coning.

    Parameters
    ----------
    products : Products

    Returns
    -------
    str or None
        None if they correct it.

    Examples
    --------
    One sample a call and one from before it: 1/12 is right.

    >>> tables = [{(-3, 0): 0.0, (-2, 0): 0.0, (-1, 0): c} for c in (1 / 12, 0.0, -1 / 12, 1 / 6)]
    >>> [cause(Products(1, table, table)) for table in tables]
    [None, 'correction absent or zero', 'correction of the wrong sign', 'correction off by a factor of 2']
    """
    if any(abs(weight - 1) > _RATIO_ALIKE for weight in products.weights):
        weights = ", ".join(f"{weight:.3g}" for weight in products.weights)
        return f"samples weighted by {weights} in place of 1"
    if comes_late(products):
        return LATE
    now, samples, right = products.at_once, products.samples, corrects_coning(products)
    if not right and not all(_any(_less(now, base)) for base in _bases(now, samples)):
        return ABSENT
    for ideal, base in _ideals(samples):
        correction = _less(now, base)
        for factor, said in ((-1.0, WRONG_SIGN), (2.0, FACTOR_TWO), (0.5, FACTOR_TWO)):
            if _alike(correction, {pair: factor * c for pair, c in ideal.items()}):
                return said
        if any(_alike(correction, shifted) for shifted in _delayed(ideal, samples)):
            return LATE
    return None if right else _by_size(products.finally_, samples)


def _by_size(table: Table, samples: int) -> str:
    """Return the cause by the size of the whole correction, for coefficients that are no multiple of known ones."""
    ratios = []
    for base in _bases(table, samples):
        correction = _less(table, base)
        ratios.append(_moment(correction) / (_needed(samples) - _moment(base)))
    for said, sizes in ((WRONG_SIGN, (-1.0,)), (FACTOR_TWO, (2.0, 0.5)), (ABSENT, (0.0,))):
        if any(abs(ratio - size) < _RATIO_ALIKE for ratio in ratios for size in sizes):
            return said
    return f"correction {ratios[0]:.3g} times as large as needed"


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
    for previous in range(_MOST_PREVIOUS):
        for form in FORMS:
            coefficients = design(samples, previous, form).pairs
            table = {
                (older - previous, newer - previous): float(c)
                for (older, newer), c in coefficients.items()
                if newer >= previous
            }
            if any(table.values()):
                yield table, {}
    if samples > 1:
        yield _one_by_one(samples)


def _one_by_one(samples: int) -> tuple[Table, Table]:
    """Return the right correction of a function that turns by each sample on its own, and what it is added to."""
    coefficient = float(design(1, 1).pairs[0, 1])
    turned = {(older, newer): 0.5 for newer in range(samples) for older in range(newer)}
    return {(newer - 1, newer): coefficient for newer in range(samples)}, turned


def _delayed(ideal: Table, samples: int) -> Iterator[Table]:
    """Yield corrections with one sample of delay: of the older factor, of both, and of a whole call."""
    yield {(older - 1, newer): c for (older, newer), c in ideal.items()}
    both = {(older - 1, newer - 1): c for (older, newer), c in ideal.items()}
    yield {pair: c for pair, c in both.items() if pair[1] >= 0}
    yield {(older - samples, newer): c for (older, newer), c in ideal.items()}


def _any(table: Table) -> bool:
    return any(abs(c) > _ALIKE for c in table.values())


def _less(table: Table, base: Table) -> Table:
    return {pair: c - base.get(pair, 0.0) for pair, c in table.items()}


def _alike(table: Table, other: Table) -> bool:
    return _any(other) and all(abs(c - other.get(pair, 0.0)) < _ALIKE for pair, c in table.items())


def _moment(table: Table) -> float:
    """Return the sum of coefficients times distances, which sets the drift on coning to leading order."""
    return sum(c * (newer - older) for (older, newer), c in table.items())


def _needed(samples: int) -> float:
    """Return the moment of a correction that annuls the drift to leading order, that of a published one."""
    pairs = design(samples, 1 if samples == 1 else 0).pairs
    return float(sum(c * (newer - older) for (older, newer), c in pairs.items()))


def _tolerance(samples: int) -> float:
    """Return the error of a ratio of moments that the probes may make."""
    return _ALIKE / 2 / _needed(samples)
