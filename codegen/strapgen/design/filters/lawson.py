"""Filters of the least largest error over a band whose errors are complex: with a gyro, or with unlike sides.

Lawson's iteration changes the weights of least squares by the errors that these leave. It converges slowly; in the
digits of `band_grid` it is the same on every machine.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from strapgen.design.filters.band_grid import BITS, ONE, integer, magnitude, mean_grid
from strapgen.design.filters.mean_square import least_squares
from strapgen.design.filters.unknowns import Shape

#: Rounds of the iteration, and the least weight of a frequency, of weights that sum to 1.
ROUNDS = 60
_LEAST_WEIGHT = ONE // 10**12


def design(shape: Shape, degrees: Sequence[int], band: Fraction) -> list[list[Any]]:
    """Return filters with the least largest errors over a band, of those that the iteration passes.

    `band`: highest angular frequency in rad a sample; the errors are those at `band_grid.mean_points`.

    >>> taps, = design(Shape(1, 1, 3), [1], Fraction(1))
    >>> [round(float(tap), 12) for tap in taps]
    [-0.25, 0.0, 0.25]
    """
    return [_filter(shape, m, band) for m in degrees]


def _filter(shape: Shape, m: int, band: Fraction) -> list[Any]:
    grid = mean_grid(band, shape.samples - 1, shape.gyro, shape.increments)
    weights = [ONE // len(grid.points)] * len(grid.points)
    best: tuple[int, list[Any]] | None = None
    for _ in range(ROUNDS):
        (taps,) = least_squares(grid, shape, [m], weights)
        errors = [magnitude(*e) for e in grid.errors(m, list(map(integer, taps)), shape.previous)]
        if best is None or max(errors) < best[0]:
            best = max(errors), taps
        products = [w * e >> BITS for w, e in zip(weights, errors, strict=True)]
        total = sum(products)
        if not total:
            break
        weights = [(value << BITS) // total + _LEAST_WEIGHT for value in products]
    assert best is not None
    return best[1]
