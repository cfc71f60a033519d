"""Monte Carlo of sensor errors beside its prediction in closed form, and the command that shows both."""

from __future__ import annotations

import json
import math
import shlex
from fractions import Fraction

import numpy as np
import pytest

import strapgen
from strapgen.cli import main
from strapgen.lab.runs import drift_between
from strapgen.lab.sensor_error_study import (
    SensorStudy,
    deviation_interval,
    records_of,
    student_quantile,
)
from strapgen.lab.sensor_errors.instruments import (
    InstrumentErrors,
    OutputNoise,
    Sampling,
    TriadErrors,
    WarmUp,
)
from strapgen.lab.sensor_errors.sensor_covariance import Path, covariances, error_mean
from strapgen.lab.sensor_errors.sensors import MeasurementUnit

CONING = strapgen.motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10)
TURN = strapgen.motion("constant", z_deg_s=10)
#: The pulse of the thesis in rad, and noise that spreads the angle over a pulse from one increment to the next.
PULSE = math.radians(25.2 / 3600)
STEP = Fraction(1, 8)
NOISY = TriadErrors(noise=np.full(3, PULSE / math.sqrt(1 / 16)))


def path_of(motion, steps=360, records=1, method="rk4", increments=2) -> Path:
    return Path(motion, strapgen.choose("euler", method, increments), STEP, steps, records)


def scatter(motion, gyro, runs, **others) -> tuple[np.ndarray, np.ndarray]:
    """Return measured and predicted deviations at the records, (records, 3)."""
    path, errors = path_of(motion, **others), InstrumentErrors(gyro=gyro)
    study = SensorStudy(strapgen.backend("euler", method="rk4", increments=2), path, errors)
    row = next(iter(study.rows(runs)))
    return row.deviation, row.predicted


# 900 numbers tell a deviation to 1/sqrt(1800) = 2.4 %; a difference of 5 % is allowed.


@pytest.mark.parametrize("motion", [TURN, CONING], ids=["constant", "coning"])
def test_white_noise_and_its_prediction_agree_within_5_percent(motion):
    measured, predicted = scatter(motion, NOISY, 300)
    pooled = math.sqrt(np.mean(measured[-1] ** 2))
    assert predicted[-1] == pytest.approx(NOISY.noise * math.sqrt(45), rel=1e-6)
    assert pooled == pytest.approx(predicted[-1, 0], rel=0.05)


def test_a_deviation_is_about_the_mean_of_the_runs():
    # Three runs by hand: squares about their own mean over N - 1, not about 0 and not over N.
    motion, errors = CONING, InstrumentErrors(gyro=NOISY)
    backend = strapgen.backend("euler", method="rk4", increments=2)
    (row,) = SensorStudy(backend, path_of(motion, 8), errors).rows(3)
    samples = motion.samples(STEP / 2, 0, 16)
    measured = [samples, *(MeasurementUnit(errors, 1 / 16, run)(samples)[0] for run in range(3))]
    states = backend.propagate(np.stack(measured).reshape(4, 8, 2, 3), 8)[:, -1]
    exact, *ends = backend.matrices(states)
    angles = np.array([-drift_between(end, exact) for end in ends])
    by_hand = np.sqrt(((angles - angles.sum(axis=0) / 3) ** 2).sum(axis=0) / 2)
    np.testing.assert_allclose(row.deviation[-1], by_hand, rtol=1e-9)
    np.testing.assert_allclose(row.mean[-1], angles.sum(axis=0) / 3, rtol=1e-9)
    low, high = deviation_interval(2)
    np.testing.assert_allclose([row.low[-1], row.high[-1]], [low * by_hand, high * by_hand], rtol=1e-9)


@pytest.mark.parametrize(
    ("steps", "runs"), [(360, 400), pytest.param(1440, 600, marks=pytest.mark.long)], ids=["short", "whole"]
)
def test_pulses_and_their_prediction_agree_within_5_percent(steps, runs):
    # Pulses alone: the difference of two runs of the same noise, with pulses and without.
    both = InstrumentErrors(gyro=TriadErrors(noise=NOISY.noise, pulse=np.full(3, PULSE)))
    path = path_of(TURN, steps=steps)
    backend = strapgen.backend("euler", method="rk4", increments=2)
    row = TURN.samples(STEP / 2, 0, 2 * steps)
    parts = []
    for errors in (both, both.without("pulses")):
        rows = [MeasurementUnit(errors, 1 / 16, run)(row)[0] for run in range(runs)]
        cut = np.stack(rows).reshape(runs, steps, 2, 3)
        parts.append(backend.matrices(backend.propagate(cut, steps)[:, -1]))
    error = drift_between(*parts)
    predicted = np.sqrt(np.diagonal(covariances(path, both)["pulses"][-1]))
    # The first angle is quantized too: 2 q^2/12 along, and (5/108) w^2 q^2 h t more across.
    turned = 5 / 108 * math.radians(10) ** 2 * PULSE**2 / 8 * (steps / 8)
    across, along = math.sqrt(PULSE**2 / 6 + turned), PULSE / math.sqrt(6)
    np.testing.assert_allclose(predicted, [across, across, along], rtol=1e-6)
    # The error across is of 800 numbers or more (2.5 %), along of 400 (3.5 %, of which 7 % are allowed).
    assert math.sqrt(np.mean(error[:, :2] ** 2)) == pytest.approx(across, rel=0.05)
    assert math.sqrt(np.mean(error[:, 2] ** 2)) == pytest.approx(along, rel=0.07)


