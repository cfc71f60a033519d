"""Rates through a gyro: a simulated cone that a gyro passes on, the drift of designed coefficients, and refusals."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np
import pytest

import strapgen
from strapgen import choose
from strapgen.analysis.vibration import of, through_gyro
from strapgen.catalogue.methods import coning_drift
from strapgen.catalogue.methods.coning_drift import ConingShape
from strapgen.catalogue.methods.sensor_response import Response
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motions import IntegratedMotion
from strapgen.lab.motions.rate_profiles import CosineSum, ReferenceAttitude
from strapgen.lab.runs import steady_drift

#: A gyro of 40 Hz; the closed form takes its damping as it is, the simulated filter has the root of 1/2.
GYRO, DAMPING = 40.0, math.sqrt(0.5)
ANGLE = 0.002


@dataclass(frozen=True)
class SeenCone(IntegratedMotion):
    """Angles about x and y, y a quarter period behind x, of which the samples are those that the gyro passes on."""

    hertz: float

    @cached_property
    def profile(self) -> CosineSum:
        omega = 2 * math.pi * self.hertz
        motion = CosineSum(
            ANGLE * omega * np.array([[1.0], [1.0], [0.0]]),
            np.full((3, 1), omega),
            np.array([[0.3], [0.3 - math.pi / 2], [0.0]]),
        )
        return motion.through_gyro(Response("butterworth", order=2, frequency_hz=Fraction(GYRO)))

    @cached_property
    def _reference(self) -> ReferenceAttitude:
        return ReferenceAttitude(self.profile.rate, 16)

    def attitude(self, time):
        return self._reference(time)


@pytest.mark.long
@pytest.mark.parametrize("hertz", [7.5, 18.5])
@pytest.mark.parametrize(
    ("method", "increments", "previous"),
    [
        ("coning-compressed", 2, None),
        ("rk4", 2, None),
        ("coning-shaped-8", None, None),
        ("window-3-3", None, None),
    ],
)
def test_a_simulated_cone_through_the_gyro_drifts_as_predicted(method, increments, previous, hertz):
    """The angle lags by a part of itself, but over the tenths of a run, 2 s, it swings whole periods.

    Terms of fourth order in the angle are the square of the angle of the true rate, which the drift is a part of.
    """
    choice = choose("euler", method, increments, previous=previous)
    step = Fraction(choice.increments_per_step, 100)
    seen = through_gyro(of(choice), Response(frequency_hz=Fraction(GYRO), damping=Fraction(DAMPING)))
    rates = seen.rates(str(hertz), step, theta_x=ANGLE, theta_y=ANGLE, phase=-math.pi / 2)
    run = strapgen.simulate(strapgen.backend(choice), SeenCone("seen cone", {}, hertz), step, 20)
    predicted, true = (math.degrees(abs(rate)) * 3600 for rate in (rates.error, rates.continuous))
    assert steady_drift(run) == pytest.approx(predicted, abs=ANGLE**2 * true)


def test_the_rates_are_those_of_the_drift_on_coning():
    gyro = Response(frequency_hz=Fraction(40), damping=Fraction(3, 5), sample_hz=Fraction(100))
    choice = choose("euler", "coning-compressed", 1, previous=3)
    design = strapgen.derive(choose("rotation-vector", "coning-compressed", 1, previous=3))
    assert design.inputs[0].shape == (4, 3)
    from strapgen.catalogue.methods.coning_coefficients import design as coefficients

    weights = [coefficients(1, 3).pairs[3 - s, 3] for s in (1, 2, 3)]
    for hertz in (1, 12, 33):
        (error,) = coning_drift.errors(
            ConingShape(1, 3, gyro), weights, [2 * coning_drift._REAL.pi * hertz / 100]
        )
        # By which y leads x: a quarter period turns the cone by minus the drift of the page of formulas.
        rates = through_gyro(of(choice), gyro).rates(hertz, "1/100", theta_x=1, theta_y=1, phase=-math.pi / 2)
        assert rates.error == pytest.approx(float(error) * 100, rel=1e-12)


@pytest.mark.long
def test_a_wide_gyro_changes_nothing_and_sculling_turns_with_the_lag():
    choice = choose("euler", "rk4", 2)
    wave = {"theta_x": 0.01, "theta_y": 0.02, "phase": 1.1, "acceleration_y": 3}
    for quantity in ("drift", "sculling"):
        plain = of(choice, quantity)
        rates, wide = (
            one.rates(10, "1/50", **wave) for one in (plain, through_gyro(plain, "second-order:1e12:1"))
        )
        assert wide.computed == pytest.approx(rates.computed, rel=1e-9)
        assert wide.continuous == rates.continuous
    # At the natural frequency the angle lags by a quarter period, and is 1/(2 zeta) as large.
    seen = through_gyro(of(choice, "sculling"), "second-order:10:1/4").rates(10, "1/50", **wave)
    lagging = of(choice, "sculling").rates(
        10, "1/50", theta_x=0.02, phase=1.1 + math.pi / 2, acceleration_y=3
    )
    assert seen.computed == pytest.approx(lagging.computed, rel=1e-12)
    plain = of(choice, "sculling").rates(10, "1/50", **wave)
    assert seen.continuous == plain.continuous


def test_a_fast_loop_alone_is_refused_and_both_loops_are_not():
    with pytest.raises(
        InputError, match="coning-fast is a fast loop; its rates through a gyro are those of two-speed"
    ):
        through_gyro(of(choose("coning-fast")), "second-order:40:1")
    with pytest.raises(InputError, match="gyro-damping is 0"), pytest.warns(DeprecationWarning):
        through_gyro(of(choose("euler")), 40, 0)
    both = strapgen.vibration.two_speed("drift")
    wave = {"theta_x": 0.01, "theta_y": 0.02, "phase": 1.1, "cycles": 4}
    plain, seen = (one.rates(10, "1/50", **wave) for one in (both, through_gyro(both, "second-order:10:1/2")))
    assert seen.computed == pytest.approx(plain.computed, rel=1e-12)  # |G| is 1 there
