"""Runs of an algorithm in arithmetic so long that its rounding cannot be seen: the reference for all others."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.program import Program

#: Decimal digits: a million steps lose six of them.
DIGITS = 40


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
    import mpmath

    if program.companions is None:
        raise ValueError(f"{program.name} is no attitude step")
    state, samples = program.inputs
    with mpmath.workdps(DIGITS):

        def number(value: Fraction) -> Any:
            return mpmath.mpf(value.numerator) / value.denominator

        constants: dict[Fraction, Any] = {}

        def constant(value: Fraction) -> Any:
            if value not in constants:
                constants[value] = number(value)
            return constants[value]

        if initial is None:
            held = [number(value) for value in program.companions.identity]
        else:
            held = [mpmath.mpf(float(value)) for value in np.ravel(initial)]
        states = [[float(value) for value in held]]
        for row in np.asarray(increments, np.float64).reshape(-1, samples.size).tolist():
            values = dict(zip(state.elements, held, strict=True))
            values |= zip(samples.elements, map(mpmath.mpf, row), strict=True)
            (held,) = program.run(values, constant).values()
            states.append([float(value) for value in held])
    return np.array(states).reshape(-1, *state.shape)
