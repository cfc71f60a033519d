"""Increments over even intervals between two instants from samples with instants of their own.

The integral from an instant to a boundary of the intervals is that of the polynomial through the cumulative sums at the
`POINTS` nearest instants, e; an increment is the sum of the samples between its ends and the difference of their e. Of
samples at instants it is the integral of the polynomial through them, by Gauss's nodes. The C++ of the template has the
same operations in the same order.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from strapgen.run.evaluators import Array

#: Instants of a polynomial: at 1 rad a sample it is off by 1e-6 of the rate half an interval from an instant.
POINTS = 16
#: Pairs of instants near the ends of a recording, where fewer are on one side: more of them would amplify noise.
FEWEST = 3
#: Nodes and weights of Gauss on an interval from 0 to 1, exact on polynomials of the seventh degree.
GAUSS = tuple(
    (0.5 + 0.5 * float(node), 0.5 * float(weight))
    for node, weight in zip(*np.polynomial.legendre.leggauss(4), strict=True)
)


class _Around(NamedTuple):
    """The same number of instants around points, one row for each."""

    places: Array  # (rows, count): of the instants
    times: Array  # (rows, count): in intervals
    before: Array  # (rows,): place of the last instant that is not after the point, in all of them

    @classmethod
    def of(cls, times: Array, points: Array) -> Iterator[tuple[Array, _Around]]:
        """Yield the places of some points, and what is around them."""
        last = len(times) - 1
        before = np.clip(np.searchsorted(times, points, side="right") - 1, 0, last)
        half = np.clip(np.minimum(before + 1, last - before), FEWEST, POINTS // 2)
        for some in np.unique(half):
            rows = np.flatnonzero(half == some)
            count = min(2 * int(some), len(times))
            first = np.clip(before[rows] - (count // 2 - 1), 0, len(times) - count)
            places = first[:, None] + np.arange(count)
            yield rows, cls(places, times[places], before[rows])

    def apart(self) -> Array:
        """Return the product of the distances of each instant from the others, (rows, count)."""
        result = np.ones_like(self.times)
        for j in range(self.times.shape[1]):
            distances = self.times - self.times[:, j : j + 1]
            distances[:, j] = 1.0
            result = result * distances
        return result

    def value(self, points: Array, apart: Array, values: Array) -> Array:
        """Return the polynomials through values, (rows, count, 6), at the points."""
        distances = self.times - points[:, None]
        above, below = np.zeros((len(points), 6)), np.zeros((len(points), 1))
        with np.errstate(divide="ignore", invalid="ignore"):
            weights = 1.0 / (distances * apart)
            for k in range(self.times.shape[1]):
                above = above + weights[:, k : k + 1] * values[:, k]
                below = below + weights[:, k : k + 1]
            result = above / below
        rows, columns = np.nonzero(distances == 0)
        result[rows] = values[rows, columns]
        return result


def of_means(times: Array, samples: Array, boundaries: Array) -> Array:
    """Return the increments between boundaries, (n, 6), from the integrals since the instant before, (instants, 6).

    Instants and boundaries are in intervals since a first instant.
    """
    ends, before = np.empty((len(boundaries), 6)), np.empty(len(boundaries), int)
    for rows, around in _Around.of(times, boundaries):
        own = samples[around.places]
        here = (around.before - around.places[:, 0])[:, None]
        sums = np.zeros_like(own)
        count = sums.shape[1]
        for k in range(1, count):
            sums[:, k] = np.where(k > here, sums[:, k - 1] + own[:, k], 0.0)
        for k in range(count - 2, -1, -1):
            sums[:, k] = np.where(k < here, sums[:, k + 1] - own[:, k + 1], sums[:, k])
        ends[rows] = around.value(boundaries[rows], around.apart(), sums)
        before[rows] = around.before
    total = np.zeros((len(boundaries) - 1, 6))
    between = np.diff(before)
    for k in range(1, int(between.max()) + 1):
        place = np.minimum(before[:-1] + k, len(samples) - 1)
        total = np.where(k <= between[:, None], total + samples[place], total)
    return np.asarray(total + (ends[1:] - ends[:-1]))


def of_points(times: Array, samples: Array, boundaries: Array, interval: float) -> Array:
    """Return the same from samples at the instants, a second; the interval is in s."""
    begins = boundaries[:-1]
    result = np.empty((len(begins), 6))
    for rows, around in _Around.of(times, begins + 0.5):
        apart, values = around.apart(), samples[around.places]
        total = np.zeros((len(rows), 6))
        for node, weight in GAUSS:
            total = total + weight * around.value(begins[rows] + node, apart, values)
        result[rows] = interval * total
    return result
