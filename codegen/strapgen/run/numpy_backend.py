"""The numpy back end: transitions of all steps at once, then their products as a blocked scan."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from strapgen.run import compiler
from strapgen.run.array_programs import ArrayProgram
from strapgen.run.blocked_scan import BlockedScan
from strapgen.run.evaluators import Array
from strapgen.run.increments import PART
from strapgen.run.numpy_evaluator import NumpyEvaluator
from strapgen.run.protocol import Backend
from strapgen.run.step_sources import StepSources

#: Largest number of steps times runs in one span: some megabytes, which stay in the processor's cache. A run that comes
#: part by part has the same spans.
_SPAN = PART


class NumpyBackend(Backend):
    """Runs generated numpy code, with no Python loop over the steps of a long run or over many runs."""

    def __init__(self, parts: StepSources) -> None:
        step = NumpyEvaluator(parts.step)
        super().__init__(parts, step)
        self._generated_step: Callable[..., Array] = step.generated
        self._product = parts.step_kernels.product
        if self._product is not None:
            self._generated_product: Callable[..., Array] = self.beside(self._product).generated
        if self._orthonormalization is not None:
            self._orthonormalize: Callable[..., Array] = self.beside(self._orthonormalization).generated
        self._elements = self.identity.size

    def beside(self, kernel: str) -> NumpyEvaluator:
        """Return another kernel in numpy, see `Backend.beside`."""
        return NumpyEvaluator(self._sources(kernel))

    def _kernels(self) -> list[tuple[str | None, str]]:
        return [*super()._kernels(), (self._product, self.sources.target)]

    @cached_property
    def _array_programs(self) -> tuple[ArrayProgram, ArrayProgram]:
        """The transition of a step and the product, as a scan calls them."""
        transition = getattr(compiler.load(self.sources), f"{self.sources.function.name}_transition")
        return (
            ArrayProgram(transition, [(self.samples, 3)]),
            ArrayProgram(self._generated_product, [self.state_shape, self.state_shape]),
        )

    def _propagate(
        self, increments: Array, record_every: int, orthonormalize_every: int, initial: Array
    ) -> Array:
        runs, steps = increments.shape[:2]
        history = np.empty((runs, 1 + steps // record_every, *self.state_shape))
        history[:, 0] = initial
        state = initial
        if self._product is None:
            self._run_in_turn(increments, record_every, orthonormalize_every, history)
            return history
        scan = BlockedScan(*self._array_programs, self.identity.ravel())
        for first, length, segments in _spans(steps, orthonormalize_every, max(1, _SPAN // max(runs, 1))):
            span = increments[:, first : first + length * segments]
            complete = orthonormalize_every and (first + length) % orthonormalize_every == 0
            count = span.shape[1]
            direct = record_every == 1
            states = (
                history[:, 1 + first : 1 + first + count]
                if direct
                else np.empty((runs, count, *self.state_shape))
            )
            state = self._run_span(scan, span, length, segments, bool(complete), state, states)
            if direct:
                continue
            # Records of this span: steps first + 1, ..., counted from 1.
            offset = -first % record_every or record_every
            recorded = states[:, offset - 1 :: record_every]
            if recorded.shape[1]:
                place = (first + offset) // record_every
                history[:, place : place + recorded.shape[1]] = recorded
        return history

    def _run_in_turn(
        self, increments: Array, record_every: int, orthonormalize_every: int, history: Array
    ) -> None:
        """Run one step after the other, for a step that is not linear in the state; all runs go side by side."""
        state = history[:, 0]
        for number in range(increments.shape[1]):
            state = self._generated_step(state, increments[:, number])
            if orthonormalize_every and (number + 1) % orthonormalize_every == 0:
                state = self._orthonormalize(state)
            if (number + 1) % record_every == 0:
                history[:, (number + 1) // record_every] = state

    def _run_span(
        self,
        scan: BlockedScan,
        increments: Array,
        length: int,
        segments: int,
        orthonormalize: bool,
        state: Array,
        states: Array,
    ) -> Array:
        """Run segments of `length` steps, of which the last may be shorter; store all states and return the last.

        The segments are scanned side by side from the identity. A loop over them then takes the state through their
        products and orthonormalizes between them.
        """
        runs, steps = increments.shape[:2]
        totals = scan.totals(increments, length, segments)
        starts = np.empty((runs, segments, *self.state_shape))
        ends = np.empty_like(starts)
        segment_totals = totals[:, -1].reshape(self._elements, runs, segments).transpose(2, 1, 0)
        full = steps // length
        for segment, total in enumerate(segment_totals.reshape(segments, runs, *self.state_shape)):
            starts[:, segment] = state
            state = self._generated_product(state, total)
            if orthonormalize and segment < full:
                state = self._orthonormalize(state)
            ends[:, segment] = state
        begin = np.ascontiguousarray(starts.reshape(runs * segments, self._elements).T)
        blocks = totals.shape[1]
        depth = -(-length // blocks)
        exact = segments * blocks * depth == steps
        shape = (runs, segments, blocks, depth, self._elements)
        # The first splits axes, and copies nothing.
        by_time = states.reshape(shape) if exact else np.empty(shape)
        scan.states(begin, totals, by_time.transpose(4, 3, 2, 0, 1))
        if not exact:
            padded = by_time.reshape(runs, segments, blocks * depth, *self.state_shape)[:, :, :length]
            states[...] = padded.reshape(runs, segments * length, *self.state_shape)[:, :steps]
        if orthonormalize:
            whole = states[:, : full * length].reshape(runs, full, length, *self.state_shape)
            whole[:, :, -1] = ends[:, :full]
        return states[:, -1].copy()  # so a run that goes on from a record of its last state has the same bits


def _spans(steps: int, segment: int, most: int) -> list[tuple[int, int, int]]:
    """Cut the steps into spans: first step, steps per segment, number of segments.

    A segment lies between two orthonormalizations; a span holds whole segments, or a part of a long one.
    """
    spans: list[tuple[int, int, int]] = []
    first = 0
    if segment and segment <= most:
        together = most // segment
        while first < steps:
            segments = min(together, -(-(steps - first) // segment))
            spans.append((first, segment, segments))
            first += segment * segments
        return spans
    while first < steps:
        until_end = segment - first % segment if segment else steps
        length = min(most, until_end, steps - first)
        spans.append((first, length, 1))
        first += length
    return spans