def test_the_printed_figure_of_pulses_comes_out():
    # Chapter 6: c = 2/3, one end exact: 8.5481 arcsec across and 7.2746 along.
    pulses = InstrumentErrors(gyro=TriadErrors(pulse=np.full(3, PULSE)))
    path = path_of(TURN, steps=1440)
    deviations = np.sqrt(np.diagonal(covariances(path, pulses)["pulses"][-1]) - PULSE**2 / 12)
    arcsec = np.degrees(deviations) * 3600
    np.testing.assert_allclose(arcsec, [8.5481, 8.5481, 7.2746], atol=6e-5)


#: Errors that are drawn or random, with every cause that has a prediction.
CAUSES = {
    "bias": InstrumentErrors(gyro=TriadErrors(bias=np.array([1e-5, 2e-5, 1e-5])), drawn=True),
    "scale": InstrumentErrors(
        gyro=TriadErrors(scale_plus=np.full(3, 1e-4), scale_minus=np.full(3, 1e-4)), drawn=True
    ),
    "asymmetric scale": InstrumentErrors(
        gyro=TriadErrors(scale_plus=np.full(3, 1e-4), scale_minus=np.full(3, 2e-4)), drawn=True
    ),
    "misalignment": InstrumentErrors(gyro=TriadErrors(misalignment=1e-4 * (1 - np.eye(3))), drawn=True),
    "anisoinertia": InstrumentErrors(gyro=TriadErrors(terms={"J_xy": 1e-3, "J_yz": 1e-3}), drawn=True),
    "noise": InstrumentErrors(gyro=TriadErrors(noise=np.array([1e-5, 3e-5, 2e-5]))),
    "random walk": InstrumentErrors(gyro=TriadErrors(random_walk=np.array([1e-6, 3e-6, 2e-6]))),
    "output noise": InstrumentErrors(output_noise=OutputNoise(0.5, np.full(3, 1e-5))),
    "jitter": InstrumentErrors(sampling=Sampling(1e-3)),
    "late": InstrumentErrors(sampling=Sampling(0.0, 0.1, "late")),
    "repeat": InstrumentErrors(sampling=Sampling(0.0, 0.1, "repeat")),
    "zero": InstrumentErrors(sampling=Sampling(0.0, 1e-3, "zero")),
}


@pytest.mark.long
@pytest.mark.parametrize("name", CAUSES)
def test_every_prediction_is_met_by_a_monte_carlo(name):
    # Of a thousand samples one is lost: enough of them are in twice the steps.
    steps = 720 if name == "zero" else 360
    study = SensorStudy(
        strapgen.backend("euler", method="rk4", increments=2), path_of(CONING, steps, 6), CAUSES[name]
    )
    (row,) = study.rows(1200)
    measured, predicted = row.deviation[1:], row.predicted[1:]
    # 1200 runs tell a deviation of normal numbers to 2 %; over 15 of them 4.5 times that is allowed, and for losses,
    # whose fourth moment is larger, twice as much.
    allowed = 0.16 if name in ("zero", "late", "repeat") else 0.09
    seen = predicted > 1e-3 * predicted.max()
    np.testing.assert_allclose(measured[seen], predicted[seen], rtol=allowed)
    assert (measured[~seen] < 0.01 * predicted.max()).all()
    margin = (
        4 * row.mean_margin + 1e-3 * np.abs(row.predicted_mean) + 0.1 * predicted.max() * (name == "zero")
    )
    assert (np.abs(row.mean - row.predicted_mean) <= margin)[1:].all()


def test_a_bias_walk_at_rest_has_the_cubic_law():
    rest = strapgen.motion("constant", z_deg_s=0)
    errors = InstrumentErrors(gyro=TriadErrors(random_walk=np.array([1e-6, 0, 3e-6])))
    spread = covariances(path_of(rest, 360, 3), errors)["random walk"]
    time = np.array([15.0, 30.0, 45.0])
    np.testing.assert_allclose(spread[:, 0, 0], 1e-12 * time**3 / 3, rtol=1e-4)
    np.testing.assert_allclose(spread[:, 2, 2], 9e-12 * time**3 / 3, rtol=1e-4)
    assert not spread[:, 1].any()


def test_stated_errors_have_a_mean_and_no_spread():
    warm = WarmUp(np.array([1e-5, 0, 0]), np.full(3, 10.0))
    gyro = TriadErrors(bias=np.array([1e-5, -2e-5, 3e-5]), misalignment=1e-4 * np.eye(3)[[1, 2, 0]])
    errors = InstrumentErrors(gyro=gyro, warm_up=warm)
    path = path_of(CONING, 360, 4)
    study = SensorStudy(strapgen.backend("euler", method="rk4", increments=2), path, errors)
    whole = next(iter(study.rows(100)))
    assert whole.runs == 1 and not whole.deviation.any() and not whole.predicted.any()
    # To first order: what is left is of the size of the square of the error.
    size = np.abs(whole.mean).max()
    np.testing.assert_allclose(whole.mean, error_mean(path, errors), atol=2 * size**2 + 1e-7)


