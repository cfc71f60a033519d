"""Computes the attitudes of a run in so many digits that rounding cannot be seen, with the true attitudes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import mpmath

from strapgen import pipeline
from strapgen.catalogue import MOTIONS, Choice
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.lab.motions.motions import Motion
from strapgen.lab.motions.rate_motion import RateMotion
from strapgen.lab.motions.users_motions import UsersMotion
from strapgen.run.backends import Backend
from strapgen.run.backends import backend as attitude_backend
from strapgen.run.exact import DIGITS, attitudes, interpreter, number

if TYPE_CHECKING:
    from strapgen.kernel.kernel import Kernel

#: Takes the length of a step in s and the number of steps; returns the increments of each in rad, row by row.
_Steps = Callable[[Fraction, int], Iterator[list[Any]]]
#: Takes a time in s; returns the true attitude, row by row.
_Truth = Callable[[Fraction], list[Any]]
#: What rounding may add in a step to an attitude of double precision.
_DOUBLE = 8 * 2.0**-52


def step_of_increments(choice: Choice) -> Kernel:
    """Return the kernel of a chosen attitude step."""
    if not isinstance(choice, Choice):
        raise InputTypeError(f"choice is {choice!r}; what strapgen.choose returns is needed")
    kernel = pipeline.derive(choice)
    if kernel.attitude_step is None or kernel.inputs[1].name != "increments":
        raise InputError(f"kernel {kernel.name} takes no increments; a step that does is needed")
    return kernel


def exact_attitudes(
    choice: Choice, motion: Motion
) -> Callable[[Fraction, int], Iterator[tuple[list[Any], list[Any]]]]:
    """Return a function that runs a step on a motion in many digits.

    Returns: ``run(step, count)`` yields the computed and the true matrix, row by row, at time 0 and after every
    step. The caller sets the precision of mpmath to `exact.DIGITS`.
    """
    backend = attitude_backend(choice, backend="exact")
    steps_of, truth = _in_digits(motion, backend)

    def run(length: Fraction, count: int) -> Iterator[tuple[list[Any], list[Any]]]:
        for place, matrix in enumerate(attitudes(backend, steps_of(length, count))):
            yield matrix, truth(place * length)

    return run


def has_digits(motion: Motion) -> bool:
    """Return whether the increments and the attitude of a motion are known in more digits than double precision has."""
    return isinstance(motion, RateMotion) or motion.name in MOTIONS


def uncertainty(motion: Motion, length: Fraction, count: int) -> float:
    """Return the error in rad that a run of `exact_attitudes` may have from increments, attitude and rounding.

    `length`: step in s.
    """
    rounding = 10.0 ** (10 - DIGITS)
    if isinstance(motion, UsersMotion):
        return _DOUBLE * count
    return rounding + (motion.error_bound(float(length * count)) if isinstance(motion, RateMotion) else 0.0)


def _in_digits(motion: Motion, backend: Backend) -> tuple[_Steps, _Truth]:
    """Return the increments of the steps of a back end, and the true attitude, of a motion."""
    if isinstance(motion, UsersMotion):
        return _of_functions(motion, backend)
    row, truth = _integrated(motion) if isinstance(motion, RateMotion) else _closed(motion)
    samples = backend.increments

    def steps_of(length: Fraction, count: int) -> Iterator[list[Any]]:
        rows = row(length / samples, -backend.previous, count * samples + backend.ahead)
        for k in range(0, count * samples, samples):
            yield [x for vector in rows[k : k + backend.samples] for x in vector]

    return steps_of, truth


#: Takes a sampling interval in s and the numbers of the first interval and of that after the last; returns increments.
_Row = Callable[[Fraction, int, int], list[list[Any]]]


def _closed(motion: Motion) -> tuple[_Row, _Truth]:
    """Return the increments and the attitude of a motion of the catalogue."""
    if motion.name not in MOTIONS:
        raise InputError(
            f"the attitude of motion {motion.name} has no closed form, which many digits need; these have: "
            f"{', '.join(MOTIONS)}"
        )
    increment, truth = interpreter(f"{motion.name}-increments"), interpreter(f"{motion.name}-truth")
    parameters = [[mpmath.mpf(value)] for value in motion.parameters.values()]

    def row(width: Fraction, first: int, stop: int) -> list[list[Any]]:
        middles = (number((2 * k + 1) * width / 2) for k in range(first, stop))
        return [list(increment([middle], [number(width)], *parameters)) for middle in middles]

    return row, lambda time: list(truth([number(time)], *parameters))


def _integrated(motion: RateMotion) -> tuple[_Row, _Truth]:
    """Return the increments and the attitude of a rate expression."""
    return motion.samples_in_digits, motion.attitude_in_digits


def _of_functions(motion: UsersMotion, backend: Backend) -> tuple[_Steps, _Truth]:
    """Return what the functions of a file return, whose digits are those of double."""

    def steps_of(length: Fraction, count: int) -> Iterator[list[Any]]:
        rows = motion.increments(length, count, backend.increments, backend.previous, backend.ahead)
        for row in rows.reshape(count, -1):
            yield [mpmath.mpf(x) for x in row.tolist()]

    def truth(time: Fraction) -> list[Any]:
        return [mpmath.mpf(x) for x in motion.attitude(float(time)).ravel().tolist()]

    return steps_of, truth
