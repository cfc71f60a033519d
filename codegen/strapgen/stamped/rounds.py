"""Takes samples with offsets of their instants to an even grid, in rounds of corrections.

A round has the rate from the samples as they are estimated so far, at first as they come. At the ends, where fewer
pairs of samples are there, the two nearest ones or the nearest one serve; the first and the last boundary are the
instants themselves, so that the sum of all samples stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from strapgen.run.evaluators import Array, Evaluator
from strapgen.stamped.grid_clock import OFFSET_BITS

#: Numbers of pairs at the ends, where there are no more.
EDGES = (1, 2)
#: Boundaries that are worked on together.
_PART = 1 << 15


def pairs_there(before: int, after: int, most: int) -> int:
    """Return how many pairs of samples a boundary has that has so many samples before and after it.

    >>> [pairs_there(before, 9, 5) for before in range(7)]
    [0, 1, 2, 2, 2, 5, 5]
    """
    there = min(before, after)
    return most if there >= most else min(there, EDGES[-1])


class Piece(NamedTuple):
    """A piece of a recording: samples, (n, 3), in the numbers of the code, and offsets of all their boundaries."""

    samples: Array
    offsets: Array
    #: Whether the recording begins with it, and whether it ends with it
    begins: bool
    ends: bool


class Rounds:
    """The rounds of corrections on generated functions, by the number of pairs."""

    def __init__(self, pairs: Sequence[int], functions: dict[int, Evaluator]) -> None:
        self._pairs, self._functions = pairs, functions
        #: Type of the numbers, and samples after the end of one on the grid that it is known.
        self.number, self.latency = functions[pairs[0]].number, sum(pairs)

    def grid(self, piece: Piece) -> tuple[int, Array]:
        """Return the place of the first sample of the grid that follows from a piece, and all that do, (k, 3)."""
        first, last, estimates = 0, len(piece.samples), piece.samples
        for pairs in self._pairs:
            # The boundaries that have their pairs; before the first and after the last sample there is a boundary.
            low = first if piece.begins else first + pairs
            high = last if piece.ends else last - pairs
            if high <= low:
                return low, piece.samples[:0]
            e = self._corrections(pairs, estimates, low - first, high - first, piece.offsets[low : high + 1])
            estimates = piece.samples[low:high] + e[:-1] - e[1:]
            first, last = low, high
        return first, estimates

    def _corrections(self, pairs: int, samples: Array, low: int, high: int, offsets: Array) -> Array:
        """Return the corrections at the boundaries `low` to `high` of samples."""
        result = np.zeros((high - low + 1, 3), samples.dtype)
        inner = max(low, pairs), min(high, len(samples) - pairs)
        for begin in range(inner[0], inner[1] + 1, _PART):
            end = min(begin + _PART, inner[1] + 1)
            around = sliding_window_view(samples[begin - pairs : end + pairs - 1], 2 * pairs, axis=0)
            rows = np.ascontiguousarray(around.transpose(0, 2, 1)).reshape(end - begin, -1)
            result[begin - low : end - low] = self._call(pairs, rows, offsets[begin - low : end - low])
        for place in (*range(low, min(inner[0], high + 1)), *range(max(inner[1] + 1, inner[0]), high + 1)):
            fewer = pairs_there(place, len(samples) - place, pairs)
            if fewer:
                row = samples[place - fewer : place + fewer].reshape(1, -1)
                result[place - low] = self._call(fewer, row, offsets[place - low : place - low + 1])[0]
        return result

    def _call(self, pairs: int, rows: Array, offsets: Array) -> Array:
        function = self._functions[pairs]
        whole = offsets if function.sources.fixed else np.ldexp(offsets.astype(function.number), -OFFSET_BITS)
        outputs, _ = function.run([rows, whole.reshape(-1, 1)], function.fresh(len(rows)))
        return np.asarray(outputs[0])