def test_intervals_have_their_coverage():
    # The quantiles of tables: t and chi-square of 9 and of 99 degrees of freedom.
    assert student_quantile(9) == pytest.approx(2.262157, abs=1e-3)
    assert student_quantile(99) == pytest.approx(1.984217, abs=1e-5)
    for degrees, low, high in ((9, 2.700389, 19.022768), (99, 73.361080, 128.421989)):
        expected = (math.sqrt(degrees / high), math.sqrt(degrees / low))
        assert deviation_interval(degrees) == pytest.approx(expected, rel=5e-3)
    draws = np.random.default_rng(5).standard_normal((4000, 20))
    deviation = draws.std(axis=1, ddof=1)
    low, high = deviation_interval(19)
    inside = np.mean((low * deviation <= 1) & (high * deviation >= 1))
    assert inside == pytest.approx(0.95, abs=0.014)  # four standard deviations of a share of 4000


@pytest.mark.parametrize(("steps", "records"), [(1, 1), (7, 7), (53, 1), (3000, 50), (144, 48)])
def test_records_divide_the_steps(steps, records):
    assert records_of(steps) == records


# The command

MOTION = "--motion constant --set z_deg_s=10 --step 0.05 --duration 5 --runs 20"


@pytest.fixture
def run(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "none.toml").write_text("")
    (tmp_path / "noise.toml").write_text("[gyro]\nnoise_deg_sqrt_h = 1\npulse_arcsec = 1\n")
    (tmp_path / "force.toml").write_text("[gyro]\ng_deg_h_g = { xz = 360 }\n")

    def result(command: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(f"study sensor-errors {command}"))
        printed = capsys.readouterr()
        return int(stop.value.code or 0), printed.out, printed.err

    return result


def test_the_command_shows_causes_with_their_intervals(run, tmp_path):
    status, text, _ = run(f"noise.toml {MOTION} --plot a.png")
    assert status == 0 and (tmp_path / "a.png").stat().st_size
    assert [line.split(",")[0] for line in text.splitlines() if "20 runs" in line] == [
        "all",
        "noise",
        "pulses",
    ]
    data = json.loads(run(f"noise.toml {MOTION} --format json")[1])
    assert len(data["rows"]) == 9
    for name, lines in (("csv", 10), ("markdown", 11)):
        table = run(f"noise.toml {MOTION} --format {name}")[1]
        assert len(table.splitlines()) == lines and "predicted_deg" in table
    for row in data["rows"]:
        assert row["low_deg"] < row["deviation_deg"] < row["high_deg"]
        if row["cause"] == "pulses":  # 20 runs tell a deviation to 16 %
            assert row["deviation_deg"] == pytest.approx(row["predicted_deg"], rel=0.5)
        if row["cause"] == "noise":
            assert row["predicted_deg"] == pytest.approx(math.sqrt(5 / 3600))
    assert data == json.loads(run(f"noise.toml {MOTION} --format json")[1])
    other = json.loads(run(f"noise.toml {MOTION} --format json --seed 5")[1])
    assert other["rows"][0]["deviation_deg"] != data["rows"][0]["deviation_deg"]


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (f"nothing.toml {MOTION}", "nothing.toml cannot be read"),
        (f"none.toml {MOTION}", "the sensors have no errors"),
        (f"force.toml {MOTION}", "a specific force is needed"),
        (f"noise.toml {MOTION.replace('20', '9')}", "runs is 9; a whole number from 10"),
        (f"noise.toml {MOTION.replace('20', 'many')}", "runs is 'many'"),
        (f"noise.toml {MOTION} --seed -1", "seed is -1"),
        ("noise.toml --duration 5", "--motion is needed"),
        ("noise.toml --motion constant --set z_deg_s=1 --duration 5", "--motion needs --step"),
        (f"noise.toml {MOTION} --backend paper", "backend 'paper'"),
        ("noise.toml --motion constant --set z_deg_s=1 --step 1e-6 --duration 5", "are too many"),
    ],
)
def test_invalid_commands_are_refused_in_one_line(command, words, run):
    status, text, said = run(command)
    assert (status, text) == (2, "")
    assert words in said and said.count("\n") == 1


def test_back_ends_agree_on_a_monte_carlo(run):
    def deviations(words: str) -> np.ndarray:
        status, text, said = run(f"noise.toml {MOTION} --format json {words}")
        assert status == 0, said
        return np.array([row["deviation_deg"] for row in json.loads(text)["rows"]])

    plain = deviations("")
    np.testing.assert_allclose(deviations("--backend c"), plain, rtol=1e-9)
    # Increments are rounded to a format of some 2^-34 rad, and a state of 32 bits to 2^-31.
    fixed = deviations("--backend c-fixed32 --carry full")
    np.testing.assert_allclose(fixed, plain, atol=math.degrees(2.0**-28))
