"""A log judged from the command line: the errors that are put into its rates are those that are found."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.spatial.transform import Rotation

from strapgen.cli import main
from strapgen.lab.recordings.rest import earth_rate

HZ, REST, SECONDS = 100, 5, 40
BIAS_DEG_S = np.array([0.05, -0.12, 0.08])
BEGIN = Rotation.from_euler("ZYX", [70, 20, -10], degrees=True)
LATITUDE = 48.1


@pytest.fixture(scope="module")
def logs(tmp_path_factory) -> Path:
    """A folder with the rates of a gyro on the Earth, which rests at first, and its attitude on another clock."""
    time = np.arange(SECONDS * HZ) / HZ
    active = np.clip(time - REST, 0, None)[:, None]
    rate = np.sin(active * (0.9, 1.7, 0.6)) * (0.8, 0.5, 1.1) * (active > 0)
    level = [BEGIN]
    for one in rate:
        level.append(level[-1] * Rotation.from_rotvec(one / HZ))
    level = Rotation.concatenate(level)
    sensed = rate + level[:-1].inv().apply(earth_rate(LATITUDE))
    noise = np.random.default_rng(1).normal(0, math.radians(0.05), rate.shape)
    measured = np.degrees(sensed + noise) + BIAS_DEG_S
    folder = tmp_path_factory.mktemp("logs")
    head = "t [s],gx [deg/s],gy [deg/s],gz [deg/s]"
    np.savetxt(
        folder / "gyro.csv", np.column_stack([time + 1 / HZ, measured]), "%.9f", ",", header=head, comments=""
    )
    stamps = np.arange(0, SECONDS * HZ + 1, 4)
    w = np.column_stack([stamps / HZ + 12.25, level[stamps].as_quat(scalar_first=True)])
    head = "timestamp [s],q_w,q_x,q_y,q_z"
    np.savetxt(folder / "truth.csv", w, "%.9f", ",", header=head, comments="")
    return folder


def run(arguments: list[str], capsys, status: int = 0) -> tuple[str, str]:
    with pytest.raises(SystemExit) as stop:
        main(["simulate", "euler", *arguments])
    out, error = capsys.readouterr()
    assert int(stop.value.code or 0) == status, error
    return out, error


def judged(logs: Path, capsys, *options: str) -> dict:
    arguments = ["--recording", f"{logs}/gyro.csv", "--input", "rates", *options, "--format", "json"]
    out, _ = run([*arguments, "--true-attitude", f"{logs}/truth.csv"], capsys)
    return json.loads(out)


def test_earth_and_bias_are_taken_off(logs, capsys):
    """What is left is the noise, 0.3 deg/sqrt(h), and the uncertainty of the bias, 8 deg/h."""
    data = judged(logs, capsys, "--bias-from", "0:5", "--latitude-deg", "48.1")
    np.testing.assert_allclose(data["bias_deg_s"], BIAS_DEG_S, atol=4 * max(data["bias_uncertainty_deg_s"]))
    error = data["error"]
    assert error["time_offset_s"] == pytest.approx(12.25, abs=4 * error["time_offset_uncertainty_s"] + 1e-4)
    assert error["align"] == "start" and np.allclose(error["reference_deg"], 0)
    assert error["angle_deg"][-1] < 0.15
    assert np.linalg.norm(error["slope_deg_h"]) < 4 * np.linalg.norm(error["slope_uncertainty_deg_h"]) + 8


def test_rest_is_found(logs, capsys):
    data = judged(logs, capsys, "--bias", "rest", "--latitude-deg", "48.1")
    np.testing.assert_allclose(data["bias_deg_s"], BIAS_DEG_S, atol=4 * max(data["bias_uncertainty_deg_s"]))


def test_clocks_are_compared_without_the_bias(logs, capsys, tmp_path):
    lines = np.loadtxt(logs / "gyro.csv", delimiter=",", skiprows=1)
    lines[:, 1:] += (1, -2, 0.5)
    np.savetxt(tmp_path / "gyro.csv", lines, "%.9f", ",", header="t [s],gx [deg/s],gy,gz", comments="")
    (tmp_path / "truth.csv").write_bytes((logs / "truth.csv").read_bytes())
    offset = judged(tmp_path, capsys, "--bias", "rest")["error"]["time_offset_s"]
    assert offset == pytest.approx(judged(logs, capsys, "--bias", "rest")["error"]["time_offset_s"], abs=1e-7)
    assert offset == pytest.approx(12.25, abs=5e-4)
    assert judged(tmp_path, capsys)["error"]["time_offset_s"] != pytest.approx(12.25, abs=5e-4)


@pytest.mark.parametrize(
    ("options", "drift_deg_s"),
    [
        ([], BIAS_DEG_S),
        (["--bias", "0.05,-0.12,0.08"], [0, 0, 0]),
        (["--bias", "0.05 -0.12 1.08"], [0, 0, -1]),
    ],
)
def test_error_is_that_of_the_rate_that_is_left(options, drift_deg_s, logs, capsys):
    """At rest the error grows by the bias that is left and the Earth's rate, in reference axes."""
    error = judged(logs, capsys, *options, "--end", "4.99", "--time-offset", "12.25")["error"]
    seen = BEGIN.apply(np.array(drift_deg_s)) + np.degrees(earth_rate(LATITUDE))
    np.testing.assert_allclose(np.array(error["slope_deg_h"]) / 3600, seen, atol=0.006)
    assert (error["correlation"], error["time_offset_s"]) == (None, 12.25)


