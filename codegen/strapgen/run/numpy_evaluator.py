"""Runs generated numpy functions; a run takes the transitions of all steps at once, then their blocked scan."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from strapgen.ir.sources import Sources
from strapgen.run import compiler
from strapgen.run.array_programs import ArrayProgram
from strapgen.run.blocked_scan import BlockedScan
from strapgen.run.evaluators import Array, Evaluator, Loop
from strapgen.run.increments import PART

#: Samples that are evaluated together: the two or three arrays of an operation stay in the nearest caches, and a call
#: of numpy costs little beside its work.
_BLOCK = 1 << 13
#: Largest number of steps times runs in one span: some megabytes, which stay in the processor's cache. A run that comes
#: part by part has the same spans.
_SPAN = PART


class NumpyEvaluator(Evaluator):
    """A generated numpy function; `generated` is the function itself, which checks nothing."""

    needs_product = True

    def __init__(self, sources: Sources) -> None:
        super().__init__(sources, np.float64)
        self.generated: Callable[..., Any] = getattr(compiler.load(sources), self.function.name)

    def evaluate(self, arrays: Sequence[Array], batch: tuple[int, ...]) -> tuple[Array, ...]:
        """Evaluate on checked arrays, many samples in blocks whose temporaries stay in the cache."""
        count = math.prod(batch)
        if count <= _BLOCK:
            return self._results(arrays)
        signals = self.function.inputs
        rows = [
            array
            if array.shape == signal.shape
            else np.broadcast_to(array, batch + signal.shape).reshape(count, *signal.shape)
            for array, signal in zip(arrays, signals, strict=True)
        ]
        outputs = [np.empty((count, *signal.shape)) for signal in self.function.outputs]
        for first in range(0, count, _BLOCK):
            block = slice(first, first + _BLOCK)
            results = self._results(
                row if row.shape == signal.shape else row[block]
                for row, signal in zip(rows, signals, strict=True)
            )
            for output, result in zip(outputs, results, strict=True):
                output[block] = result
        return tuple(output.reshape(batch + output.shape[1:]) for output in outputs)

    def _results(self, arrays: Iterable[Array]) -> tuple[Array, ...]:
        """Return the outputs of the generated function."""
        results = self.generated(*arrays)
        return results if isinstance(results, tuple) else (results,)

    def call(self, inputs: Sequence[Any], feedback: Any, where: str = "") -> tuple[Sequence[Any], Any]:
        """Call the function on rows, see `Evaluator.call`."""
        count = len(feedback)
        signals, results = self.function.inputs, self.function.outputs
        arrays = [rows.reshape(count, *signal.shape) for rows, signal in zip(inputs, signals, strict=True)]
        outputs = zip(self.evaluate(arrays, (count,)), results, strict=True)
        return [np.asarray(output).reshape(count, signal.size) for output, signal in outputs], feedback

    @cached_property
    def _transition(self) -> ArrayProgram:
        """The transition of a step's increments, as a scan calls it."""
        transition = getattr(compiler.load(self.sources), f"{self.function.name}_transition")
        return ArrayProgram(transition, [self.function.inputs[1].shape])

    @cached_property
    def _product(self) -> ArrayProgram:
        """The state after a transition, as a scan calls it."""
        return ArrayProgram(self.generated, [signal.shape for signal in self.function.inputs])

    def loop(self, samples: Array, loop: Loop) -> tuple[Array, Array]:
        """Run a step with no Python loop over the steps of a long run or over many runs, see `Evaluator.loop`.

        A step that is not linear in the state has no product, and runs one step after the other.
        """
        if not isinstance(loop.product, NumpyEvaluator):
            return super().loop(samples, loop)
        runs, steps = samples.shape[:2]
        shape = self.function.inputs[0].shape
        history = np.empty((runs, 1 + steps // loop.record_every, *shape))
        history[:, 0] = state = loop.state.reshape(runs, *shape)
        assert self.sources.attitude_step is not None, "only an attitude step has a product"
        identity = np.array([float(x) for x in self.sources.attitude_step.identity])
        scan = BlockedScan(self._transition, loop.product._product, identity)
        for first, length, segments in _spans(steps, loop.restore_every, max(1, _SPAN // max(runs, 1))):
            span = samples[:, first : first + length * segments]
            complete = loop.restore_every and (first + length) % loop.restore_every == 0
            restore = (
                loop.restore.generated if complete and isinstance(loop.restore, NumpyEvaluator) else None
            )
            count = span.shape[1]
            direct = loop.record_every == 1
            states = history[:, 1 + first : 1 + first + count] if direct else np.empty((runs, count, *shape))
            state = _run_span(scan, loop.product.generated, restore, span, length, segments, state, states)
            if direct:
                continue
            # Records of this span: steps first + 1, ..., counted from 1.
            offset = -first % loop.record_every or loop.record_every
            recorded = states[:, offset - 1 :: loop.record_every]
            if recorded.shape[1]:
                place = (first + offset) // loop.record_every
                history[:, place : place + recorded.shape[1]] = recorded
        return history.reshape(*history.shape[:2], math.prod(shape)), loop.feedback


def _run_span(
    scan: BlockedScan,
    product: Callable[..., Array],
    restore: Callable[..., Array] | None,
    samples: Array,
    length: int,
    segments: int,
    state: Array,
    states: Array,
) -> Array:
    """Run segments of `length` steps, of which the last may be shorter; store all states and return the last.

    The segments are scanned side by side from the identity. A loop over them then takes the state through their
    products and restores it between them.
    """
    (runs, steps), shape = samples.shape[:2], state.shape[1:]
    size = math.prod(shape)
    totals = scan.totals(samples, length, segments)
    starts = np.empty((runs, segments, *shape))
    ends = np.empty_like(starts)
    segment_totals = totals[:, -1].reshape(size, runs, segments).transpose(2, 1, 0)
    full = steps // length
    for segment, total in enumerate(segment_totals.reshape(segments, runs, *shape)):
        starts[:, segment] = state
        state = product(state, total)
        if restore is not None and segment < full:
            state = restore(state)
        ends[:, segment] = state
    begin = np.ascontiguousarray(starts.reshape(runs * segments, size).T)
    blocks = totals.shape[1]
    depth = -(-length // blocks)
    exact = segments * blocks * depth == steps
    places = (runs, segments, blocks, depth, size)
    # The first splits axes, and copies nothing.
    by_time = states.reshape(places) if exact else np.empty(places)
    scan.states(begin, totals, by_time.transpose(4, 3, 2, 0, 1))
    if not exact:
        padded = by_time.reshape(runs, segments, blocks * depth, *shape)[:, :, :length]
        states[...] = padded.reshape(runs, segments * length, *shape)[:, :steps]
    if restore is not None:
        whole = states[:, : full * length].reshape(runs, full, length, *shape)
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
