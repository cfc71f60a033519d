"""Windows for the response of a sensor: what they leave of its lag and its losses, and what a wrong response costs."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache, cached_property

import numpy as np
import pytest

import strapgen
from strapgen.catalogue.methods import windows
from strapgen.catalogue.methods.sensor_response import Response, parse
from strapgen.catalogue.methods.window import Window
from strapgen.design.family import FamilyBrief, design
from strapgen.lab.motions.motions import IntegratedMotion
from strapgen.lab.runs import angles, steady_drift
from strapgen.run.increments import pulses

RATE, STEP = Fraction(100), Fraction(1, 100)
FOURTH, LATE = "butterworth:4:40", "butterworth:4:80+delay:0.003"
MOTIONS = {
    "vibration": strapgen.motion("vibration", angle_deg=0.1),
    "random": strapgen.motion("random", rate_deg_s=120),
}


@dataclass(frozen=True)
class Seen(IntegratedMotion):
    """A motion as a sensor shows it, with white noise in deg/sqrt(h) and pulses in arc seconds."""

    response: Response
    noise: float = 0.0
    pulse: float = 0.0

    @cached_property
    def profile(self):
        return MOTIONS[self.name].profile.through_gyro(self.response)

    def samples(self, interval, first, stop):
        row = super().samples(interval, first, stop)
        if self.noise:
            size = math.radians(self.noise) / 60 * float(interval) ** 0.5
            row = row + np.random.default_rng(5).normal(0, size, (4000 + stop, 3))[4000 + first :]
        return pulses(row[:, None], math.radians(self.pulse / 3600))[:, 0] if self.pulse else row


@cache
def window(words: str, side: int, band: str = "1.9", powers: int = 2, v_taps: int = 0) -> Window:
    gyro = parse("gyro", words).at(RATE)
    taps = (side, v_taps) if v_taps else None
    brief = FamilyBrief(side, side, Fraction(band), conditions=powers, gyro=gyro, taps=taps)
    return replace(design(brief), file="designed here")


def run(method, motion, words, **errors):
    seen = Seen(motion, MOTIONS[motion].parameters, parse("gyro", words).at(RATE), **errors)
    method = (method,) if isinstance(method, str | Window) else method
    backend = strapgen.backend("euler", *method[:2], backend="c", previous=(*method, None, None)[2])
    return strapgen.simulate(backend, seen, STEP, 60)


@pytest.mark.long
@pytest.mark.parametrize(
    ("motion", "words", "design", "largest"),
    [
        ("vibration", FOURTH, (7,), 6.2e-4),
        ("vibration", FOURTH, (10,), 5.6e-6),
        ("random", FOURTH, (7, "1.3", 4), 1.0e-4),
        ("random", LATE, (7, "1.3", 4), 1.7e-4),
        ("vibration", FOURTH, (7, "1.9", 2, 7), 6.2e-4),
        ("vibration", FOURTH, (10, "1.9", 2, 10), 5.6e-6),
        ("random", FOURTH, (8, "1.3", 4, 6), 1.0e-4),
        ("random", LATE, (7, "1.3", 4, 7), 1.7e-4),
    ],
)
def test_a_window_for_the_response_leaves_next_to_nothing(motion, words, design, largest):
    found = run(window(words, *design), motion, words)
    assert steady_drift(found) < 1.2 * largest
    assert angles(found).max() < 1e-6  # it takes out the lag too


@pytest.mark.long
@pytest.mark.parametrize(
    ("method", "motion", "words", "drift"),
    [
        (("coning-compressed", 1, 1), "vibration", FOURTH, 8.1),
        ("window-7-7", "random", FOURTH, 10),
        ("window-7-7", "random", LATE, 7.4),
    ],
)
def test_what_knows_nothing_of_the_response(method, motion, words, drift):
    assert steady_drift(run(method, motion, words)) == pytest.approx(drift, rel=0.2)


@pytest.mark.long
def test_a_response_that_is_off_by_a_percent_costs_its_drift():
    off = run(window("butterworth:4:40.4", 7), "vibration", FOURTH)
    assert 0.03 < steady_drift(off) < 0.3 and angles(off).max() > 1e-5


@pytest.mark.long
@pytest.mark.parametrize("words", [FOURTH, LATE])
def test_pulses_and_noise_leave_more_than_the_window(words):
    found = run(window(words, 7, "1.3", 4), "random", words, noise=0.002, pulse=1.0)
    assert 0.01 < steady_drift(found) < 0.1


@pytest.mark.long
@pytest.mark.parametrize(
    "words", ["instants", "butterworth:2:45+decimation:4", "fir:0.25:0.5:0.25+delay:0.002"]
)
def test_filters_of_other_sensors_hold_their_conditions_and_take_them_out(words):
    chosen = window(words, 6, "1.5", 3)
    windows.verify(chosen)
    assert chosen == design(
        FamilyBrief(6, 6, Fraction("1.5"), conditions=3, gyro=parse("gyro", words).at(RATE))
    )
    assert (
        steady_drift(run(chosen, "random", words)) < 1e-2 < steady_drift(run("window-7-7", "random", words))
    )
