"""Sums up the error of a run in one number: its drift in degrees per hour."""

from __future__ import annotations

import math
from fractions import Fraction

import mpmath
import numpy as np
from numpy.typing import NDArray

from strapgen.catalogue import Choice
from strapgen.lab.motions.exact_attitudes import exact_attitudes, has_digits
from strapgen.lab.motions.motions import Motion
from strapgen.lab.simulate.runs import Run, simulate
from strapgen.run import exact
from strapgen.run.backends import backend

#: Seconds in an hour.
_HOUR = 3600
#: Records of a run that its steady drift is measured from, as a fraction of all: at each end.
_END = 10
#: Units in the last place of double precision a step above which rounding is a small part of the angle: on cones it
#: adds up to a third of one.
_UNITS_A_STEP = 4


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
