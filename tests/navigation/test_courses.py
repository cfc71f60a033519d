"""Algorithms in two speeds along a recording: the wobble on one spot, whose attitude and velocity are known."""

from __future__ import annotations

import csv
import io
import json
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from precisions import precision

from strapgen import evaluator
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.lab.motions.motions import motion
from strapgen.lab.recordings.recording import InertialRecording, read_inertial
from strapgen.lab.runs import drift_between
from strapgen.navigation.courses import CourseResult, NavigationFrame, course, course_table
from strapgen.navigation.two_speed.two_speed_sources import ALGORITHMS

LOG = Path(__file__).resolve().parents[2] / "examples" / "inertial_log.csv"
GRAVITY = 9.80665
#: What rounding may make of ten seconds of the wobble, in rad: 250 slow cycles of some last places of what is summed.
ROUNDING = {"float": 2e-5, "32": 1e-7, "16": 2e-3}


@pytest.fixture(scope="module")
def wobble() -> InertialRecording:
    return read_inertial(LOG)


def still(count: int, velocity=(0.0, 0.0, 0.0)) -> InertialRecording:
    return InertialRecording(0.0, 0.01, np.zeros((count, 3)), np.tile(velocity, (count, 1)))


@pytest.mark.long
@pytest.mark.parametrize("sculling", [1, 2])
@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_wobble_on_one_spot(algorithm, sculling, backend_name, wobble):
    made = course(algorithm, wobble, fast_cycles=4, slow_cycles=25, sculling=sculling, backend=backend_name)
    np.testing.assert_allclose(made.time, np.arange(1, 11))
    true = motion("coning", a_deg_s=20, b_deg_s=200, g_deg_s=5).attitude(made.time)
    computed = evaluator("dcm-from-euler-angles")(made.angles)
    # The first cycle knows no increment before it: a twelfth of their cross product is missing.
    missing = np.linalg.norm(np.cross(*wobble.samples[:2])) / 12
    allowed = 1.5 * missing + ROUNDING.get(precision(backend_name), 1e-9)
    assert np.linalg.norm(drift_between(computed, true), axis=-1).max() <= allowed
    # (47) leaves out the square of the angle of a slow cycle: up to a sixth of it, of the whole reaction to gravity.
    angle = np.linalg.norm(wobble.samples, axis=-1).max() * 4
    left_out = angle**2 / 6 * GRAVITY
    rounding = {"float": 1e-4, "16": 0.2}.get(precision(backend_name), 1e-6)
    assert np.abs(made.velocity_changes - [0, 0, GRAVITY]).max() <= left_out + rounding


def test_the_frame_turns_the_other_way():
    """Without any motion of the body in space, a frame that turns to the left sees it turn to the right."""
    made = course(
        "euler", still(100), fast_cycles=5, slow_cycles=4, frame=NavigationFrame(frame_rate=[0, 0, 0.1])
    )
    np.testing.assert_allclose(made.angles[:, 2], -0.1 * made.time, atol=1e-9)


def test_initial_angles():
    """A body on its nose feels the reaction to gravity along its tail; roll and heading stay what they were."""
    start = [0.3, np.pi / 2, 1.0]
    forward = -GRAVITY * 0.01
    made = course("dcm", still(20, (forward, 0, 0)), fast_cycles=4, frame=NavigationFrame(start))
    np.testing.assert_allclose(made.angles, np.tile(start, (5, 1)), atol=1e-15)
    np.testing.assert_allclose(made.velocity_changes, np.tile([0, 0, 4 * GRAVITY * 0.01], (5, 1)), atol=1e-15)


def test_incomplete_cycles_are_reported(wobble):
    made = course("dcm", wobble, fast_cycles=3, slow_cycles=7)
    assert (len(made.time), made.unused) == (47, 13)
    said = CourseResult({"backend": "numpy"}, made).text()
    assert "13 increments at the end fill no navigation cycle" in said
    assert "of 47 cycles; --format csv prints all" in said


def test_ranges_that_are_stated_hold(wobble):
    narrow = Settings(ranges={"coning": Fraction(1, 10**7)})
    with pytest.raises(InputError, match="two-speed-fast-2 refuses its input"):
        course("dcm", wobble, fast_cycles=4, backend="c-fixed32", settings=narrow)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"algorithm": "cayley-klein"}, "algorithm 'cayley-klein' is not known"),
        ({"fast_cycles": 0}, "fast_cycles"),
        ({"slow_cycles": 300}, "the recording holds 1000 increments; a navigation cycle needs 1200"),
        ({"sculling": 3}, "sculling"),
        ({"backend": "c-q7"}, "backend 'c-q7' is not known"),
        ({"frame": NavigationFrame([0, 0])}, "initial_angles has 2 numbers; 3 are needed"),
        ({"frame": NavigationFrame(["up", 0, 0])}, "initial_angles is 'up'"),
        ({"frame": NavigationFrame(frame_rate=[0, np.nan, 0])}, "frame_rate"),
        ({"settings": Settings()}, "numpy"),
    ],
)
def test_invalid_input_is_refused(options, says, wobble):
    with pytest.raises(InputError, match=says):
        course(**({"algorithm": "dcm", "recording": wobble, "fast_cycles": 4} | options))


def test_reports_hold_every_number(wobble):
    made = course("euler", wobble, fast_cycles=4, slow_cycles=25)
    data = json.loads(json.dumps(CourseResult({"backend": "numpy"}, made).data(), allow_nan=False))
    assert data["attitude"] == made.states.tolist()
    assert data["velocity_changes_m_s"] == made.velocity_changes.tolist()
    rows = list(csv.DictReader(io.StringIO(course_table(made).as_csv())))
    assert [float(row["time_s"]) for row in rows] == data["time_s"]
    for name in ("roll_deg", "pitch_deg", "heading_deg"):
        assert [float(row[name]) for row in rows] == data[name]
    np.testing.assert_array_equal(
        [[float(row[f"dv{axis}_m_s"]) for axis in "xyz"] for row in rows], made.velocity_changes
    )
    np.testing.assert_array_equal([[float(row[e]) for e in made.elements] for row in rows], made.states)
