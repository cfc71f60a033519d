"""Evaluators let Python call any kernel on arrays; each kind of generated code has a subclass of `Evaluator`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import counted_shape, short_repr
from strapgen.ir.sources import Sources
from strapgen.ir.suggestions import counted, needed

Array = NDArray[Any]


class StepInWords:
    """What a back end of a step shows of itself."""

    name: str
    kernel: str
    samples: int
    takes: str
    state_shape: tuple[int, ...]
    dtype: Any

    __repr__ = short_repr

    def _in_words(self) -> str:
        state = f"state {counted_shape(self.state_shape)} {self.dtype}"
        return f"{self.name}: {self.kernel}, {self.samples} {self.takes} a step, {state}"


class Evaluator(ABC):
    """A kernel as a callable on arrays of samples.

    It can be pickled: its copy in another process is built from the same sources.

    Parameters
    ----------
    sources : Sources
        Sources of the kernel, for the target that the class runs.
    dtype : dtype
        Type of the results.
    """

    __repr__ = short_repr

    def _in_words(self) -> str:
        ins = ", ".join(f"{signal.name} ({counted_shape(signal.shape)})" for signal in self.function.inputs)
        outs = ", ".join(f"{signal.name} ({counted_shape(signal.shape)})" for signal in self.function.outputs)
        return f"{self.sources.kernel} for {self.sources.target}\n{ins} -> {outs}"

    def __init__(self, sources: Sources, dtype: Any) -> None:
        self.sources = sources
        self.function = sources.function
        self.dtype = np.dtype(dtype)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the class and the sources, from which another process builds the same evaluator."""
        return type(self), (self.sources,)

    def __call__(self, *values: Any) -> Any:
        """Evaluate the kernel.

        Parameters
        ----------
        *values : array_like
            The inputs in order, each (..., shape of the signal); leading axes broadcast.

        Returns
        -------
        array or tuple of array
            The outputs.

        Raises
        ------
        InputError, InputTypeError
            If the number of inputs, a shape, a dtype or a value does not fit.
        """
        signals = self.function.inputs
        if len(values) != len(signals):
            names = ", ".join(signal.name for signal in signals)
            raise InputError(
                f"{self.function.name} got {counted(len(values), 'input')}; {needed(len(signals))}: {names}"
            )
        arrays = [
            checks.real_array(signal.name, value, signal.shape, self.dtype)
            for signal, value in zip(signals, values, strict=True)
        ]
        leading = [a.shape[: a.ndim - len(s.shape)] for a, s in zip(arrays, signals, strict=True)]
        try:
            batch = np.broadcast_shapes(*leading)
        except ValueError:
            shapes = ", ".join(f"{s.name} {a.shape}" for s, a in zip(signals, arrays, strict=True))
            raise InputError(f"the leading axes of {shapes} do not broadcast together") from None
        results = self.evaluate(arrays, batch)
        return results[0] if len(results) == 1 else results

    @abstractmethod
    def evaluate(self, arrays: list[Array], batch: tuple[int, ...]) -> tuple[Array, ...]:
        """Evaluate on checked arrays whose leading axes broadcast to `batch`."""

    def fresh(self, count: int) -> Array:
        """Return the error feedback with which `count` independent runs begin, (count, number of words).

        There is none but in fixed point, where words can hold what rounding left over.
        """
        return np.empty((count, 0))

    def run(self, inputs: Sequence[Array], feedback: Array) -> tuple[Sequence[Array], Array]:
        """Evaluate the kernel once for each row, in the numbers that its code computes with.

        Parameters
        ----------
        inputs : sequence of array, (count, size)
            The inputs in order: integers in fixed point, numbers of `dtype` in floating point.
        feedback : array, (count, number of words)
            Error feedback of the call before, at first `fresh`.

        Returns
        -------
        outputs : sequence of array, (count, size)
        feedback : array, (count, number of words)

        Raises
        ------
        InputError
            If the code refuses its inputs.
        """
        count = len(feedback)
        shaped = [
            array.reshape(count, *signal.shape)
            for array, signal in zip(inputs, self.function.inputs, strict=True)
        ]
        outputs = self.evaluate(shaped, (count,))
        return [
            np.asarray(output).reshape(count, signal.size)
            for output, signal in zip(outputs, self.function.outputs, strict=True)
        ], feedback
