"""Calibration by turning, at temperatures and at headings: estimates of simulated sensors, and their covariance."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import sympy as sp
from commands import run

from strapgen.ir.exceptions import InputError
from strapgen.ir.units import STANDARD_GRAVITY
from strapgen.lab.run_options import read_errors
from strapgen.lab.sensor_errors.instruments import Heating, InstrumentErrors, TriadErrors
from strapgen.navigation.calibration import (
    QUANTITIES,
    CalibrationResult,
    PositionsFile,
    Scheme,
    calibrated,
    read,
)
from strapgen.navigation.turntable import Session, coefficients, noise_rows
from strapgen.run.backends import evaluator

TURNING, TEMPERATURES = "examples/turning.toml", "examples/temperatures.toml"
PER_DEGREE = "examples/sensors/torquers-per-degree.toml"
SIDES = tuple(tuple(sign * row for row in axis) for axis in np.eye(3, dtype=int).tolist() for sign in (1, -1))
DEG_H, MICRO_G = math.radians(1 / 3600), STANDARD_GRAVITY * 1e-6
#: A unit whose errors are stated, with all that turning shows.
STATED = InstrumentErrors(
    gyro=TriadErrors(
        bias=np.array([1.0, -2.0, 3.0]) * DEG_H,
        scale_plus=np.array([300.0, 200.0, -100.0]) * 1e-6,
        scale_minus=np.array([100.0, 200.0, 50.0]) * 1e-6,
        misalignment=np.array([[0, 20, -30], [10, 0, 40], [-50, 60, 0]]) * 1e-6,
        terms={"B_xx": 2.0 * DEG_H / STANDARD_GRAVITY, "B_yz": -1.0 * DEG_H / STANDARD_GRAVITY},
    ),
    accelerometer=TriadErrors(
        bias=np.array([50.0, -20.0, 10.0]) * MICRO_G,
        scale_plus=np.full(3, 8e-5),
        scale_minus=np.full(3, 8e-5),
        misalignment=np.array([[0, 5, -3], [1, 0, 4], [-5, 6, 0]]) * 1e-6,
        terms={"G_xx": 1e-3, "G_yz": -2e-3},
    ),
)
NOISY = replace(
    STATED,
    drawn=True,
    gyro=replace(STATED.gyro, noise=np.radians([0.02, 0.03, 0.04]) / 60),
    accelerometer=replace(STATED.accelerometer, noise=np.array([5.0, 6.0, 7.0]) * MICRO_G),
)


@cache
def solved(file):
    return [calibrated(file.scheme, quantity) for quantity in QUANTITIES]


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_rates_show_as_much_of_even_and_odd_parts_as_there_are(count):
    turns = tuple(
        (axis, sp.Integer(s * r)) for axis in (0, 2) for r in (10, 20, 40, 70, 100)[:count] for s in (1, -1)
    )
    scheme = Scheme("", SIDES, turns)
    for quantity, lost in (("rate", "E"), ("acceleration", "N")):
        one = calibrated(scheme, quantity)
        # Six positions and turns about axes do not show products of accelerations.
        assert [*one.lost] == [name for name in one.names if name[0] == lost]
        assert one.rank == len(one.names) - len(one.lost)
        assert [name for name in one.names if name[0] in "KG"] == [
            f"{'KG'[quantity == 'acceleration']}_{row}{column}" for row in "xyz" for column in "xz"
        ]
    names = [name for name in calibrated(scheme, "rate").names if name[0] in "UV"]
    parts = {1: ["V0"], 2: ["U1", "V0", "V1"]}.get(count, ["U1", "U2", "V0", "V1", "V2"])
    assert names == [f"{part}_{axis}" for axis in "xz" for part in parts]


def test_even_and_odd_parts_are_those_of_a_curve():
    """(6.2) to (6.4), of rates in deg/s: w times U(w) = U1 |w| + U2 w^2 and V(w) = V0 sign w + V1 w + V2 w |w|."""
    rates, up = (10, 20, 40, 70, 100), {"U1_y": 3.0, "U2_y": -0.05, "V0_y": 200.0, "V1_y": -4.0, "V2_y": 0.03}
    turns = tuple((1, sp.Integer(sign * rate)) for rate in rates for sign in (1, -1))
    one = calibrated(Scheme("", SIDES, turns), "rate")
    rows = np.zeros((len(SIDES) + len(turns), 3))
    for row, (_, w) in zip(rows[len(SIDES) :], turns, strict=True):
        w = float(w)
        even, odd = 3 * abs(w) - 0.05 * w**2, 200 * math.copysign(1, w) - 4 * w + 0.03 * w * abs(w)
        row[:] = 1e-6 * 3600 * w * np.array([70, 500 + even + odd, -30])
    found = one.solved(rows)
    expected = {"K_xy": 70.0, "K_yy": 500.0, "K_zy": -30.0} | up
    assert found == pytest.approx({name: expected.get(name, 0.0) for name in found}, abs=1e-8)
    with pytest.raises(InputError, match=r"cannot see E_xx, .* of the rate; other positions are needed"):
        one.estimate(rows)


def test_a_unit_is_found_on_the_table():
    """Errors of second order are left: those of the earth rate by scale factors, and of gravity at the table."""
    file = PositionsFile(positions=SIDES, rates_deg_s=(10, 40, 100), duration_s=36)
    simulated, truth = Session(file, STATED).run(solved(file), 0), coefficients(STATED)
    assert {"K_xy", "V0_x", "B_yz", "A0_x", "M_xx", "G_yz"} <= truth.keys() & simulated.estimates.keys()
    sizes = {"D": 5e-3, "B": 5e-3, "K": 0.1, "V": 0.2, "U": 0.01, "A": 0.02, "M": 0.02, "G": 1e-3}
    for name, error in simulated.errors.items():
        assert simulated.estimates[name] == pytest.approx(truth.get(name, 0.0) + error)
        assert abs(error) < sizes[name[0]], (name, error)


@pytest.mark.parametrize("seconds", [9, 360])
def test_heating_is_an_even_part(seconds):
    """(6.6), (6.7): the mean of k w^2 (1 - exp(-t/tau)) over the turns; indicated rates have the other sign, (6.5)."""
    gain, tau, rates = -2.6e-4, 150.0, (40, 80, 120)
    file = PositionsFile(positions=SIDES, rates_deg_s=rates, axes="z", duration_s=seconds, pause_s=1500)
    heated = InstrumentErrors(heating=Heating(np.full(3, gain), tau))
    found = Session(file, heated).run(solved(file), 0).estimates
    torques = evaluator("torques-45")(np.eye(3)[2:], np.zeros((1, 3)), 1.0)
    squares = np.repeat(torques[0, 0::2] ** 2 + torques[0, 1::2] ** 2, 2)
    rate, _ = evaluator("separate-45")(-torques * squares, 1.0)
    share = 1 - tau / seconds * (1 - math.exp(-seconds / tau))
    even = gain * share * rate[0, 2] * math.radians(1) ** 2 * 1e6
    assert even > 0
    # The recursion takes the deviation at the start of a second, so that it is half a second late.
    assert found["U2_z"] == pytest.approx(even, rel=0.01 if seconds > 100 else 0.12)
    assert abs(found["V2_z"]) < 1e-3 * even
    if seconds == 360:  # printed: the linearity error up to 100 deg/s stays below 1e-3, its digits
        assert 4e-4 < even * 1e-6 * 100**2 < 1e-3


@pytest.mark.parametrize("temperatures", [(), (20.0, 40.0, 60.0)], ids=["one temperature", "three"])
def test_estimates_scatter_as_the_covariance_says(temperatures):
    file = PositionsFile(
        positions=SIDES,
        rates_deg_s=(10, 40, 100),
        temperatures_c=temperatures,
        headings_deg=(0, 120, 240),
        duration_s=36,
    )
    several, session = solved(file), Session(file, NOISY, read_errors(PER_DEGREE) if temperatures else None)
    runs = [session.run(several, number) for number in range(200)]
    rows = CalibrationResult.of(file, several, {}, {}, (), session.variances, runs).coefficients
    ratios = [row.runs_deviation / row.uncertainty for row in rows if row.deviation is not None]
    assert len(ratios) == (34 + 21) * (2 if temperatures else 1)
    assert min(ratios) > 0.8
    assert max(ratios) < 1.2
    assert math.isclose(math.sqrt(np.mean(np.square(ratios))), 1, abs_tol=0.03)
    if temperatures:
        means = {row.coefficient: row.mean for row in rows}
        assert means["K_xx per C"] == pytest.approx(-400, abs=0.1)
        assert means["D0_y per C"] == pytest.approx(-1.48, abs=0.01)
    for row in session.heading_rows(runs):
        assert 0.85 < row.runs_deviation_deg / row.uncertainty_deg < 1.15
        assert abs(row.mean_deg) < 3.3 * row.uncertainty_deg / math.sqrt(200)


def test_a_straight_line_has_the_covariance_of_one():
    """At 20 deg C of 20, 30 and 60, whose mean is 110/3, and the sum of squares about it 2600/3."""
    scheme = replace(read(TEMPERATURES).scheme, temperatures=(20.0, 30.0, 60.0))
    for quantity in QUANTITIES:
        one, alone = (calibrated(each, quantity) for each in (scheme, replace(scheme, temperatures=())))
        assert one.labels == (*alone.names, *(f"{name} per C" for name in alone.names))
        for name, deviation in alone.deviations.items():
            if deviation is not None:
                first = deviation * math.sqrt(1 / 3 + (110 / 3 - 20) ** 2 / (2600 / 3))
                assert one.deviations[name] == pytest.approx(first)
                assert one.deviations[f"{name} per C"] == pytest.approx(deviation / math.sqrt(2600 / 3))
                place = one.names.index(name)
                assert one.covariance[place, place] == pytest.approx(first**2)


def test_units_and_what_they_gain_by_a_degree_are_drawn_by_themselves():
    file = PositionsFile(positions=SIDES, temperatures_c=(10.0, 20.0), duration_s=10)
    biased = InstrumentErrors(gyro=TriadErrors(bias=np.ones(3) * DEG_H), drawn=True)
    session = Session(file, biased, biased)
    found = np.array(
        [
            [run[name] for name in ("D0_x", "D0_x per C")]
            for run in (session.run(solved(file), n).estimates for n in range(50))
        ]
    )
    assert np.allclose(found.std(axis=0), 1, atol=0.35)
    assert abs(np.corrcoef(found.T)[0, 1]) < 0.5


def test_a_scale_factor_after_compensation_errs_with_the_rate():
    file = PositionsFile(positions=SIDES, rates_deg_s=(10,), axes="z")
    one = calibrated(file.scheme, "rate")
    still, turning = (one.error_covariance((0, 0, math.radians(w)), (0, 0, 0)) for w in (0, 50))
    # K_xz and K_yz alone: K_zz has V0_z beside it.
    for row, axis in enumerate("xy"):
        added = (one.deviations[f"K_{axis}z"] * 1e-6 * 3600 * 50) ** 2
        assert turning[row, row] - still[row, row] == pytest.approx(added)


def test_a_drift_of_a_tenth_of_a_degree_an_hour_turns_a_gyrocompass_by_the_printed_angle():
    """Section 4.1: 0.1 deg/h at 45 deg of latitude is 0.01 rad, 0.5 deg; headings of a table take a bias out."""
    file = PositionsFile(headings_deg=(30, 120, 210, 300), latitude_deg=45)
    for drift, printed in ((0.1, 0.01), (1.0, 0.09), (2.0, 0.19)):  # typical biases are 1 to 2 deg/h
        gyro = TriadErrors(bias=np.full(3, drift * DEG_H))
        errors = Session(file, InstrumentErrors(gyro=gyro)).run([], 0).headings
        assert abs(errors[1]) < 1e-9
        drawn = InstrumentErrors(gyro=gyro, drawn=True)
        session = Session(file, drawn)
        first, all_four = session.heading_rows([session.run([], number) for number in range(10)])
        assert round(math.radians(first.uncertainty_deg), 2) == printed
        assert all_four.uncertainty_deg < 1e-9
    assert round(first.uncertainty_deg / 20, 1) == 0.5


@pytest.mark.parametrize("headings", [(0, 180), (0, 120, 240), (10, 100, 190, 280)])
def test_noise_turns_a_gyrocompass_by_its_closed_form(headings):
    """N headings all round, two gyros: sigma / (W cos(latitude) sqrt(N)), where one heading has N of 1."""
    file = PositionsFile(headings_deg=headings, latitude_deg=60, rate_sigma_deg_h=0.02)
    closed = math.degrees(0.02 / (15.041067 * 0.5))
    first, every = noise_rows(file)
    assert (first.headings, every.headings) == (1, len(headings))
    assert first.uncertainty_deg == pytest.approx(closed, rel=1e-5)
    assert every.uncertainty_deg == pytest.approx(closed / math.sqrt(len(headings)), rel=1e-5)


def test_turns_and_pauses_take_their_time():
    """Whole turns: 7 in 360 s at 7 deg/s, and one, of 72 s, in 60 s at 5 deg/s."""
    file = PositionsFile(positions=SIDES[:1], rates_deg_s=(5, 7), axes="y", duration_s=60, pause_s=20)
    noisy = InstrumentErrors(gyro=TriadErrors(noise=np.ones(3)))
    durations = 1 / np.array(
        [math.radians(1 / 3600) ** 2 * row[0] for row in Session(file, noisy).variances["rate"]]
    )
    assert durations.round(6).tolist() == [60, 72, 72, 51, 51]


def test_the_command_prints_estimates_and_headings(capsys, tmp_path):
    words = ["study", "calibration", TURNING, "--errors", "ins-1", "--runs", "10", "--format", "json"]
    run([*words, "--plot", str(tmp_path / "turning.svg"), "--rate-deg-s", "10,0,0"])
    data = json.loads(capsys.readouterr().out)
    assert (data["positions"], data["turns"], data["temperatures"], data["runs"]) == (6, 30, 0, 10)
    rows = {row["coefficient"]: row for row in data["coefficients"]}
    assert rows["K_xx"]["unit"] == "ppm" and rows["G_xy"]["unit"] == "micro-g/(deg/s)"
    assert 0.5 < rows["U2_z"]["runs_deviation"] / rows["U2_z"]["uncertainty"] < 1.9
    assert [row["headings"] for row in data["gyrocompass"]] == [1, 4]
    assert (tmp_path / "turning.svg").stat().st_size > 1000
    run([*words[:3], "--format", "json"])
    rows = {row["coefficient"]: row for row in json.loads(capsys.readouterr().out)["coefficients"]}
    assert rows["K_xy"]["mean"] is None
    assert rows["K_xy"]["uncertainty"] == pytest.approx(3.58 * rows["K_xy"]["deviation"])


@pytest.mark.parametrize(
    ("text", "words", "message"),
    [
        ("rates_deg_s = [0]", [], "rates_deg_s[1] is 0; 0.01 to 1000 is needed"),
        ("rates_deg_s = [10, 1e4]", [], "rates_deg_s[2] is 10000; 0.01 to 1000"),
        ("rates_deg_s = [10, 20, 10]", [], "rates_deg_s has a number twice"),
        ("rates_deg_s = []", [], "rates_deg_s has 0 entries; from 1 to 40 are needed"),
        ('rates_deg_s = [10]\naxes = "zz"', [], "axes 'zz' is not known"),
        (
            "temperatures_c = [20]\nrates_deg_s = [10]",
            [],
            "temperatures_c has 1 entry; from 2 to 40 are needed",
        ),
        ("temperatures_c = [20, 20]\nrates_deg_s = [10]", [], "temperatures_c has a number twice"),
        (
            "headings_deg = [0, 360]",
            [],
            "headings_deg are all the same direction; two that differ are needed",
        ),
        ("headings_deg = [0, 90]\nlatitude_deg = 90", [], "latitude_deg is 90"),
        ("headings_deg = [0, 90]\nduration_s = 0", [], "duration_s is 0"),
        (
            "rates_deg_s = [10]\nrate_errors_deg_h = [[1, 2, 3]]",
            [],
            "has 1 rows; one for each of 6 measurements",
        ),
        ("rates_deg_s = [10]", ["--runs", "20"], "--runs needs --errors"),
        ("rates_deg_s = [10]", ["--errors-per-degree", "ins-1"], "--errors-per-degree needs --errors"),
        (
            "rates_deg_s = [10]",
            ["--errors", "ins-1", "--errors-per-degree", "ins-1"],
            "--errors-per-degree needs temperatures_c",
        ),
        (
            "rates_deg_s = [10]\ntemperatures_c = [0, 9]",
            ["--errors", "ins-1", "--errors-per-degree", "ins-1"],
            "errors of kind noise do not come in by a degree; bias, scale, misalignment, terms do",
        ),
        (
            "rates_deg_s = [1, 2, 3]\npause_s = 100000\ntemperatures_c = [0, 9]",
            ["--errors", "ins-1"],
            "the measurements take more than 2000000 s at all temperatures",
        ),
        (
            "rates_deg_s = [10]",
            ["--errors", "PULSES"],
            "errors of kind pulses do not go with a calibration; bias, scale",
        ),
    ],
)
def test_a_table_that_cannot_be_gets_one_line(text, words, message, capsys, tmp_path):
    file, pulses = tmp_path / "table.toml", tmp_path / "pulses.toml"
    file.write_text(text)
    pulses.write_text("[gyro]\npulse_arcsec = 1\n")
    run(
        ["study", "calibration", str(file), *(str(pulses) if word == "PULSES" else word for word in words)], 2
    )
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
