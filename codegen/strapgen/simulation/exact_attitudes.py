"""Computes the attitudes of a run in so many digits that rounding cannot be seen, with the true attitudes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import mpmath

from strapgen import pipeline
from strapgen.backends.exact import ExactBackend, interpreter, number
from strapgen.catalogue import MOTIONS, Choice
from strapgen.simulation.motions import Motion
from strapgen.support.exceptions import InputError, InputTypeError

if TYPE_CHECKING:
    from strapgen.symbolic.kernel import Kernel


def step_of_increments(choice: Choice) -> Kernel:
    """Return the kernel of a chosen attitude step.

    Raises
    ------
    InputError, InputTypeError
        If the step takes no increments, or `choice` is no choice.
    """
    if not isinstance(choice, Choice):
        raise InputTypeError(f"choice is {choice!r}; what strapgen.choose returns is needed")
    kernel = pipeline.derive(choice)
    if kernel.companions is None or kernel.inputs[1].name != "increments":
        raise InputError(f"kernel {kernel.name} takes no increments; a step that does is needed")
    return kernel


def exact_attitudes(
    choice: Choice, motion: Motion
) -> Callable[[Fraction, int], Iterator[tuple[list[Any], list[Any]]]]:
    """Return a function that runs a step on a motion in many digits.

    Parameters
    ----------
    choice : Choice
        An attitude step that takes increments.
    motion : Motion

    Returns
    -------
    callable
        ``run(step, count)`` yields the computed and the true matrix, row by row, at time 0 and after every step. The
        caller sets the precision of mpmath to `exact.DIGITS`.

    Raises
    ------
    InputError
        If the attitude of the motion has no closed form.
    """
    backend = ExactBackend.of_choice(choice)
    samples, previous, ahead = backend.increments, backend.previous, backend.ahead
    if motion.name not in MOTIONS:
        raise InputError(
            f"the attitude of motion {motion.name} has no closed form, which many digits need; these have: "
            f"{', '.join(MOTIONS)}"
        )
    increment, truth = interpreter(f"{motion.name}-increments"), interpreter(f"{motion.name}-truth")
    attitude = backend.attitude_in_digits()

    def run(length: Fraction, count: int) -> Iterator[tuple[list[Any], list[Any]]]:
        parameters = [[mpmath.mpf(value)] for value in motion.parameters.values()]
        width = length / samples
        row = [
            increment([number((2 * k + 1) * width / 2)], [number(width)], *parameters)
            for k in range(-previous, count * samples + ahead)
        ]
        steps = (
            [x for vector in row[k : k + backend.samples] for x in vector]
            for k in range(0, count * samples, samples)
        )
        for place, state in enumerate(backend.states_in_digits(steps)):
            yield list(attitude(state)), truth([number(place * length)], *parameters)

    return run
