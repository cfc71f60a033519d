"""The drift of known algorithms on the motions of the acceptance table, which others computed from the formulas."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

import strapgen
from strapgen.simulation.drift import angles, drift, steady_drift
from strapgen.simulation.runs import Run

#: At 100 Hz over 60 s: motion, its parameters, and the drift in deg/h of combined coefficients on three increments
#: and three before them, and of one increment and one before it.
DRIFTS = [
    ("cone", {"half_angle_deg": 1, "frequency_hz": 10}, 5.6e-4, 9.8),
    ("cone", {"half_angle_deg": 1, "frequency_hz": 20}, 2.6, 271),
    ("cone", {"half_angle_deg": 5, "frequency_hz": 5}, 8.1e-5, 7.9),
    ("cone", {"half_angle_deg": 15, "frequency_hz": 20}, 71, 1.1e4),
    ("random", {"rate_deg_s": 200}, 0.32, 11),
    ("slew", {"onset_s": 0.05}, 1.1e-5, 5.8e-3),
    ("slew", {"onset_s": 0.01}, 3.5e-2, 2.4e-2),
    ("ramps", {"onset_s": 0.05}, 2.5e-2, 1.3e-2),
]


@pytest.mark.parametrize(
    ("name", "settings", "combined", "single"), DRIFTS, ids=[f"{n} {s}" for n, s, *_ in DRIFTS]
)
def test_known_algorithms_drift_as_published(name, settings, combined, single):
    motion = strapgen.motion(name, **settings)
    backends = (
        (strapgen.backend("euler", "coning-combined", 3, previous=3), combined),
        (strapgen.backend("euler", "coning-compressed", 1, previous=1), single),
    )
    for backend, expected in backends:
        run = strapgen.simulate(backend, motion, Fraction(backend.increments, 100), 60)
        assert drift(run) == pytest.approx(expected, rel=0.1), backend.kernel


def runs_of(vectors: np.ndarray) -> Run:
    """Return a run whose errors are rotations by these vectors in rad, with a record a second."""
    from scipy.spatial.transform import Rotation

    error = Rotation.from_rotvec(vectors).as_matrix() - np.eye(3)
    still = np.broadcast_to(np.eye(3), error.shape)
    return Run(
        np.arange(len(vectors), dtype=float),
        still,
        still,
        error,
        *strapgen.evaluator("error-matrix")(error + still, still)[1:],
    )


def test_angles_are_those_of_the_error_small_or_large():
    vectors = np.zeros((4, 3))
    vectors[:, 1] = [0.0, 1e-12, 1.0, 3.0]
    np.testing.assert_allclose(angles(runs_of(vectors)), vectors[:, 1], rtol=1e-4, atol=1e-17)


def test_the_drift_is_the_largest_angle_over_the_duration():
    vectors = np.zeros((11, 3))
    vectors[4, 2] = math.radians(1)
    assert drift(runs_of(vectors)) == pytest.approx(360)


def test_the_steady_drift_leaves_out_what_swings():
    time = np.arange(101)
    vectors = np.zeros((101, 3))
    vectors[:, 0] = 1e-6 * time + 1e-3 * (-1.0) ** time
    assert steady_drift(runs_of(vectors)) == pytest.approx(math.degrees(1e-6) * 3600, rel=1e-3)
    assert drift(runs_of(vectors)) > 10 * steady_drift(runs_of(vectors))
