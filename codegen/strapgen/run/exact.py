"""The exact back end: programs in arithmetic of 40 digits, the reference for what rounding does on the others.

Nothing is generated: the back end interprets the lowered program of a kernel on numbers of mpmath. Inputs are the exact
numbers that doubles are, and results are rounded to double at the end; methods with `digits` in their names take and
return all digits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from fractions import Fraction
from functools import cache
from typing import Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.ir import checks, stage_arguments
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.program import OPERATIONS, Program
from strapgen.ir.sources import Sources
from strapgen.run.evaluators import Array, Evaluator
from strapgen.run.kernel_sources import program_of, sources_of_choice, sources_of_program
from strapgen.run.protocol import Backend
from strapgen.run.step_sources import StepSources

#: Decimal digits of the arithmetic, of which a million steps lose six.
DIGITS = 40
#: Name of the target in the table of back ends; no text is generated for it.
_TARGET = "exact"


def _sqrt(x: Any) -> Any:
    """Return the square root; like floating point, not a number below zero."""
    return mpmath.sqrt(x) if x >= 0 else mpmath.nan


#: The functions of programs on numbers of mpmath, roots apart.
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sin": mpmath.sin,
    "cos": mpmath.cos,
    "sinc": mpmath.sinc,
    "atan2": mpmath.atan2,
    "direction": mpmath.atan2,
    "wrap": lambda x: x - 2 * mpmath.pi * (int(x > mpmath.pi) - int(x < -mpmath.pi)),
}
_OPERATIONS: dict[str, Callable[..., Any]] = {**OPERATIONS, "sqrt": _sqrt, **FUNCTIONS}


def number(value: Fraction) -> Any:
    """Return a fraction in the digits that mpmath is set to."""
    return mpmath.mpf(value.numerator) / value.denominator


class Interpreter:
    """Runs a program on numbers of mpmath, whose precision the caller sets.

    Parameters
    ----------
    program : Program

    Examples
    --------
    >>> from strapgen import derive, lower
    >>> with mpmath.workdps(DIGITS):
    ...     state = Interpreter(lower(derive("euler-normalize")))([mpmath.mpf(x) for x in (1, 2, 4, 2)])
    >>> float(state[2])
    0.8
    """

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"of {self.program.kernel}"

    def __init__(self, program: Program) -> None:
        self.program = program
        self._constants: dict[Fraction, Any] = {}

    def __call__(self, *inputs: Iterable[Any]) -> list[Any]:
        """Return the elements of the last output, from the elements of every input."""
        return list(self.outputs(*inputs).values())[-1]

    def outputs(self, *inputs: Iterable[Any]) -> dict[str, list[Any]]:
        """Return the elements of every output by its name, from the elements of every input."""
        values: dict[str, Any] = {}
        for signal, elements in zip(self.program.inputs, inputs, strict=True):
            values |= zip(signal.elements, elements, strict=True)
        return self.program.run(values, self._constant, _OPERATIONS)

    def _constant(self, value: Fraction) -> Any:
        if value not in self._constants:
            self._constants[value] = number(value)
        return self._constants[value]


def states(program: Program, increments: Iterable[Sequence[Any]], initial: Sequence[Any]) -> list[list[Any]]:
    """Return all states of a run in the digits that mpmath is set to, the initial one first.

    Parameters
    ----------
    program : Program
        An attitude step.
    increments : iterable of sequence of mpf
        Angle increments of each step, row-major.
    initial : sequence of mpf
        The first state, row-major.
    """
    step = Interpreter(program)
    history = [list(initial)]
    for row in increments:
        history.append(step(history[-1], row))
    return history


def propagate(program: Program, increments: Any, initial: Any = None) -> NDArray[np.float64]:
    """Run a step over increments in 40 digits.

    Parameters
    ----------
    program : Program
        An attitude step.
    increments : array_like, (N, K, 3)
        Angle increments in rad, the exact numbers that the doubles are.
    initial : array_like, (state shape), optional
        State at the start, by default zero rotation.

    Returns
    -------
    array, (1 + N, state shape)
        All states, rounded to double at the end.

    Raises
    ------
    InputError, InputTypeError
        If the program is no attitude step, or a shape or a value does not fit.

    Examples
    --------
    >>> from strapgen import derive, lower
    >>> propagate(lower(derive("euler")), np.full((2, 2, 3), 0.01))[-1].round(6)
    array([0.019996, 0.019996, 0.019996, 0.9994  ])
    """
    stage_arguments.require("propagate", program, Program)
    backend = ExactBackend(StepSources(sources_of_program(program, _TARGET)))
    return backend.propagate(checks.numbers("increments", increments), initial=initial)


def interpreter(name: str, step: Program | None = None) -> Interpreter:
    """Return the interpreter of a kernel by name: one that a step brings, or of the catalogue."""
    programs = () if step is None else step.own
    return Interpreter(next((one for one in programs if one.kernel == name), None) or _program(name))


@cache
def _program(name: str) -> Program:
    return pipeline.program(Choice(name))


def in_digits(values: Any) -> Array:
    """Return doubles as numbers of mpmath, in an array of the same shape."""
    doubles = np.asarray(values, np.float64)
    numbers = np.empty(doubles.size, object)
    numbers[:] = [mpmath.mpf(value) for value in doubles.ravel().tolist()]
    return numbers.reshape(doubles.shape)


def rounded(numbers: Any) -> Array:
    """Return numbers of mpmath rounded to double, in an array of the same shape."""
    return np.asarray(numbers, object).astype(np.float64)


class ExactEvaluator(Evaluator):
    """A kernel in 40 digits: doubles go in, and doubles come out."""

    def __init__(self, sources: Sources) -> None:
        super().__init__(sources, np.float64)
        self.digits = Interpreter(program_of(sources))

    def evaluate(self, arrays: list[Array], batch: tuple[int, ...]) -> tuple[Array, ...]:
        """Evaluate on checked arrays."""
        count = int(np.prod(batch, dtype=int))
        rows = [
            in_digits(np.broadcast_to(array, batch + signal.shape).reshape(count, signal.size))
            for array, signal in zip(arrays, self.function.inputs, strict=True)
        ]
        outputs, _ = self.run(rows, self.fresh(count))
        return tuple(
            rounded(output).reshape(batch + signal.shape)
            for output, signal in zip(outputs, self.function.outputs, strict=True)
        )

    def run(self, inputs: Sequence[Array], feedback: Array) -> tuple[Sequence[Array], Array]:
        """Evaluate the kernel once for each row of numbers of mpmath, see `Evaluator.run`."""
        outputs = [np.full((len(feedback), s.size), mpmath.nan, object) for s in self.function.outputs]
        with mpmath.workdps(DIGITS):
            for place in range(len(feedback)):
                # A division by zero leaves its outputs at not a number, as in floating point.
                with suppress(ZeroDivisionError):
                    results = self.digits.outputs(*(rows[place] for rows in inputs))
                    for output, elements in zip(outputs, results.values(), strict=True):
                        output[place] = elements
        return outputs, feedback


class ExactBackend(Backend):
    """Runs the program of a step in 40 digits; states are rounded to double at the end of a run."""

    def __init__(self, parts: StepSources) -> None:
        step = ExactEvaluator(parts.step)
        super().__init__(parts, step)
        self._digits = step.digits
        self._start = parts.step_kernels.identity

    @classmethod
    def of_choice(cls, choice: Choice) -> ExactBackend:
        """Return a chosen attitude step."""
        return cls(StepSources(sources_of_choice(choice, _TARGET), choice))

    def beside(self, kernel: str) -> ExactEvaluator:
        """Return another kernel in 40 digits, see `Backend.beside`."""
        return ExactEvaluator(self._sources(kernel))

    def states_in_digits(
        self,
        increments: Iterable[Sequence[Any]],
        initial: Sequence[Any] | None = None,
        restore_every: int = 0,
    ) -> Iterator[list[Any]]:
        """Yield the states of a run with all digits, the initial one first.

        The caller sets the precision of mpmath to `DIGITS`.

        Parameters
        ----------
        increments : iterable of sequence of mpf
            Angle increments of each step in rad, row-major.
        initial : sequence of mpf, optional
            State at the start, row-major; by default zero rotation.
        restore_every : int, optional
            Steps from orthonormalization to orthonormalization; 0 for never.

        Yields
        ------
        list of mpf
            A state, row-major.
        """
        restore = self.beside(self._need_orthonormalization()).digits if restore_every else None
        state = [number(value) for value in self._start] if initial is None else list(initial)
        yield state
        for count, row in enumerate(increments, 1):
            state = self._digits(state, row)
            if restore is not None and count % restore_every == 0:
                state = restore(state)
            yield state

    def attitude_in_digits(self) -> Callable[[Sequence[Any]], Sequence[Any]]:
        """Return the function that converts a state to the elements of its matrix, row by row, with all digits."""
        return (lambda state: state) if self.attitude is None else self.beside(self.attitude).digits

    def _propagate(
        self, increments: Array, record_every: int, orthonormalize_every: int, initial: Array
    ) -> Array:
        runs, steps = increments.shape[:2]
        history = np.full((runs, 1 + steps // record_every, initial[0].size), np.nan)
        with mpmath.workdps(DIGITS):
            for run, records in enumerate(history):
                rows = in_digits(increments[run].reshape(steps, 3 * self.samples))
                start = list(in_digits(initial[run].ravel()))
                # From a division by zero on, states are not numbers, as in floating point.
                with suppress(ZeroDivisionError):
                    for count, state in enumerate(self.states_in_digits(rows, start, orthonormalize_every)):
                        if count % record_every == 0:
                            records[count // record_every] = rounded(state)
        return history.reshape(*history.shape[:2], *self.state_shape)

    def _continue(
        self, increments: Array, orthonormalize_every: int, memory: Any, first: int
    ) -> tuple[Array, Any]:
        states = np.full((len(increments), self.identity.size), np.nan)
        if memory == []:  # a division by zero: from there on, states are not numbers
            return states.reshape(-1, *self.state_shape), memory
        with mpmath.workdps(DIGITS):
            rows = in_digits(increments.reshape(-1, 3 * self.samples))
            try:
                for count, state in enumerate(self.states_in_digits(rows, memory, orthonormalize_every)):
                    memory = state
                    if count:
                        states[count - 1] = rounded(state)
            except ZeroDivisionError:
                memory = []
        return states.reshape(-1, *self.state_shape), memory

    def _memory(self, initial: Array) -> Any:
        with mpmath.workdps(DIGITS):
            return list(in_digits(initial.ravel()))

    def _kernels(self) -> list[tuple[str | None, str]]:
        return [*super()._kernels(), (self.attitude, self.sources.target)]
