"""Commits an attitude late and answers it now on integers: in generated C, and in the model that has its bits."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from strapgen.design.commit_late.commit_late_sources import LateSources
from strapgen.design.commit_late.fixed_filters import NORMALIZED_EVERY, FixedFilters
from strapgen.design.commit_late.late_unit import LateUnit, SampleKind
from strapgen.design.commit_late.late_unit_in_c import LateUnitInC
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_interface import Argument
from strapgen.ir.sources import Sources
from strapgen.run.evaluators import Array, Evaluator
from strapgen.run.fixed_numbers import in_units

#: An estimate of the next sample from the last four, in halves.
_NEXT = (-2, 8, -12, 8)


class LateUnitOnIntegers(LateUnit):
    """Commits late and answers now in the integer model.

    Parameters
    ----------
    sources : LateSources
        Functions of the integer model.
    """

    def __init__(self, sources: LateSources) -> None:
        super().__init__(sources)
        assert sources.fixed is not None, "its target is one of fixed point"
        self._fixed: FixedFilters = sources.fixed
        self._sets = [np.array(group, np.int64) for group in self._fixed.sets]
        self._short = [np.array(group, np.int64) for group in self._fixed.short]
        one = 1 << state_argument(sources.step).format.fraction
        self.attitude = (self.attitude * one).astype(np.int64)
        self._samples = np.empty((0, 3), np.int64)
        self._feedback = self._step.fresh(1)
        self._commits = 0

    def reset(self, attitude: Array) -> None:
        """Replace the committed attitude."""
        super().reset(attitude)
        self._feedback, self._commits = self._step.fresh(1), 0

    def push(self, sample: Array, kind: int) -> int:
        """Take a sample, see `LateUnit.push`."""
        return super().push(sample.astype(np.int64), kind)

    def now(self) -> Array:
        """Return the attitude at the end of the last interval."""
        feedback = self._feedback.copy()
        attitude = super().now()
        self._feedback = feedback
        return attitude

    def _estimate(self) -> Array:
        return self._near(_summed(_NEXT, self._samples[-4:], 1))

    def _restored(self, around: Array) -> Array:
        taps = self._fixed.restoring[int(self._merged)]
        return self._near(_summed(taps, around, self._fixed.restoring_shift))

    def _split(self, both: Array, lost: Array) -> tuple[Array, Array]:
        following = self._near(both - lost)
        return both - following, following

    def _near(self, values: Array) -> Array:
        """Return the nearest integers in the range of a sample."""
        return np.clip(values, -self._fixed.limit, self._fixed.limit)

    def _normalized(self, attitude: Array) -> Array:
        self._commits += 1
        if self._commits < NORMALIZED_EVERY:
            return attitude
        self._commits = 0
        count = self._normalization.fresh(1).shape[1]
        outputs, feedback = self._normalization.run([attitude.reshape(1, -1)], self._feedback[:, :count])
        self._feedback[:, :count] = feedback
        return np.asarray(outputs[0]).reshape(attitude.shape)

    def _stepped(self, attitude: Array, samples: Array) -> Array:
        outputs, self._feedback = self._step.run(
            [attitude.reshape(1, -1), samples.reshape(1, -1)], self._feedback
        )
        return np.asarray(outputs[0]).reshape(attitude.shape)

    def _rotated(self, attitude: Array, rows: Array, samples: Array, place: int) -> Array:
        sums = [_summed(taps, samples, shift) for taps, shift in zip(rows, self._fixed.shifts, strict=True)]
        coefficients = [*([self._samples[place]] if self._first_is_sample else []), *sums]
        return _turned(self._rotation, attitude, coefficients)


def _turned(rotation: Evaluator, attitude: Array, coefficients: Sequence[Array]) -> Array:
    inputs = [attitude.reshape(1, -1), *(values.reshape(1, -1) for values in coefficients)]
    outputs, _ = rotation.run(inputs, rotation.fresh(1))
    return np.asarray(outputs[0]).reshape(attitude.shape)


def _summed(taps: Sequence[int] | Array, samples: Array, shift: int) -> Array:
    """Return the sum of samples, each times its tap, shifted down and rounded to the nearest, halves up."""
    total = np.asarray(taps, np.int64) @ samples + (1 << (shift - 1))
    result: Array = total >> shift
    return result


class LateUnitInFixedC(LateUnitInC):
    """Commits late and answers now in generated C on integers.

    Parameters
    ----------
    sources : Sources
        What `library.commit_late_sources.sources` returns.
    """

    number, dtype = "int32_t", np.dtype(np.int32)

    def _refused(self, status: int, kind: int, gap: int, count: int) -> InputError:
        if status == -1:
            return InputError("a sample lies outside the range of its format")
        if status == -2:
            return InputError("the state is too far from a proper one to be advanced; reset it")
        return super()._refused(status, kind, gap, count)


def state_argument(step: Sources) -> Argument:
    """Return the format of the state of a step."""
    assert step.fixed is not None, "its target is one of fixed point"
    return step.fixed.inputs[0]


def sample_integers(argument: Argument, values: Any, kind: int, rest: Array) -> tuple[Array, Array]:
    """Return a sample in rad as integers, each rounded to the nearest, and what rounding leaves for the next one.

    As from a gyro that counts pulses, the error of a sum of samples is at most a unit.

    Parameters
    ----------
    argument : Argument
        The format.
    values : array_like, (3,)
    kind : int
        A `SampleKind`.
    rest : array, (3,)
        What the rounding of the samples before left, in units.

    Raises
    ------
    InputError
        If it lies outside the range of a sample, or of the sum of two.
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
