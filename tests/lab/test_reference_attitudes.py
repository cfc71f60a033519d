"""Attitudes that are integrated: they meet closed forms, and a finer grid changes nothing that counts."""

from __future__ import annotations

import math

import numpy as np
import pytest

import strapgen
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions import rate_profiles
from strapgen.lab.motions.rate_profiles import KNOT, ReferenceAttitude

#: What the reference may be off after 60 s, in rad; runs are compared with it down to 3e-12 rad (1e-8 deg/h).
ACCURACY = 5e-13


def test_a_cone_meets_its_closed_form_at_any_time():
    cone = strapgen.motion("cone", half_angle_deg=5, frequency_hz=10, spin_deg_s=100)
    times = np.array([0.0, KNOT, 0.57, 1.234567, 1.23, 0.0001, 7.0, 6.999999])
    reference = ReferenceAttitude(cone.rate, 16)
    np.testing.assert_allclose(reference(times), cone.attitude(times), atol=ACCURACY)
    # Times come in any shape, and what was integrated before is used again.
    np.testing.assert_array_equal(reference(times.reshape(2, 4))[1, 2], reference(7.0))


def test_no_bit_depends_on_what_was_asked_for_before():
    """Runs of several lengths share an attitude, in one process or in many."""
    profile = rate_profiles.random_rate(math.radians(60))
    once, in_steps = (ReferenceAttitude(profile.rate, profile.substeps) for _ in range(2))
    times = np.linspace(0, 3, 31)
    for time in times[::7]:
        in_steps(time)
    np.testing.assert_array_equal(once(times), in_steps(times))


@pytest.mark.long
@pytest.mark.parametrize(
    "profile",
    [
        pytest.param(rate_profiles.random_rate(math.radians(200)), id="random"),
        pytest.param(rate_profiles.slew(0.05, math.radians(300)), id="soft slew"),
        pytest.param(rate_profiles.slew(0.01, math.radians(300)), id="sharp slew"),
        pytest.param(rate_profiles.ramps(0.05, math.radians(300)), id="ramps"),
        pytest.param(rate_profiles.vibration_rate(math.radians(0.1), math.inf), id="vibration"),
    ],
)
def test_half_the_substep_changes_nothing_that_counts(profile):
    """The runs of 60 s have eight slews; the first is over after 5 s."""
    times = np.array([3.0, 3.5, 4.0, 5.0])
    coarse, fine = (ReferenceAttitude(profile.rate, n * profile.substeps)(times) for n in (1, 2))
    np.testing.assert_allclose(coarse, fine, atol=ACCURACY)


def test_a_kink_beside_the_grid_would_count():
    """That is why ramps begin and end on it."""
    profile = rate_profiles.ramps(0.05, math.radians(300))
    beside = [
        ReferenceAttitude(lambda t: profile.rate(t + 0.0003), n * profile.substeps)(5.0) for n in (1, 2)
    ]
    assert np.abs(beside[0] - beside[1]).max() > 100 * ACCURACY


def test_times_before_0_are_refused():
    with pytest.raises(InputError, match="time is -1 s; the attitude is integrated from 0 on"):
        strapgen.motion("random", rate_deg_s=10).attitude([0.0, -1.0])
