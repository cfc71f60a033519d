"""Evaluators let Python call any kernel on arrays; each kind of generated code has a subclass of `Evaluator`."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import checks
from strapgen.ir.checks import counted, needed
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import DEFAULT_ALLOWANCE
from strapgen.ir.interfaces import Argument, Interface
from strapgen.ir.notebook_display import counted_shape, short_repr
from strapgen.ir.sources import Function, Sources
from strapgen.run.orders import SEQUENTIAL

Array = NDArray[Any]


@dataclass(frozen=True)
class Loop:
    """Start, schedule and kernels of a loop over steps, in the numbers of the code."""

    state: Array  # at the start, (runs, elements)
    feedback: Array  # error feedback of the steps before, (runs, number of words)
    first: int = 0  # steps before these
    record_every: int = 1  # steps
    restore_every: int = 0  # steps from orthonormalization to orthonormalization; 0 for never
    restore: Evaluator | None = None  # orthonormalizes, where that happens
    product: Evaluator | None = (
        None  # state after a transition, if the class `needs_product` and there is one
    )
    jobs: int = 1  # threads
    order: str = SEQUENTIAL  # in which the steps are multiplied, one of `ORDERS`
    out: Array | None = None  # memory for the history, if the caller gives it

    def room(self, shape: tuple[int, ...], number: np.dtype[Any]) -> Array:
        """Return memory for a history: that of the caller, if its numbers are those of the code."""
        if self.out is not None and self.out.dtype == number:
            return self.out.reshape(shape)
        return np.empty(shape, number)


class Evaluator(ABC):
    """A kernel as a callable on arrays of samples.

    It can be pickled: its copy in another process is built from the same sources.

    Parameters
    ----------
    sources : Sources
        Sources of the kernel, for the target that the class runs.
    dtype : dtype
        Type of the results.

    Attributes
    ----------
    function : Function
        Name, inputs and outputs of the function.
    interface : Interface
        Formats, ranges and error bounds; an attribute in fixed point alone.

    Examples
    --------
    >>> from strapgen import evaluator
    >>> evaluator("dcm-from-euler")([0.0, 0.0, 0.0, 1.0]).shape
    (3, 3)
    """

    #: Whether its loop takes the product of transitions.
    needs_product = False
    #: Whether its loop has the order "scan" beside the default one.
    scans = False
    interface: Interface

    __repr__ = short_repr

    def _in_words(self) -> str:
        ins = ", ".join(f"{signal.name} ({counted_shape(signal.shape)})" for signal in self.function.inputs)
        outs = ", ".join(f"{signal.name} ({counted_shape(signal.shape)})" for signal in self.function.outputs)
        return f"{self.sources.kernel} for {self.sources.target}\n{ins} -> {outs}"

    def __init__(self, sources: Sources, dtype: Any) -> None:
        self.sources = sources
        self.kernel: str = sources.kernel
        self.function: Function = sources.function
        self.dtype: np.dtype[Any] = np.dtype(dtype)
        self._shapes = [signal.shape for signal in self.function.inputs]
        self._has_limits = any(signal.limit is not None for signal in self.function.inputs)
        #: Type of the numbers that `run` takes and returns: an object is one of mpmath.
        self.number: np.dtype[Any] = self.dtype
        if sources.fixed is not None:
            self.interface = sources.fixed
            self.number = np.dtype(object if sources.fixed.settings.word > 32 else np.int64)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the class and the sources, from which another process builds the same evaluator."""
        return type(self), (self.sources,)

    @property
    def name(self) -> str:
        """Name of the back end."""
        return self.sources.target

    @property
    def spreads_nonfinite(self) -> bool:
        """Whether no state after a sample that is not finite is finite, so that the last one tells of it."""
        return False

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
        for place, array in enumerate(arrays):
            self.check_limit(place, array)
        leading = [a.shape[: a.ndim - len(s.shape)] for a, s in zip(arrays, signals, strict=True)]
        try:
            batch = np.broadcast_shapes(*leading)
        except ValueError:
            shapes = ", ".join(f"{s.name} {a.shape}" for s, a in zip(signals, arrays, strict=True))
            raise InputError(f"the leading axes of {shapes} do not broadcast together") from None
        results = self.evaluate(arrays, batch)
        return results[0] if len(results) == 1 else results

    def one_sample(self, values: Sequence[Any]) -> bool:
        """Return whether inputs are arrays of `dtype` that hold one sample within its range, finite or not.

        A subclass may call its code on such at once, if they are finite; `__call__` checks and converts all others.
        """
        if len(values) != len(self._shapes):
            return False
        dtype = self.dtype
        for value, shape in zip(values, self._shapes):  # noqa: B905  # checked above, at less cost
            if type(value) is not np.ndarray or value.shape != shape or value.dtype != dtype:
                return False
        return not self._has_limits or self._within_limits(values)

    def _within_limits(self, values: Sequence[Array]) -> bool:
        try:
            for place, value in enumerate(values):
                self.check_limit(place, value)
        except InputError:
            return False
        return True

    def evaluate(self, arrays: Sequence[Array], batch: tuple[int, ...]) -> tuple[Array, ...]:
        """Evaluate on checked arrays whose leading axes broadcast to `batch`."""
        count = math.prod(batch)
        rows = []
        for place, (array, signal) in enumerate(zip(arrays, self.function.inputs, strict=True)):
            shape = batch + signal.shape
            whole = array if array.shape == shape else np.broadcast_to(array, shape)
            rows.append(self.stored(place, whole.reshape(count, signal.size)))
        outputs, _ = self.run(rows, self.fresh(count))
        return tuple(
            self.in_si(place, output).reshape(batch + signal.shape)
            for place, (output, signal) in enumerate(zip(outputs, self.function.outputs, strict=True))
        )

    def check_limit(self, place: int, values: Array) -> None:
        """Refuse values of an input, by its place, beyond the range that was declared for its code."""
        signal = self.function.inputs[place]
        if signal.limit is None or not values.size:
            return
        most = float(max(values.max(), -values.min()))
        if most > signal.limit:
            raise InputError(
                f"{signal.name} holds {most:.9g}; {self.kernel} was generated for at most "
                f"{float(signal.limit):.9g} in magnitude"
            )

    def stored(self, place: int, values: Any) -> Array:
        """Return values of an input, by its place, in the numbers that `run` takes."""
        fixed = self.sources.fixed
        return stored(values, self.number, fixed.inputs[place] if fixed else None, self.kernel)

    def in_si(self, place: int, values: Array) -> Array:
        """Return values of an output, by its place, from the numbers that `run` returns."""
        fixed = self.sources.fixed
        return in_si(values, fixed.outputs[place] if fixed else None)

    def integers(self, argument: Argument, values: Any) -> Array:
        """Return numbers as integers of an input in fixed point, rounded to the nearest, if they lie in its range."""
        return integers(argument, values, self.kernel)

    def numbers(self, argument: Argument, integers: Any) -> Array:
        """Return integers of an argument in fixed point as numbers."""
        return numbers(argument, integers)

    def fresh(self, count: int) -> Array:
        """Return the error feedback with which `count` independent runs begin, (count, number of words).

        There is none but in fixed point, where words can hold what rounding left over.
        """
        return fresh_feedback(self.sources.fixed, count)

    def run(self, inputs: Sequence[Array], feedback: Array) -> tuple[Sequence[Array], Array]:
        """Evaluate the kernel once for each row, in the numbers that its code computes with.

        Parameters
        ----------
        inputs : sequence of array, (count, size)
            The inputs in order: integers in fixed point, numbers of `number` in floating point.
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
        outputs, after = self.call([self.pack(rows) for rows in inputs], self.pack(feedback))
        return [self.unpack(output, len(feedback)) for output in outputs], self.unpack(after, len(feedback))

    def pack(self, rows: Array) -> Any:
        """Return rows as `call` takes them."""
        return rows

    def unpack(self, packed: Any, count: int) -> Array:
        """Return the result of `call` as `count` rows."""
        rows: Array = packed
        return rows

    @abstractmethod
    def call(self, inputs: Sequence[Any], feedback: Any, where: str = "") -> tuple[Sequence[Any], Any]:
        """Call the code, see `run`; a refusal says where."""

    def loop(self, samples: Array, loop: Loop) -> tuple[Array, Array]:
        """Run a step of one state, whose first input and output it is, over the samples of its second input.

        Parameters
        ----------
        samples : array, (runs, N, elements)
        loop : Loop

        Returns
        -------
        history : array, (runs, 1 + N // record_every, elements of the state)
        feedback : array, (runs, number of words)
        """
        runs, steps = samples.shape[:2]
        history = loop.room((runs, 1 + steps // loop.record_every, loop.state.shape[1]), self.number)
        history[:, 0] = loop.state
        state, feedback = self.pack(loop.state), self.pack(loop.feedback)
        # The first words of the step's feedback are those of its state.
        words = loop.restore.fresh(1).shape[1] if loop.restore else 0
        for number in range(1, steps + 1):
            where = f" in step {loop.first + number}"
            (state,), feedback = self.call([state, self.pack(samples[:, number - 1])], feedback, where)
            if loop.restore and loop.restore_every and number % loop.restore_every == 0:
                (state,), first = loop.restore.call([state], feedback[:words] if words else feedback, where)
                feedback = [*first, *feedback[words:]] if words else feedback
            if number % loop.record_every == 0:
                history[:, number // loop.record_every] = self.unpack(state, runs)
        return history, self.unpack(feedback, runs)


def stored(values: Any, number: Any, argument: Argument | None = None, kernel: str = "") -> Array:
    """Return values in SI units as code stores them: integers of an argument, or numbers of a type."""
    if argument is not None:
        return integers(argument, values, kernel)
    if np.dtype(number).kind == "O":
        import mpmath  # which most runs do without

        doubles = np.asarray(values, np.float64)
        digits = np.empty(doubles.size, object)
        digits[:] = [mpmath.mpf(value) for value in doubles.ravel().tolist()]
        return digits.reshape(doubles.shape)
    if isinstance(values, np.ndarray) and values.dtype == number:
        return np.ascontiguousarray(values)
    with np.errstate(over="ignore"):  # what overflows is refused after the run
        array: Array = np.ascontiguousarray(values, number)
    return array


def in_si(values: Array, argument: Argument | None = None) -> Array:
    """Return stored numbers in SI units; numbers of mpmath are rounded to double."""
    if argument is not None:
        return numbers(argument, values)
    return values.astype(np.float64) if values.dtype.kind == "O" else values


@np.errstate(all="ignore")  # numbers that overflow are refused, in one line
def integers(argument: Argument, values: Any, kernel: str) -> Array:
    """Return numbers as the integers of an input, rounded to the nearest, if they lie in its range."""
    scaled = np.rint(in_units(argument, np.asarray(values, np.float64)))
    if argument.saturates:  # as a number that is rounded to the format
        near = np.abs(scaled) <= 2.0**argument.format.fraction * (1 + float(DEFAULT_ALLOWANCE))
        scaled = np.where(near, np.clip(scaled, argument.low, argument.high), scaled)
    outside = (scaled < argument.low) | (scaled > argument.high)
    if outside.any():
        worst = float(np.asarray(values)[outside].flat[0])
        limit = float(argument.high * argument.unit)
        raise InputError(
            f"{argument.signal.name} holds {worst:.9g}; the formats of {kernel} were chosen for at most "
            f"{limit:.9g} in magnitude"
        )
    whole = scaled.astype(np.int64)
    return whole.astype(object) if argument.format.word > 32 else whole


def numbers(argument: Argument, integers: Any) -> Array:
    """Return integers of an input or output as numbers."""
    whole = np.asarray(integers).astype(np.float64)
    if argument.sensor is not None:
        return np.asarray(whole * float(argument.unit))
    return np.ldexp(whole, -argument.format.fraction)


def in_units(argument: Argument, values: Array) -> Array:
    """Return numbers in units of an argument, not rounded yet."""
    if argument.sensor is not None:
        return np.asarray(values / float(argument.unit))
    return np.asarray(np.ldexp(values, argument.format.fraction))


def fresh_feedback(interface: Interface | None, count: int) -> Array:
    """Return the error feedback with which `count` independent runs begin, (count, number of words)."""
    if interface is None:
        return np.empty((count, 0))
    kind: Any = object if interface.settings.word > 32 else np.int64
    return np.tile(np.array([word.fresh for word in interface.residuals], kind), (count, 1))
