"""The fixed-point back ends: generated C on integers, and the integer model in Python.

Both convert every input to integers and refuse a number outside the range that the formats were chosen for.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.fixed_interface import Argument, Interface
from strapgen.ir.sources import Sources
from strapgen.run import compiler
from strapgen.run.evaluators import Array, Evaluator
from strapgen.run.fixed_numbers import Memory, array_type, fresh_feedback, integers, numbers
from strapgen.run.protocol import Backend
from strapgen.run.step_sources import StepSources

#: Orthonormalizations that leave the attitude where it is, but for rounding: one factor for all parameters, and for
#: matrices a symmetric expansion of the inverse root of C'C.
KEEP_THE_ATTITUDE = frozenset(
    (
        *("euler-normalize", "euler-normalize-first-order"),
        *("cayley-klein-normalize", "cayley-klein-normalize-first-order"),
        *("dcm-orthonormalize-first-order", "dcm-orthonormalize-second-order"),
    )
)

#: The orthonormalization that turns the attitude by a little: the scheme of dual rows.
DUAL_ROWS = "dcm-orthonormalize"


class FixedEvaluator(Evaluator):
    """A generated fixed-point function.

    Attributes
    ----------
    interface : Interface
        Formats, ranges and error bounds.
    """

    def __init__(self, sources: Sources) -> None:
        if sources.fixed is None:
            raise InputTypeError(
                f"sources of {sources.kernel} for {sources.target} have no fixed-point formats"
            )
        super().__init__(sources, np.float64)
        self.kernel = sources.kernel
        self.interface: Interface = sources.fixed
        self.integer_type: Any = object if self.interface.settings.word > 32 else np.int64

    def integers(self, argument: Argument, values: Any) -> Array:
        """Return numbers as the integers of an input, rounded to the nearest.

        Raises
        ------
        InputError
            If one lies outside the input's range.
        """
        return integers(argument, values, self.kernel)

    def numbers(self, argument: Argument, integers: Any) -> Array:
        """Return integers of an output as numbers."""
        return numbers(argument, integers)

    def evaluate(self, arrays: list[Array], batch: tuple[int, ...]) -> tuple[Array, ...]:
        """Evaluate on checked arrays of numbers."""
        count = int(np.prod(batch, dtype=int))
        inputs = []
        for argument, array in zip(self.interface.inputs, arrays, strict=True):
            shape = argument.signal.shape
            whole = np.broadcast_to(array, batch + shape).reshape(count, argument.signal.size)
            inputs.append(self.integers(argument, whole))
        outputs, _ = self.run(inputs, self.fresh(count))
        return tuple(
            self.numbers(argument, output).reshape(batch + argument.signal.shape)
            for argument, output in zip(self.interface.outputs, outputs, strict=True)
        )

    def fresh(self, count: int) -> Array:
        """Return the error feedback with which `count` independent runs begin, (count, number of words)."""
        return fresh_feedback(self.interface, count)

    @abstractmethod
    def run(self, inputs: Sequence[Array], feedback: Array) -> tuple[tuple[Array, ...], Array]:
        """Call the function on integers, see `Evaluator.run`."""

    def refused(self, status: int, where: str = "") -> InputError:
        """Return the error of a user's input that a status of the generated code stands for."""
        if status == 1:
            limits = ", ".join(
                f"{a.signal.name} up to {float(a.high * a.unit):.6g}" for a in self.interface.inputs
            )
            return InputError(
                f"{self.kernel} refuses its input{where}: its formats were chosen for {limits}; orthonormalize more "
                "often, or allow for a larger drift or rate"
            )
        return InputError(f"{self.kernel} refuses its input{where}: it is too far from a proper one")


