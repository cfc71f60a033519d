"""Least weighted sum of absolute errors, exactly: from vertex to vertex, as the simplex method does.

At a vertex as many errors are zero as there are unknowns. Its multipliers tell which of them to let go, and the
weighted median along the edge which error becomes zero in its place. All of it is in the integers and digits of
`band_grid`, so that a design is the same on every machine.

Source: I. Barrodale, F. D. K. Roberts, SIAM J. Numer. Anal. 10 (1973) 839-848.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from strapgen.design.filters.band_grid import BITS, REAL
from strapgen.design.filters.exchange import Answers
from strapgen.design.filters.mean_square import solve
from strapgen.ir.exceptions import InputError

#: How far a multiplier may exceed 1 at the best vertex.
_EXCESS = REAL.mpf(2) ** -100
#: Most vertices for each point; a few for each unknown are usual.
_MOST_VERTICES = 20


def design(answers: Answers, weights: Sequence[Any]) -> list[Any]:
    """Return the unknowns of the least sum of w |error|.

    `weights` (n,): above 0.

    >>> one = 1 << BITS
    >>> [float(x) for x in design(Answers([[one] * 4], [one, 2 * one, 3 * one, 10 * one]), [2, 1, 1, 1])]
    [2.0]
    """
    count, points = len(answers.columns), len(answers.right)
    if points < count:
        raise InputError(f"{points} lines do not determine {count} coefficients")
    if not count:
        return []
    rows = [
        [REAL.ldexp(REAL.mpf(value), -BITS) for value in row] for row in zip(*answers.columns, strict=True)
    ]
    right = [REAL.ldexp(REAL.mpf(value), -BITS) for value in answers.right]
    active = [round(points * (k + 0.5) / count - 0.5) for k in range(count)]
    for _ in range(_MOST_VERTICES * points):
        square = [rows[k] for k in active]
        (free,) = solve(square, [[right[k] for k in active]])
        errors = [
            value - REAL.fdot(zip(row, free, strict=True)) for row, value in zip(rows, right, strict=True)
        ]
        for k in active:
            errors[k] = REAL.mpf(0)
        multipliers = _multipliers(rows, errors, weights, active)
        place = max(range(count), key=lambda k: abs(multipliers[k]))
        if abs(multipliers[place]) <= 1 + _EXCESS:
            return free
        unit = [REAL.mpf(0)] * count
        unit[place] = REAL.mpf(-1 if multipliers[place] > 0 else 1)
        (direction,) = solve(square, [unit])
        slope = weights[active[place]] * (1 - abs(multipliers[place]))
        active[place] = _next(rows, errors, weights, direction, slope, active)
    raise InputError("the coefficients of the least sum of drifts are not reached; fewer samples are needed")


def _multipliers(
    rows: Sequence[Sequence[Any]], errors: Sequence[Any], weights: Sequence[Any], active: Sequence[int]
) -> list[Any]:
    """Return the slopes of |error| at the active points, by their weights, that would make the vertex the best one."""
    count = len(active)
    pull = [
        -REAL.fsum(w * REAL.sign(e) * row[j] for w, e, row in zip(weights, errors, rows, strict=True))
        for j in range(count)
    ]
    transposed = [[weights[k] * rows[k][j] for k in active] for j in range(count)]
    (multipliers,) = solve(transposed, [pull])
    return multipliers


def _next(
    rows: Sequence[Sequence[Any]],
    errors: Sequence[Any],
    weights: Sequence[Any],
    direction: Sequence[Any],
    slope: Any,
    active: Sequence[int],
) -> int:
    """Return the point whose error becomes zero at the least sum along a direction, which begins with a slope."""
    crossings = []
    for k, (row, error) in enumerate(zip(rows, errors, strict=True)):
        if k in active:
            continue
        change = REAL.fdot(zip(row, direction, strict=True))
        if change and error / change > 0:
            crossings.append((error / change, k, 2 * weights[k] * abs(change)))
    for _, k, more in sorted(crossings):
        slope += more
        if slope >= 0:
            return k
    raise InputError("the lines do not determine the coefficients")
