"""Optical gyros: printed numbers, lock-in against the equation of its beams, and the signal of a fibre."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import strapgen
from strapgen import sensors
from strapgen.ir.exceptions import InputError
from strapgen.lab.sensor_errors.error_file import read
from strapgen.navigation.instruments.optical_gyros import (
    fibre_count_angle,
    fibre_phase_scale,
    ring_fringe_angle,
)

ARCSEC = math.radians(1 / 3600)
LOCK_IN = math.radians(0.05)


def mean_beat(rate: float, fringes: float = 648_000 / (2 * math.pi), turns: int = 40) -> float:
    """Return the mean rate that a ring shows: its phase follows psi' = 2 pi fringes (w - L sin psi), here by psi(t)."""
    gain = 2 * math.pi * fringes

    def slope(_: float, psi: np.ndarray) -> np.ndarray:
        return gain * (rate - LOCK_IN * np.sin(psi))

    def whole_turns(_: float, psi: np.ndarray) -> float:
        return abs(psi[0]) - 2 * math.pi * turns

    whole_turns.terminal = True
    end = 3 * turns / (fringes * max(abs(rate) - LOCK_IN, LOCK_IN / 4))
    run = solve_ivp(slope, (0, end), [0.0], events=whole_turns, rtol=1e-9, atol=1e-9, method="DOP853")
    return float(run.y[0, -1] / run.t[-1] / gain)


@pytest.mark.parametrize("times", [1.02, 1.5, -1.2, -4.0])
def test_the_mean_of_the_beat_is_the_root_of_the_difference_of_squares(times):
    rate, cycle = times * LOCK_IN, 0.01
    measured = strapgen.evaluator("lock-in-errors")(np.full(3, rate * cycle), cycle, np.full(3, LOCK_IN))
    np.testing.assert_allclose(measured / cycle, mean_beat(rate), rtol=1e-6)


@pytest.mark.parametrize("times", [0.0, 0.5, -0.99])
def test_a_locked_ring_shows_nothing(times):
    assert abs(mean_beat(times * LOCK_IN)) < 0.01 * LOCK_IN  # a part of a turn in a long time
    step = times * LOCK_IN * 0.01
    assert (strapgen.evaluator("lock-in-errors")(np.full(3, step), 0.01, np.full(3, LOCK_IN)) == 0).all()


def test_a_file_states_the_lock_in_of_gyros(tmp_path):
    path = tmp_path / "ring.toml"
    path.write_text("[gyro]\nlock_in_deg_s = [0.05, 0, 0.05]\n")
    errors = read(path)
    assert list(errors.causes) == ["lock-in"]
    unit = sensors.MeasurementUnit(errors, 0.01)
    true = np.array([[0.03, 0.03, 0.03], [0.1, -0.1, -0.1]]) * math.radians(0.01)
    locked = math.radians(0.01) * math.sqrt(0.1**2 - 0.05**2)
    expected = [[0, true[0, 1], 0], [locked, true[1, 1], -locked]]
    np.testing.assert_allclose(unit(true)[0], expected, rtol=1e-12)
    np.testing.assert_array_equal(sensors.MeasurementUnit(errors.without("lock-in"), 0.01)(true)[0], true)


def test_a_lock_in_goes_with_no_dither_and_is_above_zero(tmp_path):
    path = tmp_path / "ring.toml"
    dither = "dither = { lock_in_deg_s = 1, dither_deg_s = 1, fringes = 1 }"
    for text, words in (
        (f"lock_in_deg_s = 0.05\n{dither}", "lock_in_deg_s and dither are both there"),
        ("lock_in_deg_s = -1", "gyro.lock_in_deg_s is -1"),
    ):
        path.write_text(f"[gyro]\n{text}\n")
        with pytest.raises(InputError, match=words):
            read(path)
    path.write_text("[accelerometer]\nlock_in_deg_s = 1\n")
    with pytest.raises(InputError, match="key 'lock_in_deg_s' is not known"):
        read(path)


def test_printed_scale_factors_come_out():
    # 400 m on 0.1 m at 0.82 micron: "approximately one radian at 1 rad/sec"; pulses of 2 arcsec and 0.63 micron.
    assert round(fibre_phase_scale(400, 0.1, 0.82e-6)) == 1
    square = 0.63e-6 * 648_000 / (2 * math.pi)  # 4 A/L of a square is its side
    assert ring_fringe_angle(square**2, 4 * square, 0.63e-6) / ARCSEC == pytest.approx(2, rel=1e-12)


def test_a_fibre_in_a_loop_counts_as_a_ring_of_one_turn_does():
    """The source: equations (5) and (1) are identical on an integral basis."""
    for diameter, wavelength in ((0.1, 0.82e-6), (0.05, 1.3e-6)):
        one_turn = ring_fringe_angle(math.pi * diameter**2 / 4, math.pi * diameter, wavelength)
        assert fibre_count_angle(diameter, wavelength) == pytest.approx(one_turn, rel=1e-12)
        # The phase of so many cycles a second over the travel of the light takes that of the rate away.
        length = 400
        counts = 1 / fibre_count_angle(diameter, wavelength)
        phase = 2 * math.pi * counts * length / 299_792_458
        assert phase == pytest.approx(fibre_phase_scale(length, diameter, wavelength), rel=1e-12)


@pytest.mark.parametrize("values", [(0, 1, 1), (1, -1, 1), (1, 1, float("nan"))])
def test_lengths_are_above_zero(values):
    with pytest.raises(InputError, match=r"a number above 0 is needed|a finite number is needed"):
        ring_fringe_angle(*values)


def test_the_rate_of_a_fibre_comes_back_up_to_a_quarter_of_a_turn(rng):
    scale = fibre_phase_scale(400, 0.1, 0.82e-6) / 15
    rates = rng.uniform(-8, 8, (20, 3))
    signals = strapgen.evaluator("fibre-signal")(rates, np.full(20, scale))
    # The difference of the intensities cos^2((phase +- pi/2)/2) on both sides of a modulation.
    sides = [np.cos((scale * rates + side) / 2) ** 2 for side in (-math.pi / 2, math.pi / 2)]
    np.testing.assert_allclose(signals, sides[0] - sides[1], atol=1e-14)
    np.testing.assert_allclose(
        strapgen.evaluator("fibre-rate")(signals, np.full(20, 1 / scale)), rates, rtol=1e-12
    )
