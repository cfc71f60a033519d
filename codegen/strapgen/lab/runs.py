"""`simulate` runs an algorithm on a motion and compares each attitude with the true one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import mpmath
import numpy as np
from numpy.typing import NDArray

from strapgen import catalogue, pipeline
from strapgen.catalogue import MOTIONS, Choice
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import Records, notebook_html, short_repr
from strapgen.lab.motions.motions import Motion
from strapgen.lab.motions.rate_motion import RateMotion
from strapgen.lab.motions.users_motions import UsersMotion
from strapgen.run import exact
from strapgen.run.backends import Backend, backend, evaluator
from strapgen.run.backends import backend as attitude_backend
from strapgen.run.exact import DIGITS, attitudes, interpreter, number
from strapgen.run.increments import PART, StepWindows

if TYPE_CHECKING:
    from strapgen.kernel.kernel import Kernel

Array = NDArray[np.float64]

#: Largest length of an attitude: methods change it by far less where a step turns by a fraction of a rad.
LARGEST_LENGTH = 1.5

#: Seconds in an hour.
_HOUR = 3600
#: Records of a run that its steady drift is measured from, as a fraction of all: at each end.
_END = 10
#: Units in the last place of double precision a step above which rounding is a small part of the angle: on cones it
#: adds up to a third of one.
_UNITS_A_STEP = 4

#: Takes the length of a step in s and the number of steps; returns the increments of each in rad, row by row.
_Steps = Callable[[Fraction, int], Iterator[list[Any]]]
#: Takes a time in s; returns the true attitude, row by row.
_Truth = Callable[[Fraction], list[Any]]
#: What rounding may add in a step to an attitude of double precision.
_DOUBLE = 8 * 2.0**-52

#: Takes a sampling interval in s and the numbers of the first interval and of that after the last; returns increments.
_Row = Callable[[Fraction, int, int], list[list[Any]]]


@dataclass(frozen=True)
class Run(Records):
    """The records of a simulation.

    Parameters
    ----------
    time : array, (N,)
        Times of the records in s, the first one 0.
    computed, true : array, (N, 3, 3)
        Direction cosine matrices, body to reference.
    error : array, (N, 3, 3)
        Error matrices in reference axes: computed times transposed true matrix, minus the identity.
    scale, skew, drift : array, (N, 3)
        Their parts on the axes x, y, z; scale dimensionless, skew and drift in rad.

    Examples
    --------
    >>> from strapgen import algorithm
    >>> run = algorithm("euler").simulate("constant", "0.1", 1, z_deg_s=90)
    >>> run.time.shape, run.computed.shape
    ((11,), (11, 3, 3))
    """

    time: Array
    computed: Array
    true: Array
    error: Array
    scale: Array
    skew: Array
    drift: Array

    __repr__ = short_repr
    _repr_html_ = notebook_html

    def _in_words(self) -> str:
        drift = ", ".join(f"{np.degrees(value):.3g}" for value in self.drift_by_axis)
        records = f"{len(self.time)} records, {self.time[0]:g} s to {self.time[-1]:g} s"
        return f"of {records}\nmean drift {np.degrees(self.mean_drift):.3g} deg, largest about x, y, z {drift} deg"

    @property
    def drift_by_axis(self) -> Array:
        """Largest magnitude of the drift on each axis over the records, in rad."""
        largest: Array = np.abs(self.drift).max(axis=0)
        return largest

    @property
    def mean_drift(self) -> float:
        """Mean drift of the run in rad, the root of the sum of squares of `drift_by_axis` (chapter 5 of the thesis)."""
        return float(np.linalg.norm(self.drift_by_axis))


@np.errstate(all="ignore")  # numbers that overflow are refused, in one line
def simulate(
    backend: Backend,
    motion: Motion,
    step: float | str | Fraction,
    duration: float | str | Fraction,
    orthonormalize: float | str | Fraction | None = None,
    record: float | str | Fraction | None = None,
    pulse: float | str | Fraction | None = None,
    initial: Any = None,
) -> Run:
    """Run an algorithm on a motion with a known attitude.

    A step that takes rates at nodes gets those of the motion, in place of increments.

    Parameters
    ----------
    backend : Backend
        The algorithm.
    motion : Motion
        The motion, which supplies exact increments.
    step, duration : number
        Step and duration in s; the step divides the duration. Decimals are exact.
    orthonormalize : number, optional
        Interval of orthonormalization in s, a multiple of the step; by default there is none.
    record : number, optional
        Interval of records in s, a multiple of the step; by default every step is recorded.
    pulse : number, optional
        Angle of a gyro pulse in rad, see `gyro.pulses`; by default increments are not quantized.
    initial : array_like, (3, 3), or Rotation, optional
        Direction cosine matrix at the start, body to reference, or SciPy's rotation; by default there is none. The true
        attitude is this matrix times that of the motion.

    Returns
    -------
    Run

    Raises
    ------
    InputError
        If a time is not finite, not positive, or no multiple of the step, a pulse goes with rates, or the attitude
        leaves the range of the back end's numbers.

    Examples
    --------
    >>> from strapgen import backend, motion
    >>> run = simulate(backend("dcm", method="rk1"), motion("constant", y_deg_s=10), "0.125", 180, 5, 5)
    >>> round(float(np.degrees(run.mean_drift)), 4)
    0.2855
    """
    checks.require("simulate", backend, Backend)
    checks.require("simulate", motion, Motion)
    h = checks.number("step", step, positive=True)
    total = checks.number("duration", duration, positive=True)
    steps = checks.multiple("duration", total, "step", h)
    every = None
    if orthonormalize is not None:
        interval = checks.number("orthonormalize", orthonormalize, positive=True)
        every = checks.multiple("orthonormalize", interval, "step", h)
    interval = h if record is None else checks.number("record", record, positive=True)
    record_every = checks.multiple("record", interval, "step", h)
    if record_every > steps:
        raise InputError(f"record {float(interval):g} s is longer than the duration {float(total):g} s")
    checks.multiple("duration", total, "record interval", interval)
    if hasattr(initial, "as_matrix"):  # a Rotation of SciPy
        initial = initial.as_matrix()
    start = None if initial is None else initial_state(backend, initial)
    states = backend.propagate_parts(
        samples_of_steps(backend, motion, h, pulse), steps, record_every, every, start
    )
    time: Array = np.arange(len(states), dtype=np.float64) * float(interval)
    require_finite(backend, states, time)
    true = motion.attitude(time) if initial is None else np.asarray(initial, float) @ motion.attitude(time)
    with np.errstate(over="ignore", invalid="ignore"):  # the squares of large states are refused instead
        computed = attitude(backend, states)
    require_finite(backend, computed, time)
    return Run(time, computed, true, *evaluator("error-matrix")(computed, true))


def attitude(backend: Backend, states: Any) -> Array:
    """Return the attitude of states of a back end.

    `states` has shape (..., state shape). Returns (..., 3, 3): direction cosine matrices, body to reference, in
    double.
    """
    return backend.matrices(states)


def drift_between(computed: Any, other: Any) -> Array:
    """Return the drift vectors between attitudes.

    `computed, other` (..., 3, 3): direction cosine matrices. Returns (..., 3): in rad, reference axes. To first
    order, the length of each is the angle between the attitudes.
    """
    drift: Array = evaluator("error-matrix")(computed, other)[3]
    return drift


def initial_state(backend: Backend, matrix: Any) -> Array:
    """Return the state of a back end that has an attitude.

    `matrix` (3, 3): direction cosine matrix, body to reference. Returns (state shape).
    """
    numbers = checks.real_array("initial", matrix, (3, 3), np.dtype(np.float64))
    if backend.attitude is None:
        return numbers
    inverse = f"{backend.attitude.removeprefix('dcm-from-')}-from-dcm"
    if inverse not in catalogue.KERNELS:
        raise InputError(
            f"no kernel converts a matrix to the state of {backend.kernel}; its runs begin at zero rotation"
        )
    state: Array = evaluator(inverse)(numbers)
    return state


@np.errstate(all="ignore")  # numbers that overflow are refused, in one line
def largest_increment(
    motion: Motion,
    step: float | str | Fraction,
    duration: float | str | Fraction,
    samples: int,
    pulse: float | str | Fraction | None = None,
    beside: tuple[int, int] = (0, 0),
) -> float:
    """Return the largest magnitude of an element of the angle increments of a simulation, in rad.

    `samples`: increments per step.
    """
    h = checks.number("step", step, positive=True)
    return _largest(_increments(motion, h, samples, beside, pulse), h, duration)


@np.errstate(all="ignore")
def largest_node_rotation(
    motion: Motion,
    step: float | str | Fraction,
    duration: float | str | Fraction,
    nodes: Sequence[float],
) -> float:
    """Return the largest magnitude of an element of the rates at nodes, times the step, of a simulation.

    Returned in rad.
    """
    h = checks.number("step", step, positive=True)
    return _largest(_node_rotations(motion, h, nodes), h, duration)


def _largest(part: Callable[[int, int], Array], h: Fraction, duration: float | str | Fraction) -> float:
    """Return the largest magnitude of an element of the samples of a run."""
    steps = checks.multiple("duration", checks.number("duration", duration, positive=True), "step", h)
    counts = ((first, min(PART, steps - first)) for first in range(0, steps, PART))
    return max(float(np.abs(part(first, count)).max()) for first, count in counts)


def _increments(
    motion: Motion,
    step: Fraction,
    samples: int,
    beside: tuple[int, int],
    pulse: float | str | Fraction | None,
) -> StepWindows:
    """Return the increments of a run, part by part."""

    def read(first: int, stop: int) -> Array:
        return motion.samples(step / samples, first - beside[0], stop - beside[0])

    return StepWindows(read, samples, sum(beside), pulse)


def _node_rotations(motion: Motion, step: Fraction, nodes: Sequence[float]) -> Callable[[int, int], Array]:
    """Return the rates at the nodes of the steps of a run, each times the step, part by part."""
    length = float(step)

    def read(first: int, count: int) -> Array:
        rates = motion.rate((np.arange(first, first + count)[:, None] + np.array(nodes)) * length)
        rotations: Array = rates * length
        return rotations

    return read


def samples_of_steps(
    backend: Backend, motion: Motion, step: Fraction, pulse: float | str | Fraction | None = None
) -> Callable[[int, int], Array]:
    """Return the samples of the steps of a run, part by part: increments, or rates at nodes."""
    if not backend.nodes:
        backend.need_increments()
        return _increments(motion, step, backend.increments, (backend.previous, backend.ahead), pulse)
    if pulse is not None:
        raise InputError(f"kernel {backend.kernel} takes rates; a pulse goes with increments")
    return _node_rotations(motion, step, backend.nodes)


def require_proper(backend: Backend, states: Any, time: Array) -> None:
    """Refuse an attitude whose length has left 1 by more than small rotations make it."""
    if not backend.sources.function.inputs[0].constraint:
        return
    values = np.asarray(states, np.float64)
    with np.errstate(over="ignore"):  # a length beyond all numbers is refused too
        lengths = np.sqrt(np.square(values).sum(axis=tuple(range(1, values.ndim)))) / np.linalg.norm(
            backend.identity
        )
    wrong = np.flatnonzero((lengths > LARGEST_LENGTH) | (lengths < 1 / LARGEST_LENGTH))
    if len(wrong):
        place = int(wrong[0])
        raise InputError(
            f"the length of the attitude is {lengths[place]:.3g} at {time[place]:.6g} s, where 1 is needed: steps turn "
            "too far for the method; are the units of rate and time right? If they are, orthonormalize restores it"
        )


def require_finite(backend: Backend, states: Any, time: Array) -> None:
    """Refuse a run whose states are beyond the range of its back end.

    `states` has shape (N, state shape). `time` (N,): time of each state in s.
    """
    broken = ~np.isfinite(states.reshape(len(states), -1)).all(axis=1)
    if broken.any():
        cause = "the increments are too large for the method"
        if backend.takes == "increments" and backend.samples_per_step > 2:
            cause = (
                f"the increments, or the rates of the polynomial through {backend.samples_per_step} of them, are too "
                "large for the method"
            )
        raise InputError(
            f"the attitude is not finite from {time[broken][0]:.6g} s on; "
            f"steps of {backend.kernel} lengthen it: {cause}"
        )


def angles(run: Run) -> NDArray[np.float64]:
    """Return the angle between the computed and the true attitude at every record.

    Returns (N,): in rad, 0 to pi.
    """
    # The error matrix is s R - I with a rotation R and a length s: its sum with I has the norm s sqrt(3), its trace is
    # s (1 + 2 cos) - 3, and the drift is as long as s sin.
    length = np.sqrt(np.square(run.error + np.eye(3)).sum(axis=(1, 2)) / 3)
    cosine = ((run.scale.sum(axis=1) + 3) / length - 1) / 2
    result: NDArray[np.float64] = np.arctan2(np.linalg.norm(run.drift, axis=1) / length, cosine)
    return result


def drift(run: Run) -> float:
    """Return the largest angle of a run from the true attitude, divided by the duration.

    Returned in deg/h.

    >>> from strapgen import backend, motion, simulate
    >>> cone = motion("cone", half_angle_deg=1, frequency_hz=5)
    >>> round(drift(simulate(backend("euler", "coning-compressed", 2), cone, "0.02", 10)), 3)
    0.317
    """
    return drift_of(angles(run).max(), run.time[-1])


def drift_of(angle: float, duration: float | Fraction) -> float:
    """Return an angle in rad over a duration in s, in deg/h."""
    return math.degrees(angle) / float(duration) * _HOUR


def measured_drift(choice: Choice, motion: Motion, step: Fraction, count: int) -> float:
    """Return the drift of a step on a motion, in many digits where double precision may show its own rounding.

    `step`: in s. Returned in deg/h, see `drift`.
    """
    stepper, duration = backend(choice), count * step
    value = drift(simulate(stepper, motion, step, duration))
    if not (value < drift_of(_UNITS_A_STEP * stepper.unit * count, duration) and has_digits(motion)):
        return value
    error = exact.interpreter("error-matrix")
    with mpmath.workdps(exact.DIGITS):
        # Of an angle that double precision does not show, the drift is the angle itself.
        largest = max(mpmath.norm(error(*pair)) for pair in exact_attitudes(choice, motion)(step, count))
    return drift_of(float(largest), duration)


def steady_drift(run: Run) -> float:
    """Return the drift between the means of the error over the first and the last tenth of a run.

    What only swings, as the lag of a gyro does on a vibration, is not part of it.

    Returned in deg/h.
    """
    count = max(1, len(run.time) // _END)
    change = run.drift[-count:].mean(axis=0) - run.drift[:count].mean(axis=0)
    time = run.time[-count:].mean() - run.time[:count].mean()
    return float(np.degrees(np.linalg.norm(change)) / time * _HOUR)


def step_of_increments(choice: Choice) -> Kernel:
    """Return the kernel of a chosen attitude step."""
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
    row, truth = _of_rate(motion) if isinstance(motion, RateMotion) else _of_catalogue(motion)
    samples = backend.increments

    def steps_of(length: Fraction, count: int) -> Iterator[list[Any]]:
        rows = row(length / samples, -backend.previous, count * samples + backend.ahead)
        for k in range(0, count * samples, samples):
            yield [x for vector in rows[k : k + backend.samples_per_step] for x in vector]

    return steps_of, truth


def _of_catalogue(motion: Motion) -> tuple[_Row, _Truth]:
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


def _of_rate(motion: RateMotion) -> tuple[_Row, _Truth]:
    """Return the increments and the attitude of a rate expression."""
    return motion.samples_in_digits, motion.attitude_in_digits


def _of_functions(motion: UsersMotion, backend: Backend) -> tuple[_Steps, _Truth]:
    """Return the increments and the attitude of a user's functions, in double precision."""

    def steps_of(length: Fraction, count: int) -> Iterator[list[Any]]:
        rows = motion.increments(length, count, backend.increments, backend.previous, backend.ahead)
        for row in rows.reshape(count, -1):
            yield [mpmath.mpf(x) for x in row.tolist()]

    def truth(time: Fraction) -> list[Any]:
        return [mpmath.mpf(x) for x in motion.attitude(float(time)).ravel().tolist()]

    return steps_of, truth