class CFixedEvaluator(FixedEvaluator):
    """A generated C function on integers."""

    def __init__(self, sources: Sources) -> None:
        super().__init__(sources)
        word = self.interface.settings.word
        self.word_type, self.feedback_type = np.dtype(f"int{word}"), np.dtype(f"uint{word}")
        self.input_types = [np.dtype(f"int{argument.format.word}") for argument in self.interface.inputs]
        self.module = compiler.load(sources)
        self._array = getattr(self.module.lib, f"{sources.function.name}_array")

    def run(self, inputs: Sequence[Array], feedback: Array) -> tuple[tuple[Array, ...], Array]:
        """Call the function on integers, see `Evaluator.run`."""
        count = len(feedback)
        words = [
            np.ascontiguousarray(array, kind) for array, kind in zip(inputs, self.input_types, strict=True)
        ]
        feedback = np.array(feedback, self.feedback_type)
        outputs = tuple(np.empty((count, a.signal.size), self.word_type) for a in self.interface.outputs)
        status = self.module.ffi.new("int *")
        arrays = [*words, *([feedback] if self.interface.residuals else []), *outputs]
        done = self._array(count, status, *(self.pointer(array) for array in arrays))
        if status[0]:
            raise self.refused(status[0], f" (sample {done})" if count > 1 else "")
        return outputs, feedback

    def pointer(self, array: Array) -> Any:
        """Return the C pointer to a contiguous array's first element."""
        return self.module.ffi.from_buffer(array_type(array.dtype), array)

    def address(self) -> int:
        """Return the address of the function on one sample."""
        ffi = self.module.ffi
        return int(ffi.cast("uintptr_t", ffi.addressof(self.module.lib, self.function.name)))


class ModelEvaluator(FixedEvaluator):
    """A generated Python function on integers that checks the range of every value."""

    def __init__(self, sources: Sources) -> None:
        super().__init__(sources)
        module = compiler.load(sources)
        self.generated: Callable[..., Any] = getattr(module, sources.function.name)
        self.out_of_range: type[Exception] = module.OutOfRange

    def run(self, inputs: Sequence[Array], feedback: Array) -> tuple[tuple[Array, ...], Array]:
        """Call the function on integers, see `Evaluator.run`; those of one row are Python's own, which is faster."""
        count = len(feedback)
        rows = [*(array.astype(self.integer_type) for array in inputs), feedback]
        arguments = [row[0].tolist() if count == 1 else list(np.moveaxis(row, -1, 0)) for row in rows]
        results = [
            np.stack(
                [np.broadcast_to(np.asarray(element, self.integer_type), (count,)) for element in result],
                axis=-1,
            )
            for result in self.step(*(arguments if self.interface.residuals else arguments[:-1]))
        ]
        if self.interface.residuals:
            feedback = results.pop()
        return tuple(results), feedback

    def step(self, *arguments: Any, where: str = "") -> Any:
        """Call the generated function; a value out of range is raised as the error of a user's input."""
        try:
            return self.generated(*arguments)
        except self.out_of_range as error:
            raise InputError(f"{self.kernel} refuses its input{where}: {error}") from None


