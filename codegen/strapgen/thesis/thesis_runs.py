"""Runs of the thesis: its motions at any rate, order and interval of orthonormalization, each run once."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from strapgen.lab.motions.motions import motion
from strapgen.lab.simulate.runs import Run, simulate
from strapgen.run.backends import backend
from strapgen.thesis.thesis_tables import DURATION, INTERVAL, STEP

#: Parameters that a rate is set for: all of a motion, or the axes of a constant rate.
_KEYS = {"sinusoidal": "ab", "coning": "abg"}


@lru_cache(maxsize=256)
def thesis_run(
    algorithm: str,
    order: int,
    name: str = "y",
    rate: float = 10,
    every: float | None = float(INTERVAL),
    step: str = str(STEP),
) -> Run:
    """Run one of the thesis's motions for 180 s.

    `name`: "sinusoidal" or "coning", or the axes of a constant rate, for instance "xyz". `rate`: every
    parameter of the motion in deg/s. `every`: time from one orthonormalization to the next in s; None for
    never. Records are as far apart, or 5 s. `step`: in s.
    """
    keys = _KEYS.get(name, name)
    profile = motion(name if name in _KEYS else "constant", **{f"{key}_deg_s": rate for key in keys})
    stepper = backend(algorithm, f"rk{order}", 2)
    return simulate(stepper, profile, step, DURATION, every, max(every or 0, float(INTERVAL)))


def last_drift(run: Run) -> float:
    """Return the drift about y at the end of a run, in rad."""
    return float(run.drift[-1, 1])


def last_scale(run: Run) -> float:
    """Return the largest scale error at the end of a run, with its sign."""
    scales = run.scale[-1]
    return float(scales[np.abs(scales).argmax()])


def bend(time: NDArray[np.float64], values: NDArray[np.float64]) -> float:
    """Return how far values depart from the best straight line, as a share of the last one."""
    line = np.stack([time, np.ones_like(time)], axis=1)
    rest = values - line @ np.linalg.lstsq(line, values, rcond=None)[0]
    return float(np.abs(rest).max() / abs(values[-1]))
