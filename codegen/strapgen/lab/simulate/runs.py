"""`simulate` runs an algorithm on a motion and compares each attitude with the true one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen import catalogue
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import Records, notebook_html, short_repr
from strapgen.lab.attitude_limits import require_finite
from strapgen.lab.motions.motions import Motion
from strapgen.run.backends import Backend, evaluator
from strapgen.run.increments import PART, StepWindows

Array = NDArray[np.float64]


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
def largest_turn(
    motion: Motion,
    step: float | str | Fraction,
    duration: float | str | Fraction,
    nodes: Sequence[float],
) -> float:
    """Return the largest magnitude of an element of the rates at nodes, times the step, of a simulation.

    Returned in rad.
    """
    h = checks.number("step", step, positive=True)
    return _largest(_turns(motion, h, nodes), h, duration)


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


def _turns(motion: Motion, step: Fraction, nodes: Sequence[float]) -> Callable[[int, int], Array]:
    """Return the rates at the nodes of the steps of a run, each times the step, part by part."""
    length = float(step)

    def read(first: int, count: int) -> Array:
        rates = motion.rate((np.arange(first, first + count)[:, None] + np.array(nodes)) * length)
        turns: Array = rates * length
        return turns

    return read


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
    states = backend.propagate_parts(_samples(backend, motion, h, pulse), steps, record_every, every, start)
    time: Array = np.arange(len(states), dtype=np.float64) * float(interval)
    require_finite(backend, states, time)
    true = motion.attitude(time) if initial is None else np.asarray(initial, float) @ motion.attitude(time)
    with np.errstate(over="ignore", invalid="ignore"):  # the squares of large states are refused instead
        computed = attitude(backend, states)
    require_finite(backend, computed, time)
    return Run(time, computed, true, *evaluator("error-matrix")(computed, true))


def _samples(
    backend: Backend, motion: Motion, step: Fraction, pulse: float | str | Fraction | None
) -> Callable[[int, int], Array]:
    """Return what the steps of a run take, part by part: increments, or rates at nodes."""
    if not backend.nodes:
        backend.need_increments()
        return _increments(motion, step, backend.increments, (backend.previous, backend.ahead), pulse)
    if pulse is not None:
        raise InputError(f"kernel {backend.kernel} takes rates; a pulse goes with increments")
    return _turns(motion, step, backend.nodes)
