"""Runs the integer model of fixed point, which checks the range of every value in Python."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from strapgen.ir.exceptions import InputError
from strapgen.ir.sources import Sources
from strapgen.run import compiler
from strapgen.run.evaluators import Array, Evaluator


class ModelEvaluator(Evaluator):
    """A generated Python function on integers that checks the range of every value."""

    def __init__(self, sources: Sources) -> None:
        super().__init__(sources, np.float64)
        self._carries = bool(self.interface.residuals)
        module = compiler.load(sources)
        self.generated: Callable[..., Any] = getattr(module, self.function.name)
        self.out_of_range: type[Exception] = module.OutOfRange

    def pack(self, rows: Array) -> Any:
        """Return the elements of rows; those of one row are Python's own integers, which are faster."""
        return rows[0].tolist() if len(rows) == 1 else [*rows.astype(self.number, copy=False).T]

    def unpack(self, packed: Any, count: int) -> Array:
        """Return elements as rows, see `Evaluator.unpack`."""
        if count == 1:
            return np.array([packed], self.number)
        rows = np.empty((count, len(packed)), self.number)
        for place, element in enumerate(packed):
            rows[:, place] = element
        return rows

    def call(self, inputs: Sequence[Any], feedback: Any, where: str = "") -> tuple[Sequence[Any], Any]:
        """Call the function on the elements of rows, see `Evaluator.call`."""
        if not self._carries:
            return self.step(*inputs, where=where), feedback
        *outputs, after = self.step(*inputs, feedback, where=where)
        return outputs, after

    def step(self, *arguments: Any, where: str = "") -> Any:
        """Call the generated function; a value out of range is raised as the error of a user's input."""
        try:
            return self.generated(*arguments)
        except self.out_of_range as error:
            raise InputError(f"{self.kernel} refuses its input{where}: {error}") from None
