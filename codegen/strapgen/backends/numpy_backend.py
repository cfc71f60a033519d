"""The numpy back end: transitions of all steps at once, then their products as a blocked scan.

The state after n steps is the product of n transitions, and the product is associative. The steps are therefore cut
into blocks whose products grow side by side, as in a parallel prefix sum: Python loops over the places in a block,
numpy over the blocks. Arrays have the element first, (elements, ..., steps), so that every operation runs over
contiguous memory.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from strapgen.backends.evaluators import Array
from strapgen.backends.increments import PART
from strapgen.backends.numpy_evaluator import NumpyEvaluator
from strapgen.backends.protocol import Backend
from strapgen.backends.step_sources import StepSources
from strapgen.toolchain import compiler

#: Number of products in one numpy call of a scan, large enough to hide the cost of the call. Rows of a power of two
#: would lie in the same lines of the cache.
_WIDTH = 8000
#: Largest number of steps times runs in one span: some megabytes, which stay in the processor's cache. A run that comes
#: part by part has the same spans.
_SPAN = PART
#: Steps in one elementwise pass, whose temporaries stay in the nearest caches.
_PASS = 1 << 13


class NumpyBackend(Backend):
    """Runs generated numpy code, with no Python loop over the steps of a long run or over many runs."""

    def __init__(self, parts: StepSources) -> None:
        step = NumpyEvaluator(parts.step)
        super().__init__(parts, step)
        self._generated_step: Callable[..., Array] = step.generated
        self._product = parts.step_kernels.product
        if self._product is not None:
            name = f"{self.sources.function.name}_transition"
            self._transition: Callable[..., Array] = getattr(compiler.load(self.sources), name)
            self._generated_product: Callable[..., Array] = self.beside(self._product).generated
        if self._orthonormalization is not None:
            self._orthonormalize: Callable[..., Array] = self.beside(self._orthonormalization).generated
        self._elements = self.identity.size

    def beside(self, kernel: str) -> NumpyEvaluator:
        """Return another kernel in numpy, see `Backend.beside`."""
        return NumpyEvaluator(self._sources(kernel))

    def _kernels(self) -> list[tuple[str | None, str]]:
        return [*super()._kernels(), (self._product, self.sources.target)]

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
            state = self._run_span(span, length, segments, bool(complete), state, states)
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
        width = runs * segments
        blocks, depth = _cut(length, width)
        local = self._transitions(increments, length, segments, blocks, depth)
        self._accumulate(local)
        totals = self._scan(local[:, -1])  # (elements, blocks, width)
        starts = np.empty((runs, segments, *self.state_shape))
        ends = np.empty_like(starts)
        segment_totals = np.moveaxis(
            self._open(totals[:, -1]).reshape(runs, segments, *self.state_shape), 1, 0
        )
        full = steps // length
        for segment, total in enumerate(segment_totals):
            starts[:, segment] = state
            state = self._generated_product(state, total)
            if orthonormalize and segment < full:
                state = self._orthonormalize(state)
            ends[:, segment] = state
        begin = self._close(starts.reshape(width, *self.state_shape))
        heads = np.empty((self._elements, blocks, width))
        heads[:, 0] = begin
        if blocks > 1:
            self._multiply(begin[:, None], totals[:, :-1], heads[:, 1:])
        rows = max(1, _PASS // (blocks * width))
        for k in range(0, depth, rows):
            part = local[:, k : k + rows]
            self._multiply(heads[:, None], part, part)
        self._store(local.reshape(self._elements, depth, blocks, runs, segments), length, states)
        if orthonormalize:
            whole = states[:, : full * length].reshape(runs, full, length, *self.state_shape)
            whole[:, :, -1] = ends[:, :full]
        return states[:, -1].copy()  # so a run that goes on from a record of its last state has the same bits

    def _store(self, local: Array, length: int, states: Array) -> None:
        """Store states (elements, depth, blocks, runs, segments) in the order of time, (runs, steps, state shape)."""
        elements, depth, blocks, runs, segments = local.shape
        steps = states.shape[1]
        exact = segments * blocks * depth == steps
        shape = (runs, segments, blocks, depth, elements)
        by_time = (
            states.reshape(shape) if exact else np.empty(shape)
        )  # the first splits axes, and copies nothing
        for element in range(elements):
            by_time[..., element] = local[element].transpose(2, 3, 1, 0)
        if not exact:
            padded = by_time.reshape(runs, segments, blocks * depth, *self.state_shape)[:, :, :length]
            states[...] = padded.reshape(runs, segments * length, *self.state_shape)[:, :steps]

    def _transitions(self, increments: Array, length: int, segments: int, blocks: int, depth: int) -> Array:
        """Return the transitions, (elements, depth, blocks, runs * segments).

        They are worked out in the order of time, and arranged afterwards: a transition has fewer numbers than the
        increments that it takes. Those beyond the end are the identity.
        """
        runs, steps = increments.shape[:2]
        rows = increments.reshape(runs * steps, self.samples, 3)
        in_time = np.empty((self._elements, len(rows)))
        for k in range(0, len(rows), _PASS):
            self._transition(rows[k : k + _PASS], out=self._open(in_time[:, k : k + _PASS]))
        if in_time.size != self._elements * runs * segments * blocks * depth:
            whole = self._identities(runs, segments * length)
            whole[..., :steps] = in_time.reshape(self._elements, runs, steps)
            in_time = self._identities(runs, segments, blocks * depth)
            in_time[..., :length] = whole.reshape(self._elements, runs, segments, length)
        split = in_time.reshape(self._elements, runs, segments, blocks, depth).transpose(0, 4, 3, 1, 2)
        return np.ascontiguousarray(split).reshape(self._elements, depth, blocks, runs * segments)

    def _identities(self, *shape: int) -> Array:
        """Return states of zero rotation, (elements, ...)."""
        result = np.empty((self._elements, *shape))
        result[...] = self.identity.reshape(-1, *(1 for _ in shape))
        return result

    def _scan(self, transitions: Array) -> Array:
        """Return the product of all transitions up to each place, (elements, length, width)."""
        elements, length, width = transitions.shape
        blocks, depth = _cut(length, width)
        padded = np.empty((elements, blocks * depth, width))
        padded[:, :length] = transitions
        padded[:, length:] = self._close(self.identity[None])[:, :, None]
        local = np.ascontiguousarray(padded.reshape(elements, blocks, depth, width).transpose(0, 2, 1, 3))
        self._accumulate(local)
        if blocks > 1:
            totals = self._scan(local[:, -1])
            self._multiply(totals[:, None, :-1], local[:, :, 1:], local[:, :, 1:])
        return local.transpose(0, 2, 1, 3).reshape(elements, blocks * depth, width)[:, :length]

    def _accumulate(self, local: Array) -> None:
        """Replace each transition by the product up to it, in every block at once, (elements, depth, ...)."""
        for k in range(1, local.shape[1]):
            self._multiply(local[:, k - 1], local[:, k], local[:, k])

    def _multiply(self, state: Array, transition: Array, out: Array) -> None:
        """Advance states by transitions, all with the elements first."""
        self._generated_product(self._open(state), self._open(transition), out=self._open(out))

    def _open(self, elements_first: Array) -> Array:
        """Return a view (..., state shape) of an array (elements, ...)."""
        split = elements_first.reshape(self.state_shape + elements_first.shape[1:])
        axes = tuple(range(len(self.state_shape)))
        return np.moveaxis(split, axes, tuple(axis - len(axes) for axis in axes))

    def _close(self, states: Array) -> Array:
        """Return an array (elements, ...) of states (..., state shape)."""
        flat = states.reshape(*states.shape[: states.ndim - len(self.state_shape)], -1)
        return np.ascontiguousarray(np.moveaxis(flat, -1, 0))


def _cut(length: int, width: int) -> tuple[int, int]:
    """Return the number of blocks for a scan of `length` steps in `width` columns, and the places in each."""
    blocks = max(1, min(round(_WIDTH / width), length // 4))
    return blocks, -(-length // blocks)


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
