"""Rest of a gyro: found where a motion is not, its mean beside what was put in, and the Earth's rate in it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapgen import backend
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.lab.recordings.attitude_output import attitude_of
from strapgen.lab.recordings.recording import Recording, propagate
from strapgen.lab.recordings.rest import (
    EARTH_RATE_RAD_S,
    earth_rate,
    longest_rest,
    rest_between,
    rests,
    without_earth,
    without_rate,
)

HZ = 100
BIAS = np.radians([0.2, -0.4, 0.1])
#: Angle random walk in rad/sqrt(s).
WALK = math.radians(0.3) / 60


def gyro(*parts: tuple[str, float], seed: int = 1, step_deg_s: float = 0.0) -> Recording:
    """Return the recording of a gyro that rests or moves for so many seconds each; it starts at 7 s."""
    rates = []
    for kind, seconds in parts:
        time = np.arange(round(seconds * HZ)) / HZ
        turn = {
            "rest": np.zeros((len(time), 3)),
            "swing": np.stack([np.sin(3 * time), np.cos(5 * time), np.sin(time)], axis=1),
            "spin": np.tile([0, 0, math.radians(30)], (len(time), 1)),
            "creep": np.outer(np.linspace(0, 1, len(time)), np.radians([4, 0, 0])),
        }[kind]
        rates.append(turn)
    rate = np.concatenate(rates) + BIAS
    rate += np.random.default_rng(seed).normal(0, WALK * math.sqrt(HZ), rate.shape)
    if step_deg_s:
        rate = np.radians(step_deg_s * np.round(np.degrees(rate) / step_deg_s))
    return Recording(7.0, 1 / HZ, rate / HZ)


@pytest.mark.parametrize("step_deg_s", [0.0, 0.0175, 0.1])
def test_rests_are_found_between_motions(step_deg_s):
    found = rests(
        gyro(("rest", 5), ("swing", 6), ("rest", 10), ("spin", 8), ("rest", 3), step_deg_s=step_deg_s)
    )
    assert [rest.start_s for rest in found] == pytest.approx([7, 18, 36])
    assert [rest.end_s for rest in found] == pytest.approx([12, 28, 39])
    longest = max(found, key=lambda rest: rest.end_s - rest.start_s)
    assert (np.abs(longest.rate - BIAS) < 5 * longest.uncertainty + math.radians(step_deg_s) / 20).all()


@pytest.mark.parametrize("motion", ["swing", "spin", "creep"])
def test_motion_is_no_rest(motion):
    """A turn at a constant rate has no variance, and a slow one that changes little."""
    recording = gyro((motion, 20))
    total = sum(rest.end_s - rest.start_s for rest in rests(recording))
    assert total == 0 or motion == "creep"
    if motion != "creep":
        with pytest.raises(InputError, match=r"^the gyro never rests for 2 s; --bias-from"):
            longest_rest(recording)


def test_uncertainty_and_noise_are_those_that_are_put_in():
    errors, stated, walks = [], [], []
    for seed in range(40):
        rest = rest_between(gyro(("rest", 20), seed=seed), 7, 27)
        errors.append(rest.rate - BIAS)
        stated.append(rest.uncertainty)
        walks.append(rest.noise)
    assert np.std(errors) == pytest.approx(np.mean(stated), rel=0.2)
    assert np.mean(walks) == pytest.approx(WALK, rel=0.05)


def test_bias_that_is_taken_off_is_gone():
    recording = gyro(("swing", 5))
    left = without_rate(recording, BIAS)
    np.testing.assert_allclose(left.samples * HZ + BIAS, recording.samples * HZ, atol=1e-15)
    assert (left.start, left.interval) == (recording.start, recording.interval)


@pytest.mark.parametrize(("begin", "end"), [(6, 9), (7, 40), (9, 9.05), (12, 8)])
def test_interval_outside_is_refused(begin, end):
    with pytest.raises(InputError, match=r"^bias from .* between 7 s and 12 s are needed$"):
        rest_between(gyro(("rest", 5)), begin, end)


def test_array_is_no_recording():
    with pytest.raises(InputTypeError, match="a Recording is needed"):
        rests(np.zeros((5, 3)))


# The Earth


@pytest.mark.parametrize(("axes", "up"), [("ned", (0, 0, -1)), ("enu", (0, 0, 1))])
@pytest.mark.parametrize("latitude", [-33.9, 0, 48.1, 90])
def test_rate_of_the_earth_points_to_the_pole(latitude, axes, up):
    rate = earth_rate(latitude, axes)
    assert np.linalg.norm(rate) == pytest.approx(EARTH_RATE_RAD_S)
    assert rate @ up == pytest.approx(EARTH_RATE_RAD_S * math.sin(math.radians(latitude)))
    assert rate[0 if axes == "ned" else 1] >= 0


@pytest.mark.parametrize("latitude", [91, math.nan])
def test_latitude_outside_is_refused(latitude):
    with pytest.raises(InputError, match=r"^latitude is "):
        earth_rate(latitude)


def test_attitude_on_the_earth_is_what_is_left():
    """An hour on the Earth: of the rate that gyros sense, the turn against level axes is left."""
    rate, step = earth_rate(48.1), 0.5
    time = np.arange(7200) * step
    level = Rotation.from_rotvec(
        np.stack([0.8 * np.sin(time / 200), 0.5 * np.cos(time / 300), time / 900], axis=1)
    )
    inertial = Rotation.from_rotvec(time[:, None] * rate) * level
    inertial = inertial[0].inv() * inertial
    sensed = (inertial[:-1].inv() * inertial[1:]).as_rotvec()
    # The reference axes are those of the body at the start.
    seen = level[0].inv().apply(rate)
    recording = Recording(0.0, step, sensed)
    run = backend("euler", "rk4", 1)
    left = propagate(run, without_earth(recording, propagate(run, recording), seen))
    error = Rotation.from_quat(attitude_of(left)) * (level[0].inv() * level).inv()
    assert np.degrees(error.magnitude()).max() < 2e-4
    plain = Rotation.from_quat(attitude_of(propagate(run, recording))) * (level[0].inv() * level).inv()
    assert np.degrees(plain.magnitude()).max() == pytest.approx(15.04, rel=1e-3)
