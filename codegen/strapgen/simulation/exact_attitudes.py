"""Attitudes of a run in so many digits that rounding cannot be seen, beside the true ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import mpmath

from strapgen import pipeline
from strapgen.backends import exact
from strapgen.backends.exact import interpreter
from strapgen.catalogue import Choice
from strapgen.library import generated_sources
from strapgen.simulation.motions import Motion
from strapgen.support.exceptions import InputError, InputTypeError

if TYPE_CHECKING:
    from strapgen.symbolic.kernel import Kernel


def step_of_increments(choice: Choice) -> Kernel:
    """Return the kernel of a chosen attitude step.

    Raises
    ------
    InputError, InputTypeError
        If it takes no increments, or no choice is given.
    """
    if not isinstance(choice, Choice):
        raise InputTypeError(f"choice is {choice!r}; what catalogue.choose returns is needed")
    kernel = pipeline.derive(choice)
    if kernel.companions is None or kernel.inputs[1].name != "increments":
        raise InputError(f"kernel {kernel.name} takes no increments; a step that does is needed")
    return kernel


def exact_attitudes(
    choice: Choice, motion: Motion
) -> Callable[[Fraction, int], Iterator[tuple[list[Any], list[Any]]]]:
    """Return what runs a step on a motion in the digits of mpmath.

    Parameters
    ----------
    choice : Choice
        An attitude step that takes increments.
    motion : Motion

    Returns
    -------
    callable
        ``run(step, count)``: the computed and the true matrix, row by row, at time 0 and after every step.
    """
    program = generated_sources.program(choice)
    assert program.companions is not None, "checked by the caller"
    samples, previous = choice.increments_per_step, choice.previous

    increment, truth = interpreter(f"{motion.name}-increments"), interpreter(f"{motion.name}-truth")
    named = program.companions.attitude
    attitude = None if named is None else interpreter(named, program)
    identity = program.companions.identity

    def run(length: Fraction, count: int) -> Iterator[tuple[list[Any], list[Any]]]:
        parameters = [[mpmath.mpf(value)] for value in motion.parameters.values()]
        width = length / samples
        row = [
            increment([exact.number((2 * k + 1) * width / 2)], [exact.number(width)], *parameters)
            for k in range(-previous, count * samples)
        ]
        taken = (
            [x for vector in row[k : k + previous + samples] for x in vector]
            for k in range(0, count * samples, samples)
        )
        states = exact.states(program, taken, [exact.number(value) for value in identity])
        for place, state in enumerate(states):
            computed = attitude(state) if attitude else state
            yield computed, truth([exact.number(place * length)], *parameters)

    return run
