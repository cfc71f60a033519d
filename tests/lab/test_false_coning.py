"""False rates by sensors: jinking through scale factors, and angles in phase through unequal loops."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

import strapgen
from strapgen import choose
from strapgen.analysis.vibration import of, through_gyro, through_gyros
from strapgen.lab.motions.motions import IntegratedMotion
from strapgen.lab.motions.rate_profiles import CosineSum, ReferenceAttitude
from strapgen.lab.runs import drift_between, simulate
from strapgen.lab.sensor_errors.instruments import InstrumentErrors, TriadErrors
from strapgen.lab.sensor_errors.measured_motions import measured


class Angles(IntegratedMotion):
    """Angles about x and y at one frequency in Hz, y ahead by a phase; the parameters are its numbers."""

    @property
    def profile(self):
        turn = 2 * math.pi * self.parameters["hertz"]
        size = np.array([[self.parameters["x"]], [self.parameters["y"]], [0.0]])
        # The rate of sin(turn t + phase) is turn cos(turn t + phase).
        phases = np.array([[0.0], [self.parameters["phase"]], [0.0]])
        return CosineSum(turn * size, np.full((3, 1), turn), phases)

    def attitude(self, time):
        return ReferenceAttitude(self.profile.rate, 16)(time)


def angles(x: float, y: float, hertz: float, phase: float) -> Angles:
    return Angles("angles", {"x": x, "y": y, "hertz": hertz, "phase": phase})


def false_rate(motion, errors, step, seconds) -> np.ndarray:
    """Return the mean rate that errors add to the attitude of an algorithm on a motion, in rad/s."""
    backend = strapgen.backend("euler", method="rk4", increments=2)
    true, seen = (
        simulate(backend, profile, step, seconds).computed for profile in (motion, measured(motion, errors))
    )
    # From the end of the first half on: what begins with the run has died out, and whole periods have passed.
    middle = len(true) // 2
    drift = -drift_between(seen[[middle, -1]], true[[middle, -1]])
    return (drift[1] - drift[0]) / (seconds / 2)


def test_jinking_through_scale_factors_has_the_printed_rate():
    # Roll and turn a quarter period apart, .2 and .3 rad at 1 Hz, 200 and 300 ppm.
    plain, quarter = of(choose("euler", "coning-compressed", 4)), math.pi / 2
    true, seen = (
        plain.rates(1, "0.02", theta_x=x, theta_y=y, phase=quarter).continuous
        for x, y in (("0.2", "0.3"), ("0.20004", "0.30009"))
    )
    expected = -math.pi * 0.2 * 0.3 * ((1 + 200e-6) * (1 + 300e-6) - 1)
    assert seen - true == pytest.approx(expected, rel=1e-9)
    assert seen - true == pytest.approx(-9.425908934e-5, rel=1e-9)
    assert math.degrees(seen - true) * 3600 == pytest.approx(-19.4423, abs=5e-5)


@pytest.mark.long
def test_jinking_in_the_simulator_follows_the_formula_for_small_angles():
    # The formula is of second order: a tenth of the printed amplitudes leaves about 0.05 % of fourth order.
    scale = np.array([200e-6, 300e-6, 0.0])
    errors = InstrumentErrors(gyro=TriadErrors(scale_plus=scale, scale_minus=scale))
    rate = false_rate(angles(0.02, 0.03, 1.0, math.pi / 2), errors, Fraction(1, 200), 20)
    expected = -math.pi * 0.02 * 0.03 * ((1 + 200e-6) * (1 + 300e-6) - 1)
    assert rate[2] == pytest.approx(expected, rel=2e-3)


def test_loops_of_unequal_phase_show_a_coning_that_is_not_there():
    hertz, amplitude, damping = 20.0, 2e-3, 0.7
    motion = angles(amplitude, amplitude, hertz, 0.0)
    wave = {"theta_x": amplitude, "theta_y": amplitude, "phase": 0}
    plain = of(choose("euler", "rk4", 2))
    step = Fraction(1, 1000)
    for frequencies in ((80.0, 60.0), (60.0, 80.0), (80.0, 80.0)):
        gyro = TriadErrors(bandwidth_hz=np.array([*frequencies, np.inf]), damping=np.full(3, damping))
        rate = false_rate(motion, InstrumentErrors(gyro=gyro), step, 2)[2]
        x, y = ((frequency, damping) for frequency in frequencies)
        rates = through_gyros(plain, x, y).rates(20, step, **wave)
        assert rates.continuous == 0
        # A staircase of the rate with 2000 stairs a second leaves (turn T)^2/12 = 0.03 %.
        assert rate == pytest.approx(rates.computed, rel=2e-3, abs=1e-9)
        gains = [1 / (1 + 2j * damping * 20 / f - (20 / f) ** 2) for f in frequencies]
        # Which gyro is ahead by d shows an angle ahead by d: pi f theta^2 |Gx||Gy| sin d.
        ahead = (gains[1] * np.conj(gains[0])).imag
        formula = -math.pi * hertz * amplitude**2 * ahead
        assert rates.computed == pytest.approx(formula, rel=2e-3, abs=1e-12)
    assert rates.computed == 0  # equal loops


def test_delays_of_unequal_length_do_the_same():
    hertz, amplitude = 20.0, 2e-3
    motion = angles(amplitude, amplitude, hertz, 0.0)
    step = Fraction(1, 1000)
    for late, ahead in ((np.array([1e-3, 0, 0]), 1), (np.array([0, 1e-3, 0]), -1), (np.full(3, 1e-3), 0)):
        rate = false_rate(motion, InstrumentErrors(gyro=TriadErrors(delay=late)), step, 2)[2]
        phase = ahead * 2 * math.pi * hertz * 1e-3
        formula = -math.pi * hertz * amplitude**2 * math.sin(phase)
        assert rate == pytest.approx(formula, rel=2e-3, abs=1e-9)


def test_equal_gyros_are_those_of_one_number():
    plain = of(choose("euler", "rk4", 2))
    one, two = through_gyro(plain, 80, "0.7"), through_gyros(plain, (80, "0.7"), (80, "0.7"))
    assert one.computed == two.computed