def test_initial_attitude_is_kept_with_a_truth(logs, capsys):
    error = judged(logs, capsys, "--initial-deg=-10,20,73", "--bias", "rest")["error"]
    assert error["align"] == "none"
    np.testing.assert_allclose(error["error_deg"][0], [0, 0, 3], atol=0.05)


def test_files_have_the_error_beside_the_attitude(logs, capsys, tmp_path):
    arguments = ["--recording", f"{logs}/gyro.csv", "--input", "rates", "--bias", "rest", "--attitude", "rpy"]
    arguments += ["--true-attitude", f"{logs}/truth.csv", "--plot", f"{tmp_path}/attitude.svg"]
    _, said = run([*arguments, "--out", f"{tmp_path}/attitude.parquet"], capsys)
    table = pl.read_parquet(tmp_path / "attitude.parquet")
    assert table.columns == [
        *("time_s", "roll_deg", "pitch_deg", "heading_deg", "error_deg"),
        *(f"error_{axis}_deg" for axis in "xyz"),
    ]
    np.testing.assert_allclose(table.row(0)[1:4], [-10, 20, 70], atol=0.1)
    for words in (
        "taken off, at rest from",
        "the truth's clock is ahead by 12.2",
        "the run begins at the true",
    ):
        assert words in said
    assert b"error beside the true attitude" in (tmp_path / "attitude.svg").read_bytes()


@pytest.mark.parametrize(("format", "columns"), [("tum", 8), ("kitti", 12)])
def test_trajectories_have_the_attitude(format, columns, logs, capsys):
    out, _ = run(["--recording", f"{logs}/gyro.csv", "--input", "rates", "--format", format], capsys)
    rows = np.array([line.split() for line in out.splitlines()], float)
    assert rows.shape == (SECONDS * HZ // 2 + 1, columns)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--bias", "none"], "--bias is 'none'; rest, or three numbers in deg/s"),
        (["--bias-from", "3"], "--bias-from is '3'; two times in s with a colon between"),
        (["--bias-from", "0:99"], "bias from 0 s to 99 s: at least 8 samples between"),
        (["--bias", "rest", "--bias-from", "0:5"], "--bias and --bias-from are both given"),
        (["--true-sense", "body-to-reference"], "--true-sense needs --true-attitude"),
        (["--level-axes", "enu"], "--level-axes needs --latitude-deg"),
        (["--latitude-deg", "48"], "--latitude-deg needs the attitude at the start"),
        (
            ["--attitude", "rpy", "--quaternion", "sxyz"],
            "--quaternion goes with --attitude quaternion, not rpy",
        ),
        (["--format", "parquet"], "--format parquet is no text; --out FILE is needed"),
        (
            ["--true-attitude", "{logs}/gyro.csv"],
            "no attitude is named among the columns 't [s]', 'gx [deg/s]'",
        ),
        (["--true-attitude", "{logs}/truth.csv:pose"], "topic 'pose' is not known"),
        (
            ["--true-attitude", "{logs}/truth.csv", "--true-columns", "1,2,3"],
            "--true-columns 1,2,3 names 3 columns",
        ),
        (["--true-attitude", "{logs}/truth.csv", "--time-offset", "999"], "they have to overlap"),
        (["--end", "4", "--true-attitude", "{logs}/truth.csv"], "--time-offset"),
        (
            ["--out", "{logs}/truth.csv", "--true-attitude", "{logs}/truth.csv"],
            "is a file that the command reads",
        ),
    ],
)
def test_refusal_is_one_line(options, said, logs, capsys):
    options = [one.format(logs=logs) for one in options]
    out, error = run(["--recording", f"{logs}/gyro.csv", "--input", "rates", *options], capsys, status=2)
    assert out == "" and error.count("\n") == 1 and said in error


def test_options_of_a_recording_need_one(capsys):
    motion = ["--motion", "constant", "--set", "z_deg_s=1", "--step", "0.1", "--duration", "1"]
    for option in (["--bias", "rest"], ["--attitude", "rpy"], ["--format", "tum"]):
        _, error = run([*motion, *option], capsys, status=2)
        assert f"{option[0]}" in error and "needs --recording" in error
