"""Motions as numbers: parameters, increments that add up, truth that stays a rotation."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import quad
from tolerances import roundoff

import strapgen
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions import rate_profiles
from strapgen.lab.motions.motions import motion
from strapgen.lab.motions.rate_profiles import KNOT, ReferenceAttitude
from strapgen.lab.motions.specific_forces import force

CLOSED = {
    "constant": {"x_deg_s": 3, "y_deg_s": -5, "z_deg_s": 7},
    "sinusoidal": {"a_deg_s": 10, "b_deg_s": 20},
    "coning": {"a_deg_s": 10, "b_rad_s": -0.3, "g_deg_s": 4},
    "polynomial": {"a0": 1, "a1": 0.2, "a2": -0.03, "a3": 0.004, "a4": -0.0005},
}

#: Those whose attitude is integrated, by what is special about them.
INTEGRATED = {
    "random": {"rate_deg_s": 200},
    "slew": {"onset_s": 0.05},
    "sharp slew": {"onset_s": 0.0001},
    "ramps": {"onset_s": 0.05},
    "vibration": {"angle_deg": 0.1},
}

#: What the reference may be off after 60 s, in rad; runs are compared with it down to 3e-12 rad (1e-8 deg/h).
ACCURACY = 5e-13

CONE = motion("coning", a_deg_s=40, b_deg_s=70, g_deg_s=20)
TENTH = Fraction(1, 10)


def motion_of(name: str) -> strapgen.Motion:
    return strapgen.motion(name.split()[-1], **(CLOSED | INTEGRATED)[name])


def test_previous_increments_raise_the_order_of_a_slow_gyro():
    motion = strapgen.motion("coning", **CLOSED["coning"])

    def error(previous: int, step: Fraction) -> float:
        backend = strapgen.backend("euler", "rk4", 1, "numpy", previous=previous)
        return float(np.abs(strapgen.simulate(backend, motion, step, 4).error).max())

    coarse, fine = Fraction(1, 10), Fraction(1, 20)
    orders = [np.log2(error(previous, coarse) / error(previous, fine)) for previous in (0, 1, 2)]
    assert orders == pytest.approx([2, 3, 4], abs=0.2)


@pytest.mark.long
@pytest.mark.parametrize("name", CLOSED)
def test_a_fine_run_meets_the_truth(name, backend_name):
    motion = strapgen.motion(name, **CLOSED[name])
    backend = strapgen.backend("euler", "rk4", 2, backend_name)
    run = strapgen.simulate(backend, motion, Fraction(1, 200), 4)
    # Truncation at this step is below 1e-12; 800 steps of round-off, doubled by the conversion.
    assert np.abs(run.error).max() <= 1e-12 + 2 * roundoff(backend, 800)


@pytest.mark.parametrize("name", CLOSED)
def test_truth_is_a_rotation_that_starts_at_the_identity(name):
    attitude = strapgen.motion(name, **CLOSED[name]).attitude(np.linspace(0, 180, 50))
    np.testing.assert_array_equal(attitude[0], np.eye(3))
    np.testing.assert_allclose(
        attitude @ np.swapaxes(attitude, 1, 2), np.broadcast_to(np.eye(3), (50, 3, 3)), atol=1e-14
    )


def test_removable_singularities():
    still = strapgen.motion("constant", x_deg_s=0)
    np.testing.assert_array_equal(still.attitude([0.0, 5.0]), np.broadcast_to(np.eye(3), (2, 3, 3)))
    # b = 0: a constant rate about y, and about (0, g, a).
    slow = strapgen.motion("sinusoidal", a_deg_s=10, b_deg_s=0)
    steady = strapgen.motion("constant", y_deg_s=10)
    np.testing.assert_allclose(slow.attitude(7.0), steady.attitude(7.0), atol=1e-15)
    cone = strapgen.motion("coning", a_deg_s=10, b_deg_s=0, g_deg_s=3)
    steady = strapgen.motion("constant", y_deg_s=3, z_deg_s=10)
    np.testing.assert_allclose(cone.attitude(7.0), steady.attitude(7.0), atol=1e-15)
    np.testing.assert_allclose(
        cone.increments(Fraction(1), 2, 2), steady.increments(Fraction(1), 2, 2), atol=1e-16
    )
    # s = 0: a = 0, g = -b.
    cone = strapgen.motion("coning", a_deg_s=0, b_deg_s=5, g_deg_s=-5)
    np.testing.assert_allclose(
        cone.attitude(7.0), strapgen.motion("constant", y_deg_s=-5).attitude(7.0), atol=1e-15
    )


def test_the_axis_of_a_cone_keeps_its_angle_while_the_body_spins_about_it():
    cone = strapgen.motion("cone", half_angle_deg=20, frequency_hz=0.5, spin_deg_s=30)
    attitude = cone.attitude(np.linspace(0, 2, 33))
    tip = attitude[:, :, 1]
    centre = tip[:-1].mean(axis=0)
    np.testing.assert_allclose(tip @ centre / np.linalg.norm(centre), math.cos(math.radians(20)), atol=1e-14)
    # After a period of 2 s the axis is back, and the body has turned by 60 degrees about it.
    turned = strapgen.motion("constant", y_deg_s=30).attitude(2.0)
    np.testing.assert_allclose(attitude[-1], turned, atol=1e-14)
    np.testing.assert_allclose(cone.rate(0.7)[1], cone.rate(0)[1], rtol=1e-15)


@pytest.mark.parametrize(
    ("name", "settings", "words"),
    [
        ("spin", {}, "motion 'spin' is not known; allowed: constant, sinusoidal, coning, polynomial"),
        ("coning", {"a_deg_s": 1, "b_deg_s": 1}, "motion coning lacks g_deg_s or g_rad_s"),
        ("coning", {"c_deg_s": 1}, "key of motion coning: 'c_deg_s' is not known \\(did you mean a_deg_s"),
        ("sinusoidal", {"a_deg_s": 1, "b_deg_s": 1, "b_rad_s": 1}, "b_deg_s and b_rad_s are both given"),
        ("constant", {}, "motion constant needs parameters; allowed: x_deg_s"),
        ("constant", {"x_deg_s": "nan"}, "x_deg_s is 'nan'; a finite number is needed"),
        ("constant", {"x_deg_s": float("inf")}, "x_deg_s is 'inf'"),
        ("constant", {"x_deg_s": "ten"}, "x_deg_s is 'ten'"),
        ("random", {}, "motion random needs parameters; allowed: rate_deg_s, rate_rad_s"),
        ("slew", {"rate_deg_s": 1}, "motion slew lacks onset_s"),
        ("slew", {"onset_s": 0}, "onset_s is 0; 0.0001 to 1.2 is needed"),
        ("slew", {"onset_s": "1e308"}, "onset_s is 1e[+]308; 0.0001 to 1.2 is needed"),
        ("ramps", {"onset_s": "1e308"}, "onset_s is 1e[+]308; 0.0001 to 1.2 is needed"),
        ("ramps", {"onset_s": 0.0501}, "onset_s is 0.0501; a multiple of 0.01/16 s is needed"),
        ("vibration", {"gyro_hz": 40}, "motion vibration lacks angle_deg or angle_rad"),
        ("vibration", {"angle_deg": 1, "gyro_hz": -1}, "gyro_hz is -1; at least 0.001 is needed"),
    ],
)
def test_invalid_settings_are_refused(name, settings, words):
    with pytest.raises(InputError, match=words):
        strapgen.motion(name, **settings)


@pytest.mark.long
@pytest.mark.parametrize("first", [-3, 299, 420])
@pytest.mark.parametrize("name", [*CLOSED, *INTEGRATED])
def test_increments_integrate_the_rate(name, first):
    """Before time 0, in the first onset and at the end of the first slew; neighbours leave no gap."""
    profile, interval = motion_of(name), Fraction(1, 100)
    onset = (3.0037, 4.2037, 3.003125, 3.053125, 4.203125, 4.253125)
    for k, increment in enumerate(profile.samples(interval, first, first + 3), first):
        span = k / 100, (k + 1) / 100
        kinks = [time for time in onset if span[0] < time < span[1]] or None
        for axis in range(3):
            integral, _ = quad(
                lambda t, axis=axis: profile.rate(t)[axis], *span, epsabs=1e-15, points=kinks, limit=200
            )
            # Each end of the interval is known to half a unit of its last place, times 5 rad/s.
            assert increment[axis] == pytest.approx(integral, abs=2e-14)


def test_the_random_rate_has_its_size_and_its_band():
    """A cosine of amplitude 1 has the mean square 1/2; no two of an axis have the same frequency."""
    rate = rate_profiles.random_rate(2.0)
    np.testing.assert_allclose((rate.amplitudes**2 / 2).sum(axis=1), 4.0, rtol=1e-14)
    hertz = rate.frequencies / (2 * math.pi)
    assert hertz.shape == (3, 30)
    assert hertz.min() >= 0.2 and hertz.max() < 50 / 3
    assert all(len({*row}) == 30 for row in hertz.round(9))
    # The first of each axis by hand: frac(sqrt 2), frac(sqrt 7).
    assert hertz[0, 0] == pytest.approx(0.2 + (50 / 3 - 0.2) * 0.41421356237309515)
    assert rate.phases[0, 0] == pytest.approx(2 * math.pi * 0.6457513110645906)


def test_a_slew_has_its_rate_between_its_onsets_and_none_after():
    sway = rate_profiles.slew(0.05, 0.0)
    for name, onset in (("slew", 0.05), ("ramps", 0.05), ("sharp slew", 0.0001)):
        profile = motion_of(name)
        for k in (0, 7):
            middle = 3.0037 + 7 * k + 0.6
            axis = np.sin([1.7 * k + 0.3, 2.3 * k + 1.1, 2.9 * k + 2.0])
            rate = profile.rate(middle) - sway.rate(middle)
            # tanh(0.6/0.05) is 1 but for 4e-11.
            np.testing.assert_allclose(
                rate, math.radians(300) * axis / np.linalg.norm(axis), rtol=1e-9, err_msg=f"{name} {onset}"
            )
            after = middle + 3.5
            np.testing.assert_allclose(profile.rate(after), sway.rate(after), atol=1e-12)


def test_a_ramp_is_linear_and_keeps_to_its_times():
    profile, sway = motion_of("ramps"), rate_profiles.slew(0.05, 0.0)
    start = 0.01 * (300 + 700 + 5 / 16)
    times = start + np.array([-0.001, 0.0, 0.0125, 0.025, 0.05, 0.06, 1.2, 1.225, 1.25, 1.3])
    size = np.linalg.norm(profile.rate(times) - sway.rate(times), axis=1) / math.radians(300)
    np.testing.assert_allclose(size, [0, 0, 0.25, 0.5, 1, 1, 1, 0.5, 0, 0], atol=1e-12)


def test_a_vibration_has_its_angle_and_y_comes_a_quarter_period_after_x():
    profile = rate_profiles.vibration_rate(0.003, math.inf)
    angles = profile.amplitudes / profile.frequencies
    np.testing.assert_allclose(np.sqrt((angles**2 / 2).sum(axis=1)), 0.003, rtol=1e-14)
    np.testing.assert_allclose(angles, angles[0, 0])
    np.testing.assert_allclose(profile.frequencies[0] / (2 * math.pi), np.linspace(2, 30, 40))
    np.testing.assert_allclose(profile.phases[0] - profile.phases[1], math.pi / 2)
    assert abs(np.exp(1j * (profile.phases[0] - profile.phases[2])).sum()) < 20  # forty would be in step


def test_the_gyro_filter_is_a_butterworth_filter():
    profile = rate_profiles.vibration_rate(0.003, math.inf)
    cutoff, s = 2 * math.pi * 40, 1j * profile.frequencies[0]
    # The poles of the filter lie on a circle.
    first, second = cutoff * np.exp(1j * np.pi * np.array([3, 5]) / 4)
    response = cutoff**2 / ((s - first) * (s - second))
    filtered = rate_profiles.vibration_rate(0.003, 40.0).measured
    before = profile.amplitudes * np.exp(1j * profile.phases)
    np.testing.assert_allclose(
        filtered.amplitudes * np.exp(1j * filtered.phases), before * response, rtol=1e-12
    )


def test_a_gyro_filters_samples_and_not_the_truth():
    ideal, seen = (strapgen.motion("vibration", angle_deg=0.1, **gyro) for gyro in ({}, {"gyro_hz": 40}))
    np.testing.assert_array_equal(ideal.rate(0.3), seen.rate(0.3))
    np.testing.assert_array_equal(ideal.attitude(0.3), seen.attitude(0.3))
    lag = np.abs(ideal.samples(Fraction(1, 100), 0, 9) - seen.samples(Fraction(1, 100), 0, 9)).max()
    assert lag > 1e-4
    wide = strapgen.motion("vibration", angle_deg=0.1, gyro_hz=1e9)
    np.testing.assert_allclose(
        wide.samples(Fraction(1, 100), 0, 9), ideal.samples(Fraction(1, 100), 0, 9), atol=1e-9
    )


def test_a_cone_meets_its_closed_form_at_any_time():
    cone = strapgen.motion("cone", half_angle_deg=5, frequency_hz=10, spin_deg_s=100)
    times = np.array([0.0, KNOT, 0.57, 1.234567, 1.23, 0.0001, 7.0, 6.999999])
    reference = ReferenceAttitude(cone.rate, 16)
    np.testing.assert_allclose(reference(times), cone.attitude(times), atol=ACCURACY)
    # Times come in any shape, and what was integrated before is used again.
    np.testing.assert_array_equal(reference(times.reshape(2, 4))[1, 2], reference(7.0))


def test_results_do_not_depend_on_earlier_calls():
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
def test_the_reference_has_converged(profile):
    """The runs of 60 s have eight slews; the first is over after 5 s."""
    times = np.array([3.0, 3.5, 4.0, 5.0])
    coarse, fine = (ReferenceAttitude(profile.rate, n * profile.substeps)(times) for n in (1, 2))
    np.testing.assert_allclose(coarse, fine, atol=ACCURACY)


def test_a_kink_off_the_grid_loses_accuracy():
    """That is why ramps begin and end on it."""
    profile = rate_profiles.ramps(0.05, math.radians(300))
    beside = [
        ReferenceAttitude(lambda t: profile.rate(t + 0.0003), n * profile.substeps)(5.0) for n in (1, 2)
    ]
    assert np.abs(beside[0] - beside[1]).max() > 100 * ACCURACY


def test_times_before_0_are_refused():
    with pytest.raises(InputError, match="time is -1 s; the attitude is integrated from 0 on"):
        strapgen.motion("random", rate_deg_s=10).attitude([0.0, -1.0])


def test_increments_are_the_integrals_of_the_force():
    waves = force("oscillation", swing_x_m_s2=3, swing_z_m_s2=2, frequency_hz=4, phase_deg=30, y_g="0.5")

    def along_x(t):
        return 3 * np.cos(8 * np.pi * t + np.pi / 6)

    increments = waves.velocity_increments(CONE, TENTH, -1, 2)
    expected = [quad(along_x, k / 10, (k + 1) / 10)[0] for k in (-1, 0, 1)]
    np.testing.assert_allclose(increments[:, 0], expected, atol=1e-14)
    np.testing.assert_allclose(increments[:, 1], 0.0980665 * 5, rtol=1e-14)


def test_a_random_force_has_its_size_and_no_power_above_its_band():
    noise = force("random", rms_m_s2=2)
    rows = noise.velocity_increments(CONE, Fraction(1, 500), 0, 50_000)
    np.testing.assert_allclose(np.sqrt((rows**2).mean(axis=0)) * 500, 2, rtol=0.02)
    spectrum = np.abs(np.fft.rfft(rows * np.hanning(len(rows))[:, None], axis=0))
    above = np.fft.rfftfreq(len(rows), 1 / 500) > 17
    assert spectrum[above].max() < 1e-3 * spectrum.max()


def test_a_lever_moves_on_a_sphere_whose_velocity_and_position_the_increments_lead_to(rng):
    """A body that turns about a point at rest: both sides of the truth, increments and closed form, must agree."""
    arm = force("lever", x_m=1, y_m=2, z_m=-1)
    velocity, position = arm.translation(CONE, TENTH, 20)
    np.testing.assert_allclose(position[0], 0, atol=1e-15)
    turned = CONE.attitude(np.arange(21) / 10)
    start = turned[0] @ np.cross(CONE.rate(0.0), [1, 2, -1])
    moved = position + np.outer(np.arange(21) / 10, start)
    np.testing.assert_allclose(np.linalg.norm(moved + np.array([1, 2, -1]), axis=1), np.sqrt(6), rtol=1e-13)
    # Of short intervals the force is nearly constant: the sum of turned increments tends to the velocity.
    fine = [Fraction(1, 1000), Fraction(1, 2000)]
    errors = []
    for interval in fine:
        count = int(2 / interval)
        rows = arm.velocity_increments(CONE, interval, 0, count)
        middles = CONE.attitude((np.arange(count) + 0.5) * float(interval))
        errors.append(np.abs(np.einsum("kij,kj->i", middles, rows) - velocity[-1]).max())
    assert errors[0] < 1e-5
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.02)


def test_the_quadrature_of_the_truth_meets_a_closed_form():
    """A constant force on a body that turns about z: velocity and position are sines and cosines."""
    turn, push = motion("constant", z_rad_s=2), force("constant", x_m_s2=3)
    velocity, position = push.translation(turn, Fraction(1, 8), 40)
    t = np.arange(41) / 8
    np.testing.assert_allclose(
        velocity[:, :2], 1.5 * np.stack([np.sin(2 * t), 1 - np.cos(2 * t)], 1), atol=1e-13
    )
    np.testing.assert_allclose(
        position[:, :2], 0.75 * np.stack([1 - np.cos(2 * t), 2 * t - np.sin(2 * t)], 1), atol=1e-12
    )


def test_many_digits_need_a_closed_form():
    motion = strapgen.motion("random", rate_deg_s=10)
    with pytest.raises(
        InputError, match="the attitude of motion random has no closed form, which many digits need"
    ):
        strapgen.converge(strapgen.choose("euler"), motion, ["1/2", "1/4"], 1)
