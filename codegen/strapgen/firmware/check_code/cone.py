"""The cone on which the drift of a user's function is measured, and what published corrections leave on it."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from strapgen import catalogue
from strapgen.catalogue.methods.coning_coefficients import FORMS, Design
from strapgen.lab.motions.motions import Motion, motion
from strapgen.lab.runs import simulate
from strapgen.run.backends import backend as attitude_backend

Array = NDArray[np.float64]

#: The cone of the drift: half-angle in rad, frequency in rad/s, sampling interval in s, number of samples.
HALF_ANGLE, FREQUENCY, SAMPLING, SAMPLES = math.radians(1), 20 * math.pi, Fraction(1, 100), 6000


def cone() -> Motion:
    """Return a coning motion whose axis stands still."""
    a, g = FREQUENCY * math.sin(HALF_ANGLE), -2 * FREQUENCY * math.sin(HALF_ANGLE / 2) ** 2
    return motion("coning", a_rad_s=a, b_rad_s=FREQUENCY, g_rad_s=g)


def closed_form_deg_h(standard: Design) -> float:
    """Return the drift on the cone that a coning correction leaves, to second order in the half-angle.

    Returns: computed minus true, in deg/h.

    >>> from strapgen.catalogue.methods.coning_coefficients import design
    >>> [round(closed_form_deg_h(design(1, previous)), 3) for previous in (0, 1)]
    [-127.339, -9.784]
    """
    symbols = dict(zip(("alpha", "omega", "T"), (HALF_ANGLE, FREQUENCY, SAMPLING), strict=True))
    rate = sp.sympify(standard.residual().expression).evalf(30, subs=symbols)
    return math.degrees(float(rate)) * 3600


def published_step(method: str, standard: Design) -> catalogue.Choice:
    """Return the step of Euler parameters with a published correction."""
    return catalogue.choose("euler", method, standard.samples, previous=standard.previous)


def drift_deg_h(drift: Array, duration: Fraction) -> Array:
    """Return the largest drift of a run, over its duration.

    `drift` (N, 3): in rad, reference axes. `duration`: in s. Returns (3,): in deg/h about x, y and z; its
    length is the largest.
    """
    largest = drift[np.linalg.norm(drift, axis=1).argmax()]
    rates: Array = np.degrees(largest) / float(duration) * 3600
    return rates


def generated_drifts(standard: Design) -> dict[str, float]:
    """Return the drift in deg/h that generated steps of published corrections leave, by their methods."""
    length, duration = SAMPLING * standard.samples, seconds(standard.samples)
    drifts = {}
    for form in FORMS:
        step = attitude_backend(published_step(f"coning-{form}", standard))
        rates = drift_deg_h(simulate(step, cone(), length, duration).drift, duration)
        drifts[f"coning-{form}"] = float(np.linalg.norm(rates))
    return drifts


def seconds(samples: int) -> Fraction:
    """Return the duration of a run on the cone in s: whole calls of so many samples."""
    return SAMPLING * (SAMPLES // samples * samples)
