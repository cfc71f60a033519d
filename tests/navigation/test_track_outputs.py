"""Outputs of a navigator along its track, on a vehicle whose velocity and acceleration are known."""

import numpy as np

import strapgen
from strapgen.lab.motions.motions import motion

#: Axes north, east, down of those east, north, up.
TO_NORTH = np.array([[0.0, 1, 0], [1, 0, 0], [0, 0, -1]])


def test_a_coordinated_turn_has_its_acceleration_across_the_track():
    course, times = motion("turn", bank_deg=30, speed_m_s=200, heading_deg=0), np.linspace(0, 60, 241)
    velocity, acceleration = (part @ TO_NORTH.T for part in course.controls.velocity(times))
    track, speed = strapgen.evaluator("track-angle")(velocity)
    path = strapgen.evaluator("flight-path-angle")(velocity)
    along, across, up, ahead = strapgen.evaluator("track-accelerations")(acceleration, track, path)
    rate = strapgen.evaluator("track-angle-rate")(across, speed)
    expected = 9.80665 * np.tan(course.controls.angles(times)[0][0]) / 200
    assert np.allclose(speed, 200) and np.allclose(path, 0)
    for none in (along, up, ahead):
        assert np.allclose(none, 0, atol=1e-12)
    assert np.allclose(rate, expected, rtol=0, atol=1e-14)
    turned = np.diff(np.unwrap(track)) / np.diff(times)
    assert np.allclose(turned, (rate[1:] + rate[:-1]) / 2, rtol=0, atol=2e-4)


def test_a_climb_that_accelerates_has_its_acceleration_along_the_path():
    velocity, angle = np.array([30.0, 40.0, -50.0]), np.pi / 4
    assert np.isclose(strapgen.evaluator("flight-path-angle")(velocity), angle)
    track, _ = strapgen.evaluator("track-angle")(velocity)
    along, across, up, ahead = strapgen.evaluator("track-accelerations")(velocity / 25, track, angle)
    assert np.allclose([along, across, up, ahead], [2, 0, 2, np.hypot(2, 2)])


def test_drift_and_wind_belong_together():
    """100 m/s to the north through air that moves to the east: the wind comes from the west, the drift is right."""
    velocity = np.array([100.0, 20.0, 0.0])
    speed, direction = strapgen.evaluator("wind")(velocity, 100.0, 0.0)
    assert np.allclose([speed, np.degrees(direction)], [20, -90])
    track, _ = strapgen.evaluator("track-angle")(velocity)
    drift = strapgen.evaluator("drift-angle")
    assert np.isclose(drift(track, 0.0), np.arctan(0.2))
    assert np.isclose(drift(-3.0, 3.0), 2 * np.pi - 6)


def test_the_rate_of_the_track_is_limited_at_rest():
    assert strapgen.evaluator("track-angle-rate")(1.0, 0.0) == 1 / (1852 * 20 / 3600)
