"""Commits an attitude late, sample by sample: in Python with generated functions, or in generated C.

Interval k lies between two instants and has sample k. It is committed when L samples after it are there, by the step of
the window. The attitude of now is the committed one times the steps of the last intervals, with filters for the samples
that are there. The C of `commit_late_sources` does the same in the same order.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from fractions import Fraction
from typing import Any

import numpy as np

from strapgen.design.commit_late.commit_late_sources import LateSources
from strapgen.design.commit_late.late_filters import (
    NEXT,
    NORMALIZED_EVERY,
    REACH,
    SHORT,
    LateFilters,
    short_place,
)
from strapgen.ir.exceptions import InputError
from strapgen.ir.interfaces import Argument, Interface
from strapgen.ir.sources import Sources
from strapgen.run import compiler
from strapgen.run.backend_names import of_sources
from strapgen.run.compiled_code import array_type, real_type
from strapgen.run.evaluators import Array, Evaluator, in_units


class SampleKind(IntEnum):
    """The kind of a sample: regular, lost, or merged with a lost one.

    A `MERGED` sample follows a lost one, and is the sum of both.

    Examples
    --------
    >>> SampleKind(1).name
    'LOST'
    """

    GOOD = 0
    LOST = 1
    MERGED = 2


class GapError(InputError):
    """A lost sample that cannot be restored; the state is that before the call.

    Examples
    --------
    >>> raise GapError("sample 3 is lost")
    Traceback (most recent call last):
        ...
    strapgen.design.commit_late.late_unit.GapError: sample 3 is lost
    """


def refusal(kind: int, gap: int, count: int) -> str:
    """Return why a sample is refused, `gap` samples after a lost one (0: none), with `count` held; "" if it is not."""
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
    """A late-commit unit in the numbers of generated functions: doubles, or integers of the model.

    `attitude` is the committed one, at the end of the last committed interval, `pending` the number of intervals that
    are not committed, and `committed` the attitudes that the last call committed, the oldest first.
    """

    #: Commits from one normalization to the next.
    _normalized_every = 1

    def __init__(self, sources: LateSources) -> None:
        self.filters: LateFilters = sources.filters
        self._step = of_sources(sources.step)
        self._rotation = of_sources(sources.rotation)
        self._normalization = of_sources(sources.normalization)
        sums = self.filters.sums
        self._sets: Sequence[Any] = [_table(rows[sums.start :]) for rows in self.filters.sets]
        self._short: Sequence[Any] = [_table(rows[sums.start :]) for rows in self.filters.short]
        #: Bits by which sums are shifted down: those of filters, of an estimate and of a lost sample.
        self._shifts: Sequence[int] = [0] * len(sums)
        self._next: tuple[Any, int] = _table([NEXT])[0], 0
        self._restoring: tuple[Any, int] = _table(self.filters.restoration), 0
        size = self._step.function.inputs[0].size
        identity = np.eye(3) if size == 9 else np.array([0.0, 0, 0, 1])
        self.attitude: Array = self._step.stored(0, identity)
        self.committed: list[Array] = []
        self.pending = 0
        self._samples = np.empty((0, 3), self._step.number)
        self._gap, self._merged = 0, False
        self._feedback, self._commits = self._step.fresh(1), 0

    def reset(self, attitude: Array) -> None:
        """Replace the committed attitude."""
        self.attitude = attitude
        self._feedback, self._commits = self._step.fresh(1), 0

    def push(self, sample: Array, kind: int) -> int:
        """Take a sample, (3,), of a `SampleKind`, and return how many intervals it commits."""
        reason = refusal(kind, self._gap, len(self._samples))
        if reason:
            raise GapError(reason)
        sample = sample.astype(self._samples.dtype)
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
        attitude, feedback = self.attitude, self._feedback
        for place in range(len(self._samples) - self.pending, len(self._samples)):
            attitude, feedback = self._advance(attitude, feedback, place)
        return attitude

    def flush(self) -> int:
        """Commit all intervals with the samples that are there, and return how many."""
        return self._commit(self.pending)

    def _estimate(self) -> Array:
        """Return an estimate of the next sample, from the last ones."""
        taps, shift = self._next
        return self._near(self._sum(taps, self._samples[-len(taps) :], shift))

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
        taps, shift = self._restoring
        return self._near(self._sum(taps[int(self._merged)], around, shift))

    def _split(self, both: Array, lost: Array) -> tuple[Array, Array]:
        """Return a lost sample and the next one, whose sum is known."""
        return lost, both - lost

    def _near(self, values: Array) -> Array:
        """Return the nearest values in the range of a sample."""
        return values

    def _sum(self, taps: Any, samples: Array, shift: int) -> Array:
        """Return the sum of samples, each times its tap, in their order; integers are shifted down."""
        total: Array = taps[0] * samples[0]
        for tap, sample in zip(taps[1:], samples[1:], strict=True):
            total = total + tap * sample
        return total

    def _commit(self, count: int) -> int:
        """Commit the oldest intervals that are not."""
        self.committed = []
        for _ in range(count):
            place = len(self._samples) - self.pending
            attitude, self._feedback = self._advance(self.attitude, self._feedback, place)
            self.pending -= 1
            self._commits += 1
            if self._commits == self._normalized_every:
                self._commits = 0
                # The first words of the step's error feedback are those of its state.
                words = self._normalization.fresh(1).shape[1]
                attitude, first = _called(self._normalization, self._feedback[:, :words], attitude)
                self._feedback = np.concatenate([first, self._feedback[:, words:]], axis=1)
            self.attitude = attitude
            self.committed.append(self.attitude)
        return count

    def _advance(self, attitude: Array, feedback: Array, place: int) -> tuple[Array, Array]:
        """Return attitude and error feedback after the interval of a sample, with the samples that are there."""
        window, count = self.filters.window, len(self._samples)
        after = count - 1 - place
        if count < self.filters.samples:
            width = min(count, SHORT)
            first = min(max(place - 1, 0), count - width)
            rows = self._short[short_place(width, place - first)]
            return self._rotate(attitude, rows, self._samples[first : first + width], place), feedback
        if place >= window.previous and after >= window.ahead:
            samples = self._samples[place - window.previous : place + window.ahead + 1]
            return _called(self._step, feedback, attitude, samples)
        before = place if after > window.ahead else self.filters.samples - 1 - after
        samples = self._samples[place - before : place - before + self.filters.samples]
        return self._rotate(attitude, self._sets[before], samples, place), feedback

    def _rotate(self, attitude: Array, rows: Any, samples: Array, place: int) -> Array:
        """Return an attitude after an interval, by filters on samples."""
        sums = [self._sum(taps, samples, shift) for taps, shift in zip(rows, self._shifts, strict=True)]
        if self.filters.sums.start:
            sums = [self._samples[place], *sums]
        return _called(self._rotation, self._rotation.fresh(1), attitude, *sums)[0]


class LateUnitOnIntegers(LateUnit):
    """A late-commit unit in the integer model."""

    _normalized_every = NORMALIZED_EVERY

    def __init__(self, sources: LateSources) -> None:
        super().__init__(sources)
        fixed = sources.fixed
        assert fixed is not None, "its target is one of fixed point"
        self._limit, self._shifts = fixed.limit, fixed.shifts
        self._sets, self._short = fixed.sets, fixed.short
        self._next = (-2, 8, -12, 8), 1
        self._restoring = fixed.restoring, fixed.restoring_shift

    def _split(self, both: Array, lost: Array) -> tuple[Array, Array]:
        following = self._near(both - lost)
        return both - following, following

    def _near(self, values: Array) -> Array:
        return np.clip(values, -self._limit, self._limit)

    def _sum(self, taps: Any, samples: Array, shift: int) -> Array:
        """Return the sum of samples, each times its tap, shifted down and rounded to the nearest, halves up."""
        total = np.asarray(taps, np.int64) @ samples + (1 << (shift - 1))
        result: Array = total >> shift
        return result


def _table(rows: Sequence[Sequence[Fraction]]) -> Array:
    return np.array([[float(tap) for tap in row] for row in rows])


def _called(evaluator: Evaluator, feedback: Array, attitude: Array, *inputs: Array) -> tuple[Array, Array]:
    """Return the attitude that a function makes of one, and its error feedback."""
    outputs, feedback = evaluator.run([x.reshape(1, -1) for x in (attitude, *inputs)], feedback)
    return np.asarray(outputs[0]).reshape(attitude.shape), feedback


def state_argument(step: Sources) -> Argument:
    """Return the format of the state of a step."""
    assert step.fixed is not None, "its target is one of fixed point"
    return step.fixed.inputs[0]


def sample_integers(argument: Argument, values: Any, kind: int, rest: Array) -> tuple[Array, Array]:
    """Return a sample in rad, (3,), as nearest integers, and the remainder for the next one.

    As from a gyro that counts pulses, the error of a sum of samples is at most a unit: `rest` is what the samples
    before have left, in units. A sample outside its range, or that of the sum of two, is refused.
    """
    limit = argument.high * (2 if kind == SampleKind.MERGED else 1)
    scaled = in_units(argument, np.asarray(values, np.float64))
    if (np.abs(np.rint(scaled)) > limit).any():
        raise InputError(
            f"sample holds {float(np.abs(values).max()):.9g}; formats were chosen for at most "
            f"{float(limit * argument.unit):.9g} in magnitude"
        )
    if kind == SampleKind.LOST:
        return np.zeros(3, np.int64), rest
    counts = np.clip(np.rint(scaled + rest), -limit, limit)
    return counts.astype(np.int64), scaled + rest - counts


class LateUnitInC:
    """A late-commit unit in the C of `commit_late_sources.sources`, with the interface of `LateUnit`."""

    def __init__(self, sources: Sources) -> None:
        module = compiler.load(sources)
        self._ffi, self._lib, self._name = module.ffi, module.lib, sources.function.name
        self.fixed: Interface | None = sources.fixed
        self.dtype: np.dtype[Any] = real_type(sources.target) if sources.fixed is None else np.dtype(np.int32)
        self._state = sources.function.inputs[0]
        self._memory = self._ffi.new(f"{self._name}_memory *")
        self._call("init")
        self.committed: list[Array] = []

    @property
    def attitude(self) -> Array:
        """The committed attitude."""
        values = self._ffi.unpack(self._memory.state, self._state.size)
        return np.array(values, self.dtype).reshape(self._state.shape)

    @property
    def pending(self) -> int:
        """Intervals that are not committed."""
        return int(self._memory.pending)

    def reset(self, attitude: Array) -> None:
        """Replace the committed attitude."""
        self._call("reset", self._pointer(np.ascontiguousarray(attitude, self.dtype)))

    def push(self, sample: Array, kind: int) -> int:
        """Take a sample and return how many intervals it commits, see `LateUnit.push`."""
        gap, count = self._memory.gap, self._memory.count
        status = self._call("push", self._pointer(np.ascontiguousarray(sample, self.dtype)), kind)
        if status < 0:
            raise self._refusal(status, kind, gap, count)
        return self._commit(status)

    def now(self) -> Array:
        """Return the attitude at the end of the last interval."""
        attitude = np.empty(self._state.shape, self.dtype)
        self._accept("now", self._pointer(attitude))
        return attitude

    def flush(self) -> int:
        """Commit all intervals with the samples that are there, and return how many."""
        return self._commit(self._accept("flush"))

    def _accept(self, what: str, *arguments: Any) -> int:
        """Call a function and return its result, unless it refuses the state."""
        status = self._call(what, *arguments)
        if status < 0:
            raise self._refusal(status, 0, 0, 0)
        return status

    def _refusal(self, status: int, kind: int, gap: int, count: int) -> InputError:
        """Return the error for a status."""
        if self.fixed is not None and status == -1:
            return InputError("a sample lies outside the range of its format")
        if self.fixed is not None and status == -2:
            return InputError("the state is too far from a proper one to be advanced; reset it")
        return GapError(refusal(kind, gap, count))

    def _commit(self, count: int) -> int:
        self.committed = [self.attitude] if count else []
        return count

    def _call(self, what: str, *arguments: Any) -> int:
        return int(getattr(self._lib, f"{self._name}_{what}")(self._memory, *arguments))

    def _pointer(self, array: Array) -> Any:
        """Return the C pointer to a contiguous array's first element."""
        return self._ffi.from_buffer(array_type(array.dtype), array)