class FixedBackend(Backend):
    """Runs a step in fixed point."""

    def __init__(self, parts: StepSources, step: FixedEvaluator) -> None:
        super().__init__(parts, step)
        self.evaluator = step
        self.interface = step.interface
        self.unit = float(self.interface.outputs[0].format.unit)
        self.increment_unit = float(self.interface.inputs[1].unit)
        self.saturates = self.interface.outputs[0].saturates
        self.count = None if self.interface.inputs[1].sensor is None else self.increment_unit

    def rounding_bound(self, steps: int, rounded_inputs: bool = False) -> float | None:
        """Return the certified bound of a run's rounding, see `Backend.rounding_bound`; None without a transition.

        Where a state saturates, it holds as long as no element of the exact state exceeds 1 in magnitude.
        """
        accumulation = self.interface.accumulation
        return None if accumulation is None else accumulation.bound(steps, rounded_inputs)

    def angle_bound(
        self,
        steps: int,
        rounded_inputs: bool = False,
        orthonormalize_every: int = 0,
        shortest: float = 0.0,
    ) -> float | None:
        """Return the certified bound of the angle by which rounding turns the attitude, see `Backend.angle_bound`."""
        angles, count, error, dual_rows = self.interface.angle_accumulation, 0, Fraction(0), False
        if angles is None:
            return None
        if (orthonormalize_every or steps) > angles.proved_steps and shortest < angles.shortest:
            return None
        if orthonormalize_every:
            kernel = self._need_orthonormalization()
            dual_rows = kernel == DUAL_ROWS
            if not (
                kernel in KEEP_THE_ATTITUDE or (dual_rows and orthonormalize_every <= angles.dual_rows_apart)
            ):
                return None
            count = steps // orthonormalize_every
            error = max(self.beside(kernel).interface.outputs[0].errors)
        bound = angles.bound(steps, count, error, rounded_inputs, dual_rows)
        return bound if math.isfinite(bound) else None

    @abstractmethod
    def beside(self, kernel: str) -> FixedEvaluator:
        """Return another kernel in fixed point, see `Backend.beside`."""

    def representable(self, increments: Any) -> Array:
        """Return increments rounded to the input's format."""
        argument = self.interface.inputs[1]
        return self.evaluator.numbers(argument, self.evaluator.integers(argument, increments))

    def prepared(self, increments: Any) -> Callable[[], Any]:
        """Return a call that propagates integers, see `Backend.prepared`."""
        state, samples = self.interface.inputs
        rows = np.asarray(increments).reshape(1, -1, samples.signal.size)
        words = self.evaluator.integers(samples, rows)
        start = self.evaluator.integers(state, self.identity.reshape(1, -1))
        return lambda: self.propagate_integers(words, 1, 0, self._begun(start))

    def _begun(self, states: Array) -> Memory:
        """Return what runs begin with, from integers (runs, elements)."""
        return Memory(states, self.evaluator.fresh(len(states)))

    def _propagate(
        self, increments: Array, record_every: int, orthonormalize_every: int, initial: Array
    ) -> Array:
        runs, steps = increments.shape[:2]
        state, samples = self.interface.inputs
        history = self.propagate_integers(
            self.evaluator.integers(samples, increments.reshape(runs, steps, samples.signal.size)),
            record_every,
            orthonormalize_every,
            self._begun(self.evaluator.integers(state, initial.reshape(runs, state.signal.size))),
        )
        return self.evaluator.numbers(state, history).reshape(*history.shape[:2], *self.state_shape)

    def _continue(
        self, increments: Array, orthonormalize_every: int, memory: Any, first: int
    ) -> tuple[Array, Any]:
        state, samples = self.interface.inputs
        rows = increments.reshape(1, -1, samples.signal.size)
        memory = replace(memory, first=first)
        words = self.evaluator.integers(samples, rows)
        history = self.propagate_integers(words, 1, orthonormalize_every, memory)
        states = self.evaluator.numbers(state, history[0, 1:]).reshape(-1, *self.state_shape)
        return states, replace(memory, state=history[:, -1])

    def _memory(self, initial: Array) -> Memory:
        state = self.interface.inputs[0]
        return self._begun(self.evaluator.integers(state, initial.reshape(1, -1)))

    @abstractmethod
    def propagate_integers(
        self, increments: Array, record_every: int, orthonormalize_every: int, memory: Memory
    ) -> Array:
        """Propagate integers.

        Parameters
        ----------
        increments : array, (runs, N, elements of the increments)
        record_every, orthonormalize_every : int
            As for `propagate`; 0 for never.
        memory : Memory
            What the steps before have handed on; its error feedback becomes that after these steps.

        Returns
        -------
        array, (runs, 1 + N // record_every, elements of the state)
        """


