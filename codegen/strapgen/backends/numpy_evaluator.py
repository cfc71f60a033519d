"""The evaluator for generated numpy functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from strapgen.backends.evaluators import Array, Evaluator
from strapgen.ir.sources import Sources
from strapgen.toolchain import compiler


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
        """Evaluate on checked arrays."""
        result = self.generated(*arrays)
        return result if isinstance(result, tuple) else (result,)
