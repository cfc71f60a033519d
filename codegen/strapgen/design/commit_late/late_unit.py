"""Commits an attitude late and answers it now, sample by sample, by generated functions called from Python.

Interval k lies between two instants and has sample k. It is committed when L samples after it are there, by the step of
the window. The attitude of now is the committed one times the steps of the last intervals, with filters for the samples
that are there. The C of `targets.commit_late_c` does the same in the same order.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from fractions import Fraction

import numpy as np

from strapgen.design.commit_late.commit_late_sources import LateSources
from strapgen.design.commit_late.late_filters import NEXT, SHORT, short_place
from strapgen.design.commit_late.lost_samples import REACH
from strapgen.ir.exceptions import InputError
from strapgen.run.evaluators import Array
from strapgen.run.registry import of_sources


class SampleKind(IntEnum):
    """What a sample is.

    `MERGED` follows a lost one, and is the sum of it and of the interval of now.
    """

    GOOD = 0
    LOST = 1
    MERGED = 2


class GapError(InputError):
    """A lost sample that cannot be restored; the state is that before the call."""


def refusal(kind: int, gap: int, count: int) -> str:
    """Return why a sample is refused; "" if it is not.

    Parameters
    ----------
    kind : int
        A `SampleKind`.
    gap : int
        Samples from a lost one on; 0 without a gap.
    count : int
        Samples that are held.
    """
    if kind == SampleKind.LOST and gap:
        return (
            f"a sample is lost {gap} after another one; at least {REACH + 1} are needed from one to the other"
        )
    if kind == SampleKind.LOST and count < REACH:
        return f"a sample is lost after {count} samples; {REACH} before it are needed to restore it"
    if kind == SampleKind.MERGED and gap != 1:
        return "the sum of two intervals follows no lost sample; one is needed right before it"
    return ""


class LateUnit:
    """Commits late and answers now, in double.

    Parameters
    ----------
    sources : LateSources
        Functions for a target that Python can call.

    Attributes
    ----------
    attitude : array, (state shape)
        The committed attitude, at the end of the last committed interval.
    pending : int
        Intervals that are not committed.
    committed : list of array
        Attitudes at the ends of the intervals that the last call committed, the oldest first.
    """

    def __init__(self, sources: LateSources) -> None:
        self.filters = sources.filters
        self._step = of_sources(sources.step)
        self._rotation = of_sources(sources.rotation)
        self._normalization = of_sources(sources.normalization)
        self._sets = [_table(rows) for rows in self.filters.sets]
        self._short = [_table(rows) for rows in self.filters.short]
        self._restoring = _table(self.filters.restoration)
        self._next = _table([NEXT])[0]
        self._first_is_sample = self.filters.sums.start == 1
        size = self._step.function.inputs[0].size
        self.attitude: Array = np.eye(3) if size == 9 else np.array([0.0, 0, 0, 1])
        self.committed: list[Array] = []
        self.pending = 0
        self._samples = np.empty((0, 3))
        self._gap, self._merged = 0, False

    def reset(self, attitude: Array) -> None:
        """Replace the committed attitude."""
        self.attitude = attitude

    def push(self, sample: Array, kind: int) -> int:
        """Take a sample and return how many intervals it commits.

        Parameters
        ----------
        sample : array, (3,)
        kind : int
            A `SampleKind`.

        Raises
        ------
        GapError
            If a lost sample cannot be restored, or the sum of two intervals follows no lost one.
        """
        self._require(kind)
        if kind == SampleKind.LOST:
            sample, self._gap = self._estimate(), 1
        elif self._gap:
            self._gap += 1
            if kind == SampleKind.MERGED:
                self._samples[-1], sample = self._split(sample, self._samples[-1])
                self._merged = True
        self._samples = np.concatenate([self._samples[1 - self.filters.capacity :], sample[None]])
        self.pending += 1
        if self._gap > REACH:
            self._restore()
        if self._gap or len(self._samples) < self.filters.samples:
            return self._commit(0)
        return self._commit(max(0, self.pending - self.filters.window.ahead))

    def now(self) -> Array:
        """Return the attitude at the end of the last interval; nothing is stored."""
        attitude = self.attitude
        for place in range(len(self._samples) - self.pending, len(self._samples)):
            attitude = self._advanced(attitude, place)
        return attitude

    def flush(self) -> int:
        """Commit all intervals with the samples that are there, and return how many."""
        return self._commit(self.pending)

    def _require(self, kind: int) -> None:
        """Refuse a sample that leaves a gap which cannot be restored."""
        reason = refusal(kind, self._gap, len(self._samples))
        if reason:
            raise GapError(reason)

    def _estimate(self) -> Array:
        """Return an estimate of the next sample, from the last ones."""
        return _weighted(self._next, self._samples[-len(self._next) :])

    def _restore(self) -> None:
        """Put the lost sample in place of its estimate, and take it out of the sum where there is one."""
        around = self._samples[-2 * REACH - 1 :]
        both = around[REACH] + around[REACH + 1]
        around[REACH] = self._restored(around)
        if self._merged:
            around[REACH], around[REACH + 1] = self._split(both, around[REACH])
        self._gap, self._merged = 0, False

    def _restored(self, around: Array) -> Array:
        """Return the lost sample in the middle of others."""
        return _weighted(self._restoring[int(self._merged)], around)

    def _split(self, both: Array, lost: Array) -> tuple[Array, Array]:
        """Return a lost sample and the next one, whose sum is known."""
        return lost, both - lost

    def _commit(self, count: int) -> int:
        """Commit the oldest intervals that are not."""
        self.committed = []
        for _ in range(count):
            advanced = self._advanced(self.attitude, len(self._samples) - self.pending)
            self.pending -= 1
            self.attitude = self._normalized(advanced)
            self.committed.append(self.attitude)
        return count

    def _normalized(self, attitude: Array) -> Array:
        """Return a committed attitude without its rounding."""
        result: Array = self._normalization(attitude)
        return result

    def _advanced(self, attitude: Array, place: int) -> Array:
        """Return an attitude after the interval of the sample at a place, with the samples that are there."""
        window, count = self.filters.window, len(self._samples)
        after = count - 1 - place
        if count < self.filters.samples:
            width = min(count, SHORT)
            first = min(max(place - 1, 0), count - width)
            rows = self._short[short_place(width, place - first)]
            return self._rotated(attitude, rows, self._samples[first : first + width], place)
        if place >= window.previous and after >= window.ahead:
            samples = self._samples[place - window.previous : place + window.ahead + 1]
            return self._stepped(attitude, samples)
        before = place if after > window.ahead else self.filters.samples - 1 - after
        samples = self._samples[place - before : place - before + self.filters.samples]
        return self._rotated(attitude, self._sets[before], samples, place)

    def _stepped(self, attitude: Array, samples: Array) -> Array:
        """Return an attitude after an interval with all samples ahead."""
        result: Array = self._step(attitude, samples)
        return result

    def _rotated(self, attitude: Array, rows: Array, samples: Array, place: int) -> Array:
        """Return an attitude after an interval, by filters on samples."""
        rate = self._samples[place] if self._first_is_sample else _weighted(rows[0], samples)
        coefficients = [rate, *(_weighted(taps, samples) for taps in rows[1:])]
        result: Array = self._rotation(attitude, *coefficients)
        return result


def _table(rows: Sequence[Sequence[Fraction]]) -> Array:
    return np.array([[float(tap) for tap in row] for row in rows])


def _weighted(taps: Array, samples: Array) -> Array:
    """Return the sum of samples, each times its tap, in their order."""
    total: Array = taps[0] * samples[0]
    for tap, sample in zip(taps[1:], samples[1:], strict=True):
        total = total + tap * sample
    return total
