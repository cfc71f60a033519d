"""The evaluator for generated numpy functions."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from strapgen.ir.sources import Sources
from strapgen.run import compiler
from strapgen.run.evaluators import Array, Evaluator

#: Samples that are evaluated together: the two or three arrays of an operation stay in the nearest caches, and a call
#: of numpy costs little beside its work.
_BLOCK = 1 << 13


class NumpyEvaluator(Evaluator):
    """A generated numpy function.

    Attributes
    ----------
    generated : callable
        The function itself, which checks nothing.
    """

    def __init__(self, sources: Sources) -> None:
        super().__init__(sources, np.float64)
        self.generated: Callable[..., Any] = getattr(compiler.load(sources), sources.function.name)

    def evaluate(self, arrays: list[Array], batch: tuple[int, ...]) -> tuple[Array, ...]:
        """Evaluate on checked arrays, many samples in blocks whose temporaries stay in the cache."""
        count = math.prod(batch)
        if count <= _BLOCK:
            result = self.generated(*arrays)
            return result if isinstance(result, tuple) else (result,)
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
            results = self.generated(
                *(
                    row if row.shape == signal.shape else row[block]
                    for row, signal in zip(rows, signals, strict=True)
                )
            )
            for output, result in zip(
                outputs, results if isinstance(results, tuple) else (results,), strict=True
            ):
                output[block] = result
        return tuple(output.reshape(batch + output.shape[1:]) for output in outputs)