class CFixedBackend(FixedBackend):
    """Runs generated fixed-point C."""

    def __init__(self, parts: StepSources) -> None:
        step = CFixedEvaluator(parts.step)
        super().__init__(parts, step)
        self.name = f"{self.sources.target}{self.interface.settings.word}"
        self._c = step
        self._function = self.sources.function.name
        self._generated = getattr(step.module.lib, f"{self._function}_propagate")

    def beside(self, kernel: str) -> CFixedEvaluator:
        """Return another kernel in fixed-point C, see `Backend.beside`."""
        return CFixedEvaluator(self._sources(kernel))

    def propagate_integers(
        self, increments: Array, record_every: int, orthonormalize_every: int, memory: Memory
    ) -> Array:
        """Propagate integers in C."""
        runs, steps = increments.shape[:2]
        ffi, kind = self._c.module.ffi, self._c.word_type
        words = [
            np.ascontiguousarray(array, memory)
            for array, memory in zip((memory.state, increments), self._c.input_types, strict=True)
        ]
        feedback = memory.feedback.astype(self._c.feedback_type)
        history = np.empty((runs, 1 + steps // record_every, memory.state.shape[-1]), kind)
        orthonormalizer = ffi.NULL
        if orthonormalize_every:
            address = self.beside(self._need_orthonormalization()).address()
            orthonormalizer = ffi.cast(f"{self._function}_orthonormalizer", address)
        stopped = ffi.new("size_t[2]")
        arrays = [*words, *([feedback] if self.interface.residuals else []), history]
        status = self._generated(
            runs,
            steps,
            record_every,
            orthonormalize_every,
            orthonormalizer,
            *(self._c.pointer(array) for array in arrays),
            stopped,
        )
        if status:
            where = f" in step {memory.first + stopped[1] + 1}" + (
                f" of run {stopped[0] + 1}" if runs > 1 else ""
            )
            raise self.evaluator.refused(status, where)
        memory.feedback[...] = feedback.astype(memory.feedback.dtype)
        return history


class ModelBackend(FixedBackend):
    """Runs the integer model: independent runs side by side in numpy, a single run on Python's own integers."""

    def __init__(self, parts: StepSources) -> None:
        self._model = ModelEvaluator(parts.step)
        super().__init__(parts, self._model)

    def beside(self, kernel: str) -> ModelEvaluator:
        """Return another kernel in the integer model, see `Backend.beside`."""
        return ModelEvaluator(self._sources(kernel))

    def propagate_integers(
        self, increments: Array, record_every: int, orthonormalize_every: int, memory: Memory
    ) -> Array:
        """Propagate integers in Python, see `FixedBackend.propagate_integers`."""
        normalize = self.beside(self._need_orthonormalization()) if orthonormalize_every else None
        runs, steps = increments.shape[:2]
        single = runs == 1
        feedback: list[Any]
        if single:
            state, feedback = memory.state[0].tolist(), memory.feedback[0].tolist()
            samples = increments[0].tolist()
        else:
            state = list(np.moveaxis(memory.state, -1, 0))
            samples = np.moveaxis(increments.astype(self._model.integer_type), 0, -1)
            feedback = list(np.moveaxis(memory.feedback, -1, 0))
        records = [state]
        for number in range(steps):
            where = f" in step {memory.first + number + 1}"
            state, feedback = _stepped(self._model, [state, list(samples[number])], feedback, where)
            if normalize is not None and (number + 1) % orthonormalize_every == 0:
                # The first words of the step's feedback are those of its state.
                count = len(normalize.interface.residuals)
                state, first = _stepped(normalize, [state], feedback[:count], where)
                feedback = [*first, *feedback[count:]]
            if (number + 1) % record_every == 0:
                records.append(state)
        memory.feedback[...] = np.stack(np.broadcast_arrays(*feedback), axis=-1) if feedback else 0
        if single:
            return np.array(records, self._model.integer_type)[None]
        return np.stack([np.stack(np.broadcast_arrays(*record), axis=-1) for record in records], axis=1)


def _stepped(
    model: ModelEvaluator, arguments: list[Any], feedback: list[Any], where: str
) -> tuple[Any, list[Any]]:
    """Call a function of one output; return the output and the error feedback, empty where there is none."""
    if feedback:
        state, feedback = model.step(*arguments, feedback, where=where)
    else:
        (state,) = model.step(*arguments, where=where)
    return state, feedback
