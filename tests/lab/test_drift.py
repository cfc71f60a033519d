"""The drift of known algorithms on the motions of the acceptance table, which others computed from the formulas."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

import strapgen
from strapgen.lab.runs import Run, angles, drift, steady_drift

#: Algorithms with their samples, and their drifts in deg/h at 100 Hz over 60 s on the motions below.
ALGORITHMS = {
    "window-3-3": (1, 3, 3),
    "window-5-5": (1, 5, 5),
    "window-7-7": (1, 7, 7),
    "coning-shaped-8": (1, 8, 0),
    "coning-combined": (3, 3, 0),
    "coning-compressed": (1, 1, 0),
}
DRIFTS = {
    ("cone", "half_angle_deg=1 frequency_hz=10"): (0.213, 5.06e-3, 6.46e-6, 1.3e-4, 5.6e-4, 9.8),
    ("cone", "half_angle_deg=1 frequency_hz=20"): (1.01, 1.51e-2, 1.45e-4, 1.2e-3, 2.6, 271),
    ("cone", "half_angle_deg=5 frequency_hz=5"): (5.67e-2, 3.41e-3, 1.07e-4, 2.6e-3, 8.1e-5, 7.9),
    ("cone", "half_angle_deg=15 frequency_hz=20"): (222, 2.75, 0.539, 49, 71, 1.1e4),
    ("random", "rate_deg_s=200"): (0.262, 2.11e-3, 7.53e-4, 2.9, 0.32, 11),
    ("slew", "onset_s=0.05"): (3.9e-6, 1.5e-7, 9e-9, 2.4e-3, 1.1e-5, 5.8e-3),
    ("slew", "onset_s=0.01"): (1.96e-3, 1.50e-3, 1.35e-3, 1.1e-2, 3.5e-2, 2.4e-2),
    ("ramps", "onset_s=0.05"): (3.1e-3, 3.2e-3, 3.2e-3, 9.5e-3, 2.5e-2, 1.3e-2),
}
#: Below this drift in deg/h, 3e-12 rad after 60 s, rounding counts.
FLOOR = 1e-8


@pytest.mark.long
@pytest.mark.parametrize(("name", "settings"), DRIFTS, ids=[f"{n} {s}" for n, s in DRIFTS])
@pytest.mark.parametrize("method", ALGORITHMS)
def test_known_algorithms_drift_as_tabulated(method, name, settings):
    increments, previous, ahead = ALGORITHMS[method]
    expected = DRIFTS[name, settings][list(ALGORITHMS).index(method)]
    motion = strapgen.motion(name, **dict(setting.split("=") for setting in settings.split()))
    backend = strapgen.backend("euler", method, increments, "c", previous=previous, ahead=ahead)
    found = drift(strapgen.simulate(backend, motion, Fraction(increments, 100), 60))
    assert found <= FLOOR if expected < FLOOR else found == pytest.approx(expected, rel=0.1)


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
