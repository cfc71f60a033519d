"""A blocked scan over the transitions of a run, which has the state after every step in few calls of numpy.

The state after n steps is the product of n transitions, and the product is associative. The steps are therefore cut
into blocks whose products grow side by side, as in a parallel prefix sum: Python loops over the places in a block,
numpy over the blocks. Arrays have the element first, (elements, depth, blocks, ...), so that every operation runs over
contiguous memory.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from strapgen.run.array_programs import ArrayProgram, work_arrays
from strapgen.run.evaluators import Array

#: Number of products in one numpy call of a scan, large enough to hide the cost of the call. Rows of a power of two
#: would lie in the same lines of the cache.
_WIDTH = 8000
#: Steps in one elementwise pass, whose temporaries stay in the nearest caches.
_PASS = 12_000


class BlockedScan:
    """Turns the increments of many steps into their states, by the transition of a step and the product of two.

    It holds the memory in which it works; calls in several threads need one scan each.
    """

    def __init__(self, transition: ArrayProgram, product: ArrayProgram, identity: Array) -> None:
        self._transition, self._product, self._identity = transition, product, identity
        self._memory: dict[str, Array] = {}
        self._views: dict[tuple[str, int, tuple[int, ...]], Array] = {}
        self._rows = 0
        self._local = np.empty(0)

    def totals(self, increments: Array, length: int, segments: int) -> Array:
        """Return the products of transitions up to the end of each block, (elements, blocks, runs * segments).

        Samples are (runs, N, numbers of a step); each run consists of so many segments of `length` steps, of which the
        last may be shorter. Steps beyond its end do not turn it.
        """
        width = increments.shape[0] * segments
        blocks, depth = _cut(length, width)
        # Each result lies where nothing is needed any more: products before their transitions, states after both.
        self._rows = min(depth, max(1, _PASS // (blocks * width)))
        self._local = self._room("local", len(self._identity), (depth + self._rows, blocks, width))
        transitions = self._local[:, self._rows :]
        self._turn(increments, length, segments, transitions)
        self._accumulate(transitions, self._local)
        return self._scan(self._local[:, depth - 1])

    def states(self, begin: Array, totals: Array, out: Array) -> None:
        """Store the states after each step of the last call of `totals`, which returned `totals`.

        They go from those at the beginning of each segment, (elements, runs * segments), to `out` by the depth in their
        block, (elements, depth, blocks, runs, segments), in memory of any order.
        """
        depth, rows, local = out.shape[1], self._rows, self._local
        heads = self._room("heads", len(totals), totals.shape[1:])
        heads[:, 0] = begin
        if totals.shape[1] > 1:
            self._multiply(begin[:, None], totals[:, :-1], heads[:, 1:])
        for k in reversed(range(0, depth, rows)):
            products = local[:, k : min(k + rows, depth)]
            self._multiply(heads[:, None], products, local[:, k + rows : k + rows + products.shape[1]])
        for element, by_place in zip(out, local[:, rows:], strict=True):
            element[...] = by_place.reshape(element.shape)

    def _turn(self, increments: Array, length: int, segments: int, out: Array) -> None:
        """Store the transitions, (elements, depth, blocks, runs * segments); those beyond the end are the identity."""
        runs, steps = increments.shape[:2]
        depth, blocks, width = out.shape[1:]
        exact = steps == segments * blocks * depth
        padded = increments if exact else _padded(increments, length, segments, blocks * depth)
        by_block = padded.reshape(width, blocks, depth, -1).transpose(3, 1, 0, 2)
        columns = out.reshape(len(out), depth, -1).transpose(0, 2, 1)
        first = 0
        for tile in _tiles(blocks, width, max(1, _PASS // depth)):
            part = by_block[:, *tile]
            count = part.shape[1] * part.shape[2]
            work = self._room("work", len(part) + self._transition.temporaries, (count, depth))
            numbers = work[: len(part)]
            numbers.reshape(part.shape)[...] = part
            self._transition((numbers,), columns[:, first : first + count], work[len(part) :])
            first += count
        if not exact:
            place = np.arange(blocks * depth).reshape(blocks, depth).T[:, :, None, None]
            beyond = (place >= length) | (place + length * np.arange(segments) >= steps)
            for element, value in zip(out, self._identity, strict=True):
                np.copyto(element.reshape(depth, blocks, runs, segments), value, where=beyond)

    def _scan(self, transitions: Array) -> Array:
        """Return the product of all transitions up to each place, (elements, length, width)."""
        elements, length, width = transitions.shape
        blocks, depth = _cut(length, width)
        by_time = np.empty((elements, blocks * depth, width))
        by_time[:, :length] = transitions
        by_time[:, length:] = self._identity[:, None, None]
        by_place = by_time.reshape(elements, blocks, depth, width).transpose(0, 2, 1, 3)
        local = np.empty((elements, depth + 1, blocks, width))
        local[:, 1:] = by_place
        self._accumulate(local[:, 1:], local[:, :-1])
        by_place[:, :, 0] = local[:, :-1, 0]
        if blocks > 1:
            totals = self._scan(local[:, -2])
            self._multiply(totals[:, None, :-1], local[:, :-1, 1:], by_place[:, :, 1:])
        return by_time[:, :length]

    def _accumulate(self, transitions: Array, products: Array) -> None:
        """Store the product of transitions up to each, in every block at once, (elements, depth, ...).

        A product may lie where any transition before it did.
        """
        depth = transitions.shape[1]
        before, after = (x.reshape(*x.shape[:2], -1) for x in (transitions, products))
        after[:, 0] = before[:, 0]
        for k in range(1, depth):
            self._multiply(after[:, k - 1], before[:, k], after[:, k])

    def _multiply(self, state: Array, transition: Array, out: Array) -> None:
        """Store states advanced by transitions, all (elements, ...); a state of length 1 serves along a whole axis."""
        shape = out.shape[1:]
        most = max(1, _PASS // math.prod(shape[:-1]))
        if shape[-1] > most:
            for first in range(0, shape[-1], most):
                columns = (..., slice(first, first + most))
                self._multiply(state[columns], transition[columns], out[columns])
            return
        work = self._room("work", self._product.temporaries, shape)
        self._product((state, transition), out, work)

    def _room(self, name: str, count: int, shape: tuple[int, ...]) -> Array:
        """Return memory (count, *shape), which the next call for the same name overwrites."""
        view = self._views.get((name, count, shape))
        if view is None:
            size = math.prod(shape)
            memory = self._memory.get(name)
            if memory is None or len(memory) < count or memory.shape[1] < size:
                memory = self._memory[name] = work_arrays(count, size)
            view = self._views[name, count, shape] = memory[:count, :size].reshape(count, *shape)
        return view


def _cut(length: int, width: int) -> tuple[int, int]:
    """Return the number of blocks for a scan of `length` steps in `width` columns, and the places in each."""
    blocks = max(1, min(round(_WIDTH / width), length // 4))
    return blocks, -(-length // blocks)


def _tiles(blocks: int, width: int, most: int) -> Iterator[tuple[slice, slice]]:
    """Cut (blocks, width) into parts of up to `most` columns, which follow each other in memory."""
    if width <= most:
        for first in range(0, blocks, most // width):
            yield slice(first, first + most // width), slice(None)
        return
    for block in range(blocks):
        for first in range(0, width, most):
            yield slice(block, block + 1), slice(first, first + most)


def _padded(increments: Array, length: int, segments: int, places: int) -> Array:
    """Return the increments of segments, each with zeros up to so many places, (runs, segments, places, numbers)."""
    runs, steps = increments.shape[:2]
    rows = increments.reshape(runs, steps, -1)
    result = np.zeros((runs, segments, places, rows.shape[2]))
    full = steps // length
    result[:, :full, :length] = rows[:, : full * length].reshape(runs, full, length, rows.shape[2])
    if full < segments:
        result[:, full, : steps - full * length] = rows[:, full * length :]
    return result
