"""Runs a program operation by operation in one floating-point type, each result rounded to the nearest.

It is the reference for generated C in that type: without contraction to fused multiply-add, sums, products, quotients
and roots have the same bits. Sines and arc tangents are those of numpy.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from strapgen.ir.program import OPERATIONS, RESOLUTION, Program
from strapgen.ir.sources import Sources
from strapgen.run.evaluators import Array, Evaluator
from strapgen.run.kernel_sources import program_of
from strapgen.targets.c import CPrinter, real_of


def _sinc(x: Array) -> Array:
    safe = np.where(x == 0, np.ones_like(x), x)
    return np.where(x == 0, np.ones_like(x), np.sin(safe) / safe)


def _wrap(x: Array) -> Array:
    turn, half = (np.asarray(x).dtype.type(value) for value in (2 * np.pi, np.pi))
    return np.where(x > half, x - turn, np.where(x < -half, x + turn, x))


_OPERATIONS: Mapping[str, Callable[..., Any]] = {
    **OPERATIONS,
    "sqrt": np.sqrt,
    "sin": np.sin,
    "cos": np.cos,
    "sinc": _sinc,
    "atan2": np.arctan2,
    "direction": np.arctan2,
    "wrap": _wrap,
    "maximum": np.maximum,
    "select": np.where,
}
#: The operations that a library computes, in whose last places libraries differ.
LIBRARY_OPERATIONS = frozenset({"sin", "cos", "sinc", "atan2", "direction", "wrap"})


class ProgramEvaluator(Evaluator):
    """A program in the numbers of a target in C, "c" or "c-float".

    Examples
    --------
    >>> from strapgen.run.kernel_sources import sources_of_program
    >>> from strapgen.pipeline import derive, lower
    >>> program = lower(derive("euler-normalize"))
    >>> single = ProgramEvaluator(sources_of_program(program, "exact"), "c-float")
    >>> single(np.float32([1, 1, 1, 0]))
    array([0.57735026, 0.57735026, 0.57735026, 0.        ], dtype=float32)
    """

    def __init__(self, sources: Sources, target: str = "c") -> None:
        real = real_of(target)
        super().__init__(sources, np.dtype(real.name if real.name == "double" else "float32"))
        self.program: Program = program_of(sources)
        self._printer = CPrinter(real)
        self._target = target

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the class with the sources and the target."""
        return type(self), (self.sources, self._target)

    def _number(self, value: Any) -> Any:
        """Return the number that the C has for an exact constant."""
        return self.dtype.type(self._printer.constant(value).removesuffix(self._printer.real.suffix))

    def call(self, inputs: Sequence[Any], feedback: Any, where: str = "") -> tuple[Sequence[Any], Any]:
        """Evaluate on the columns of rows, see `Evaluator.call`."""
        values: dict[str, Any] = {RESOLUTION: self._number(self._printer.resolution)}
        for signal, rows in zip(self.function.inputs, inputs, strict=True):
            values |= zip(signal.elements, rows.T, strict=True)
        with np.errstate(all="ignore"):
            results = self.program.run(values, self._number, _OPERATIONS)
        outputs = []
        for signal in self.function.outputs:
            columns = [np.asarray(x, self.dtype) for x in results[signal.name]]
            outputs.append(np.stack([np.broadcast_to(x, len(feedback)) for x in columns], axis=-1))
        return outputs, feedback
