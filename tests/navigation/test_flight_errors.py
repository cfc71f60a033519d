"""Errors of a navigator by those of its sensors: the covariance contains the runs."""

from __future__ import annotations

import json
import math
from fractions import Fraction

import numpy as np
import pytest
from commands import run

from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motions import motion
from strapgen.lab.run_options import read_errors
from strapgen.lab.sensor_errors.instruments import InstrumentErrors, TriadErrors
from strapgen.lab.sensor_errors.measured_motions import measured
from strapgen.navigation.systems.flight_errors import runs, spread
from strapgen.navigation.systems.system_flight import fly
from strapgen.navigation.systems.system_runner import system_runner
from strapgen.navigation.systems.wiring import described
from strapgen.navigation.vehicle.vehicle_motion import VehicleMotion

NAVIGATOR = "examples/navigator.toml"


def navigator(rate=50, backend="c"):
    return system_runner(described(NAVIGATOR, Fraction(rate)), backend)


@pytest.mark.long
@pytest.mark.parametrize("align", [False, True])
@pytest.mark.parametrize("name", ["great-circle", "s-turns", "polar"])
@pytest.mark.parametrize("kind", ["gyro", "accelerometer"])
@pytest.mark.parametrize("axis", range(3))
def test_a_bias_does_what_the_error_equations_say(name, kind, axis, align):
    """One run with a bias, and the square root of the covariance of a bias of this size."""
    bias = TriadErrors(bias=np.eye(3)[axis] * (1e-6 if kind == "gyro" else 1e-3))
    errors, course = InstrumentErrors(**{kind: bias}), motion(name)
    duration = Fraction(400)
    ideal = fly(navigator(), course, duration, Fraction(100))
    flight = fly(navigator(), measured(course, errors), duration, Fraction(100), align=align).less(ideal)
    seen = np.column_stack(
        [flight.attitude_error, flight.velocity_error[:, :2], flight.position_error[:, :2]]
    )
    drawn = InstrumentErrors(**{kind: bias}, drawn=True)
    predicted = spread(course, drawn, duration, 4, align).deviations()
    # Of what such a bias does on a flat earth 1 %: radius and gravity of the ellipsoid are one number each here.
    sizes = (4e-4, 0.785, 105) if kind == "gyro" else (1e-4, 0.4, 80)
    for part, size in zip((slice(0, 3), slice(3, 5), slice(5, 7)), sizes, strict=True):
        assert np.abs(np.abs(seen[-1, part]) - predicted[-1, part]).max() < 0.01 * size


@pytest.mark.long
@pytest.mark.parametrize(
    ("course", "duration", "align"),
    [
        (motion("s-turns"), Fraction(600), False),
        (motion("s-turns"), Fraction(600), True),
        (motion("polar", latitude_deg=74), Fraction(14400), True),
    ],
    ids=["s-turns", "s-turns, aligned", "four hours and a pole, aligned"],
)
def test_the_covariance_contains_two_hundred_runs(course, duration, align):
    errors = read_errors("ins-1")
    measured_runs = runs(navigator(), course, errors, duration, 10, 200, align)
    expected = spread(course, errors, duration, 10, align).deviations()
    ratio = measured_runs.std(axis=0, ddof=1)[-1] / expected[-1]
    # The interval of 99.9 % of a deviation of 200 runs, and of both axes together.
    assert np.all((ratio > 0.84) & (ratio < 1.17)), ratio
    for part in (slice(0, 2), slice(3, 5), slice(5, 7)):
        assert 0.88 < math.sqrt((ratio[part] ** 2).mean()) < 1.12
    # The mean of the runs is none but by chance.
    mean = measured_runs.mean(axis=0)[-1] / expected[-1]
    assert np.abs(mean).max() < 3.3 / math.sqrt(200)
    # All axes together: 5 %.
    assert math.isclose(math.sqrt((ratio**2).mean()), 1, abs_tol=0.05)


def test_runs_take_the_true_increments_once(monkeypatch):
    """The start of a run that is aligned takes the first of them, and the run all."""
    asked = []
    compute = VehicleMotion._both_samples
    monkeypatch.setattr(
        VehicleMotion, "_both_samples", lambda self, *ask: asked.append(ask) or compute(self, *ask)
    )
    runs(navigator(), motion("polar", latitude_deg=74), read_errors("ins-1"), Fraction(2), 2, 3, True)
    assert asked == [(Fraction(1, 50), 0, 100)]


@pytest.mark.parametrize(("name", "nmi_h"), [("ins-0.1", 0.1), ("ins-1", 1.0)])
def test_a_class_of_1984_has_the_position_error_of_its_name(name, nmi_h):
    predicted = spread(motion("great-circle"), read_errors(name), Fraction(3600), 1, True).deviations()
    assert math.isclose(np.hypot(*predicted[0, 5:7]) / 1852, nmi_h, rel_tol=0.25)


def test_noise_and_walks_spread_as_on_a_vehicle_at_rest():
    """Angle random walk N leaves N sqrt(t); a walking bias K leaves K sqrt(t^3/3)."""
    still = motion("swinging", turn_rate_deg_s=0.001, latitude_deg=0)
    noisy = InstrumentErrors(gyro=TriadErrors(noise=np.full(3, 1e-5)))
    walking = InstrumentErrors(gyro=TriadErrors(random_walk=np.full(3, 1e-7)))
    heading = [spread(still, one, Fraction(60), 1).deviations()[0, 2] for one in (noisy, walking)]
    # A bias goes with the body, which rolls by up to 0.3 rad: up to 1 - cos(0.3) less of it adds up.
    assert np.allclose(heading, [1e-5 * math.sqrt(60), 1e-7 * math.sqrt(60**3 / 3)], rtol=0.045)


def test_the_command_prints_runs_and_prediction(capsys, tmp_path):
    words = [
        "study",
        "flight-errors",
        NAVIGATOR,
        "--errors",
        "ins-1",
        "--duration",
        "10",
        "--sample-hz",
        "50",
    ]
    run([*words, "--runs", "10", "--format", "json", "--plot", str(tmp_path / "errors.svg")])
    data = json.loads(capsys.readouterr().out)
    assert [row["quantity"] for row in data["deviations"]] == ["attitude"] * 3 + ["velocity"] * 2 + [
        "position"
    ] * 2
    assert [row["cause"] for row in data["causes"]] == ["all", "bias", "scale", "misalignment", "noise"]
    assert (tmp_path / "errors.svg").stat().st_size > 1000


@pytest.mark.parametrize(
    "errors",
    [
        InstrumentErrors(),
        InstrumentErrors(drawn=True),
        InstrumentErrors(gyro=TriadErrors(bias=np.full(3, 1e-5))),
    ],
)
def test_sensors_that_are_the_same_in_every_run_are_refused(errors):
    with pytest.raises(InputError, match="the sensors are the same in every run; constants"):
        spread(motion("great-circle"), errors, Fraction(10), 1)


def test_errors_without_covariance_are_refused():
    pulses = InstrumentErrors(gyro=TriadErrors(pulse=np.full(3, 1e-5)))
    with pytest.raises(InputError, match="errors of kind pulses have no covariance here; bias, scale"):
        spread(motion("great-circle"), pulses, Fraction(10), 1)
