"""Programs and runs in arithmetic so long that its rounding cannot be seen: the reference for all others."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from functools import cache
from typing import TYPE_CHECKING, Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from strapgen.backends import exact
from strapgen.catalogue import Choice
from strapgen.ir.program import OPERATIONS, Program
from strapgen.library import generated_sources
from strapgen.support import stages

if TYPE_CHECKING:
    pass

#: Decimal digits: a million steps lose six of them.
DIGITS = 40

#: The functions of programs on numbers of mpmath, roots apart.
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sin": mpmath.sin,
    "cos": mpmath.cos,
    "sinc": mpmath.sinc,
    "atan2": mpmath.atan2,
    "direction": mpmath.atan2,
    "wrap": lambda x: x - 2 * mpmath.pi * (int(x > mpmath.pi) - int(x < -mpmath.pi)),
}
_OPERATIONS: dict[str, Callable[..., Any]] = {**OPERATIONS, "sqrt": mpmath.sqrt, **FUNCTIONS}


def number(value: Fraction) -> Any:
    """Return a fraction in many digits."""
    return mpmath.mpf(value.numerator) / value.denominator


class Interpreter:
    """A program on numbers of mpmath, whose precision the caller sets.

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
    """Return all states of a run in many digits, the initial one first.

    Parameters
    ----------
    program : Program
        An attitude step.
    increments : iterable of sequence of mpf
        What each step takes, row-major.
    initial : sequence of mpf
        The first state, row-major.
    """
    step = Interpreter(program)
    found = [list(initial)]
    for row in increments:
        found.append(step(found[-1], row))
    return found


def propagate(program: Program, increments: Any, initial: Any = None) -> NDArray[np.float64]:
    """Run a step over increments with mpmath.

    Parameters
    ----------
    program : Program
        An attitude step.
    increments : array_like, (N, K, 3)
        Angle increments in rad, taken as the exact numbers that the doubles are.
    initial : array_like, (state shape), optional
        State at the start, by default zero rotation.

    Returns
    -------
    array, (1 + N, state shape)
        All states, rounded to double at the end.

    Raises
    ------
    ValueError
        If the program is no attitude step.

    Examples
    --------
    >>> from strapgen import derive, lower
    >>> propagate(lower(derive("euler")), np.full((2, 2, 3), 0.01))[-1].round(6)
    array([0.019996, 0.019996, 0.019996, 0.9994  ])
    """
    stages.require("propagate", program, Program)
    if program.companions is None:
        raise ValueError(f"{program.name} is no attitude step")
    state, samples = program.inputs
    with mpmath.workdps(DIGITS):
        if initial is None:
            held = [number(value) for value in program.companions.identity]
        else:
            held = [mpmath.mpf(float(value)) for value in np.ravel(initial)]
        rows = np.asarray(increments, np.float64).reshape(-1, samples.size).tolist()
        run = states(program, ([mpmath.mpf(value) for value in row] for row in rows), held)
        return np.array([[float(value) for value in row] for row in run]).reshape(-1, *state.shape)


#: Arithmetic of many digits, where a back end is named.
EXACT = "exact"


def interpreter(name: str, step: Program | None = None) -> exact.Interpreter:
    """Return a kernel by name that runs in many digits: one that a step brings, or of the catalogue."""
    programs = () if step is None else step.own
    return exact.Interpreter(next((one for one in programs if one.kernel == name), None) or _program(name))


@cache
def _program(name: str) -> Program:
    return generated_sources.program(Choice(name))
