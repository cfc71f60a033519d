"""Units that take stamped samples to an even grid: functions called from Python, and the generated C."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from strapgen.ir.sources import Sources
from strapgen.run import compiler
from strapgen.run.compiled_code import array_type, real_type
from strapgen.run.evaluators import Array
from strapgen.stamped.grid_clock import BLOCK, GridClock, StampError, StampScale, StampStatus
from strapgen.stamped.rounds import Piece, Rounds

_WORDS = {
    StampStatus.RANGE: "a sample lies outside the range of its format",
    StampStatus.OFFSET: "an instant lies more than 5 % of a sampling interval from an even grid",
    StampStatus.GAP: "a stamp is that of the sample before, or more than two sampling intervals after it",
    StampStatus.RATE: "the stamps have an interval that is more than 3 % from the nominal one (sample_hz)",
}


class StampedUnit:
    """The grid by functions that Python calls, on doubles or integers of the model."""

    def __init__(self, rounds: Rounds, scale: StampScale) -> None:
        self._rounds, self._scale = rounds, scale
        self.start()

    def start(self) -> None:
        """Forget all samples."""
        self._clock = GridClock(self._scale)
        #: Samples from the place `_first` on, and the offsets of their boundaries.
        self._samples, self._offsets = np.empty((0, 3), self._rounds.number), np.empty(0, np.int64)
        self._first = 0
        #: Samples of the grid that have been returned.
        self._done = 0

    @property
    def period(self) -> int:
        """The interval of the grid, 0 before it begins."""
        return self._clock.period

    def push(self, sample: Array, stamp: int) -> Array:
        """Take a sample, and return those of the grid that follow, (k, 3)."""
        is_first = not self._clock.period and not self._clock.first
        offsets = self._clock.take(stamp)
        if not is_first:
            self._samples = np.concatenate([self._samples, sample[None]])
        return self._grid(offsets, False)

    def flush(self) -> Array:
        """End the recording, and return the samples of the grid that are left, (k, 3)."""
        return self._grid(self._clock.finish(), True)

    def whole(self, samples: Array, stamps: Array) -> Array:
        """Return the grid of a whole recording, (N, 3): of N samples with the N + 1 stamps around them."""
        offsets: list[int] = []
        for place, stamp in enumerate(stamps.tolist()):
            with at_stamp(place):
                offsets += self._clock.take(stamp)
        offsets += self._clock.finish()
        return self._rounds.grid(Piece(samples, np.array(offsets, np.int64), True, True))[1]

    def _grid(self, offsets: list[int], ends: bool) -> Array:
        """Return the samples of the grid that more offsets make known."""
        self._offsets = np.concatenate([self._offsets, np.array(offsets, np.int64)])
        if len(self._offsets) < 2:
            return self._samples[:0]
        piece = Piece(self._samples, self._offsets, self._first == 0, ends)
        begin, grid = self._rounds.grid(piece)
        fresh = grid[self._done - self._first - begin :]
        self._done += len(fresh)
        unused = max(0, self._done - self._first - self._rounds.latency)
        self._samples, self._offsets = self._samples[unused:], self._offsets[unused:]
        self._first += unused
        return fresh


@contextmanager
def at_stamp(place: int) -> Iterator[None]:
    """Name the place of a stamp that is refused."""
    try:
        yield
    except StampError as error:
        raise StampError(error.status, error.reason, place) from None


class StampedUnitInC:
    """The C of `stamped_sources.sources`, with the interface of `StampedUnit`."""

    def __init__(self, sources: Sources, scale: StampScale) -> None:
        self._mask = (1 << scale.bits) - 1
        module = compiler.load(sources)
        self._ffi, self._lib, self._name = module.ffi, module.lib, sources.function.name
        self.dtype = real_type(sources.target) if sources.fixed is None else np.dtype(np.int32)
        self._memory = self._ffi.new(f"{self._name}_memory *")
        self.start()

    def start(self) -> None:
        """Forget all samples."""
        getattr(self._lib, f"{self._name}_init")(self._memory)

    @property
    def period(self) -> int:
        """The interval of the grid, 0 before it begins."""
        return int(self._memory.period)

    def push(self, sample: Array, stamp: int) -> Array:
        """Take a sample, and return those of the grid that follow, (k, 3)."""
        values = np.ascontiguousarray(sample, self.dtype)
        return self._call("push", self._ffi.from_buffer(array_type(self.dtype), values), stamp & self._mask)

    def flush(self) -> Array:
        """End the recording, and return the samples of the grid that are left, (k, 3)."""
        return self._call("flush")

    def whole(self, samples: Array, stamps: Array) -> Array:
        """Return the grid of a whole recording, see `StampedUnit.whole`."""
        rows = np.concatenate([samples[:1], samples])
        grid = []
        for place, (row, stamp) in enumerate(zip(rows, stamps.tolist(), strict=True)):
            with at_stamp(place):
                grid.append(self.push(row, stamp))
        return np.concatenate([*grid, self.flush()])

    def _call(self, what: str, *arguments: Any) -> Array:
        grid = np.empty((BLOCK, 3), self.dtype)
        pointer = self._ffi.from_buffer(array_type(self.dtype), grid)
        status = int(getattr(self._lib, f"{self._name}_{what}")(self._memory, *arguments, pointer))
        if status < 0:
            raise StampError(StampStatus(status), _WORDS[StampStatus(status)])
        return grid[:status]
