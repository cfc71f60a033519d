"""Described systems on motions and recordings: what their sensors measure, and the attitude that follows."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from small_systems import COUNTING

from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motions import motion
from strapgen.lab.motions.specific_forces import velocity_increments
from strapgen.lab.recordings.recording import InertialRecording, Recording
from strapgen.lab.runs import simulate
from strapgen.navigation.systems.system_runner import system_runner
from strapgen.navigation.systems.system_runs import (
    attitude_output,
    cycles_of,
    matrices,
    rate_of,
    samples,
    simulate_system,
    system_course,
    system_history,
)
from strapgen.navigation.systems.wiring import described
from strapgen.run.backends import backend

EXAMPLE = Path(__file__).parents[2] / "examples" / "strapdown.toml"
CONING = motion("coning", a_deg_s=30, b_deg_s=40, g_deg_s=20)


@pytest.fixture
def counting(tmp_path):
    path = tmp_path / "counting.toml"
    path.write_text(COUNTING)
    return described(path)


def rewired(tmp_path, *changes):
    """Return the small system with some of its text replaced."""
    text = COUNTING
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "other.toml"
    path.write_text(text)
    return described(path)


def test_counts_are_whole_and_stay_within_half_a_count_of_the_angle(counting, rng):
    angle = rng.normal(0, 1e-3, (500, 3))
    counts = samples(counting, angle, np.zeros((500, 3)))["counts"]
    np.testing.assert_array_equal(counts, np.rint(counts))
    departure = np.cumsum(counts * 1e-5 - angle, axis=0)
    assert 0.4e-5 < np.abs(departure).max() <= 0.5e-5 * (1 + 1e-9)


def test_an_input_takes_increments_mean_rates_or_nothing_by_its_unit(tmp_path, rng):
    angle, velocity = rng.normal(0, 1e-3, (2, 10, 3))
    two_speed = described("two-speed-dcm", Fraction(100))
    read = samples(two_speed, angle, velocity)
    np.testing.assert_array_equal(read["gyro"], angle)
    np.testing.assert_array_equal(read["accelerometer"], velocity)
    assert not read["turn"].any()
    stage = '[[stage]]\nname = "gyro"\nkernel = "angle-counts"\nevery = 1\nwires = { count = "counts" }\n'
    direct = [(stage + 'constants = { scale = "1e-5" }\n', ""), ('"gyro.increment"', '"counts"')]
    step = [("every = 2", "every = 1"), ("increments = 2", "increments = 1"), ('"rk4"', '"rk1"')]
    rad = rewired(tmp_path, *direct, *step, ('unit = "1"', 'unit = "rad"'))
    np.testing.assert_array_equal(samples(rad, angle, velocity)["counts"], angle)
    strange = tmp_path / "strange.toml"
    strange.write_text(
        'sample_hz = 100\n[inputs.distance]\nunit = "m"\nframe = "n"\nrange = 1\n[[stage]]\nname = "part"\n'
        'kernel = "hold-3"\nevery = 1\nwires = { increment = "distance" }\nconstants = { share = "1/2" }\n'
    )
    with pytest.raises(InputError, match=r"input distance \(unit m, frame n\) is no gyro or accelerometer"):
        samples(described(strange), angle, velocity)


@pytest.mark.long
def test_sensors_have_the_errors_that_a_stage_compensates(rng):
    """Compensation of first order leaves less than a thousandth of the errors."""
    chain = described(EXAMPLE, Fraction(100))
    angle, velocity = rng.normal(0, 3e-3, (2, 20, 3)) + 5e-3
    read = samples(chain, angle, velocity)
    counts = read["gyro_counts"] * 14.544410433286079e-6
    error = np.abs(np.cumsum(counts - angle, axis=0)).max()
    assert error > 20 * 14.5e-6  # more than counts leave


def test_velocity_increments_are_the_integral_of_a_force_that_turns():
    """About z by w: the integral of (cos wt, -sin wt) has a closed form."""
    w, h = 2.0, Fraction(1, 50)
    spin = motion("constant", z_rad_s=w)
    edges = np.arange(101) * float(h)
    expected = np.stack([np.sin(w * edges), np.cos(w * edges) - 1, 0 * edges], axis=-1) * 9.81 / w
    increments = velocity_increments(spin.attitude, (9.81, 0, 1), h, 100)
    # Gauss's rule with 4 nodes: (wh)^9 / 4e8 of the force.
    np.testing.assert_allclose(increments[:, :2], np.diff(expected, axis=0)[:, :2], atol=1e-14)
    np.testing.assert_allclose(increments[:, 2], float(h), rtol=1e-14)
    assert not velocity_increments(spin.attitude, (0, 0, 0), h, 3).any()


def test_a_system_runs_as_its_attitude_step_does(counting):
    """Counts of the same size, from the same motion, give the same attitude."""
    run = simulate_system(system_runner(counting), CONING, Fraction(2), Fraction(1, 10))
    step = simulate(backend("euler", "rk4", 2), CONING, "0.02", "2", record="0.1", pulse=1e-5)
    np.testing.assert_allclose(run.time, step.time, rtol=1e-15)
    np.testing.assert_allclose(run.computed, step.computed, atol=1e-14)
    np.testing.assert_array_equal(run.true, step.true)


def test_another_start_turns_the_errors(counting):
    turned = motion("constant", x_deg_s=50, z_deg_s=-70).attitude(1.0)
    runner = system_runner(counting)
    plain = simulate_system(runner, CONING, Fraction(1))
    other = simulate_system(runner, CONING, Fraction(1), start=turned)
    np.testing.assert_allclose(other.error, turned @ plain.error @ turned.T, atol=1e-14)
    assert np.abs(plain.error).max() > 1e-7


def test_a_recording_of_a_motion_gives_its_attitude(counting):
    log = Recording(5.0, 0.01, CONING.samples(Fraction(1, 100), 0, 101))
    assert rate_of(log) == 100
    runner = system_runner(counting)
    history = system_history(runner, log)
    run = simulate_system(runner, CONING, Fraction(1))
    cell = attitude_output(runner.system)
    np.testing.assert_array_equal(matrices(cell.signal, history.states), run.computed)
    np.testing.assert_allclose(history.time, 5 + run.time, rtol=1e-15)
    assert history.unused == 1


def test_outputs_along_a_recording_stand_at_the_slowest_of_their_rates(rng):
    description = described("two-speed-euler", Fraction(100))
    angle, velocity = rng.normal(0, 1e-3, (2, 47, 3))
    course = system_course(system_runner(description), InertialRecording(0.0, 0.01, angle, velocity))
    time, rows = course.rows()
    assert description.system.cycle == 10 and course.unused == 7
    np.testing.assert_allclose(time, [0.1, 0.2, 0.3, 0.4], rtol=1e-15)
    np.testing.assert_array_equal(rows["slow_state"], course.values["slow_state"][4::5])
    np.testing.assert_array_equal(rows["nav_velocity_change"], course.values["nav_velocity_change"])


def test_systems_that_cannot_run_are_refused_by_name(counting, tmp_path):
    runner = system_runner(counting)
    with pytest.raises(InputError, match=r"0.03 s are no whole number of cycles of the slowest rate, 0.02 s"):
        cycles_of(counting.system, Fraction(3, 100))
    with pytest.raises(InputError, match=r"record"):
        simulate_system(runner, CONING, Fraction(1), Fraction(3, 100))
    with pytest.raises(InputError, match=r"holds 1 increments; a cycle of the slowest rate needs 2"):
        system_course(runner, Recording(0.0, 0.01, np.zeros((1, 3))))
    text = COUNTING.partition('[[stage]]\nname = "attitude"')[0].replace("attitude.state", "gyro.increment")
    path = tmp_path / "gyro.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"system gyro has no attitude among its outputs \(gyro_increment\)"):
        simulate_system(system_runner(described(path)), CONING, Fraction(1))
