"""The reference system of the example, at rest: what it settles on, mode changes, and what error feedback earns."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import strapgen
from strapgen.ir.fixed_settings import Settings
from strapgen.navigation.loops.loop_schedule import read
from strapgen.navigation.loops.loops_study import RestingSensors, run_modes, tilt

EXAMPLE = Path(__file__).parents[2] / "examples" / "ahrs.toml"
SCHEDULE = read()
FAST, FINE, NORMAL = SCHEDULE.sequence
DEG_H = math.radians(1 / 3600)
#: Gyro biases of 8 and -5 deg/h, accelerometer biases of 200 and 300 micro-g.
SENSORS = RestingSensors(
    gyro_bias=(8 * DEG_H, -5 * DEG_H, 0.0), accelerometer_bias=(200e-6 * 9.81, 300e-6 * 9.81, 0.0)
)
TILT = (-3e-4, 2e-4)
RATE = (7.292115e-5 + 8 * DEG_H, -5 * DEG_H)


def runner(backend: str, carry: str = ""):
    system = strapgen.read_system(EXAMPLE)
    return strapgen.system_runner(system, backend, Settings(word=32, carry=carry) if carry else None)


@pytest.fixture(scope="module")
def in_c():
    return runner("c")


def apart(run) -> np.ndarray:
    """Return the largest errors of tilt in rad and of the bias in rad/s at the end of a run."""
    bias = run.values["level_level_bias"][-1] - RATE
    return np.array([np.abs(tilt(run.values["attitude_state"][-1])[:2] - TILT).max(), np.abs(bias).max()])


def test_the_level_frame_settles_on_the_accelerometers_and_the_bias_on_all_rates(in_c):
    (run,) = run_modes(in_c, SCHEDULE, [(FAST, Fraction(150))], SENSORS)
    # After thirty time constants: 30**2/2 exp(-30) of the start, and tilts of second order.
    assert np.all(apart(run) <= (1e-9, 1e-8))
    assert abs(run.values["course_heading"][-1]) < 1e-6
    C = run.values["attitude_state"][-1].reshape(3, 3)
    # Drift of the rows since the last normalization, of third order in a cycle's increment.
    assert np.abs(C @ C.T - np.eye(3)).max() < 1e-12


def test_numpy_is_c_and_fixed_point_comes_close(in_c):
    parts = [(FAST, Fraction(1, 2)), (FINE, Fraction(1, 2))]
    double, c, fixed, model = (
        run_modes(one, SCHEDULE, parts, SENSORS)[-1]
        for one in (runner("numpy"), in_c, runner("c-fixed32", "all"), runner("fixed-model", "all"))
    )
    for name, values in double.values.items():
        # Thousands of roundings of numbers up to 10.
        assert np.abs(c.values[name] - values).max() < 1e-12, name
        np.testing.assert_array_equal(fixed.values[name], model.values[name])
        limit = 1e-7 if name == "attitude_state" else 1e-4
        assert np.abs(fixed.values[name] - values).max() < limit, name


def test_a_change_of_mode_makes_no_jump(in_c):
    sensors = RestingSensors(
        gyro_bias=(8 * DEG_H, -5 * DEG_H, 3 * DEG_H),
        accelerometer_bias=(2e-3, 3e-3, 0.01),
        heading=0.01,
        height=20.0,
    )
    sequence = [(FAST, Fraction(30)), (FINE, Fraction(30)), (NORMAL, Fraction(5))]
    others = [(mode, Fraction(5)) for mode in SCHEDULE.modes if mode.name in ("directional-gyro", "basic")]
    runs = run_modes(in_c, SCHEDULE, [*sequence, *others], sensors)
    for before, behind in pairwise(runs):
        for name in ("attitude_state", "level_level_velocity", "vertical_height", "vertical_climb"):
            one, other = (np.asarray(run.values[name]) for run in (before, behind))
            # The step of a cycle in the second before or behind, which itself changes by a part of T/tau.
            ordinary = max(np.abs(np.diff(part, axis=0)).max() for part in (one[-100:], other[:100]))
            assert np.abs(other[0] - one[-1]).max() <= 1.01 * ordinary, name


@pytest.mark.long
def test_error_feedback_lets_slow_loops_settle(in_c):
    parts = [(FAST, Fraction(30)), (FINE, Fraction(150)), (NORMAL, Fraction(3600))]
    double, without, fed = (
        apart(run_modes(one, SCHEDULE, parts, SENSORS)[-1])
        for one in (in_c, runner("c-fixed32", "none"), runner("c-fixed32", "all"))
    )
    # 3600 s are fifteen time constants.
    assert double[0] < 1e-8
    assert without[0] > 1e-5
    assert fed[0] < 2e-7
    assert fed[1] < without[1] / 10
