"""Reports: every number of a run comes back from the CSV and JSON, and the text shows what the thesis shows."""

from __future__ import annotations

import csv
import io
import json
import math

import numpy as np
import pytest

import strapgen
from strapgen.lab.recordings.recording import History
from strapgen.lab.runs import Run, simulate
from strapgen.lab.runs_report import HistoryResult, RunResult, history_table, run_table

SETTINGS = {"algorithm": "dcm", "method": "rk1", "increments": 2, "backend": "numpy", "motion": "coning"}
SETTINGS |= {"step_s": 0.125, "duration_s": 60.0}
PLACES = [f"{row}{column}" for row in "123" for column in "123"]


@pytest.fixture(scope="module")
def run() -> Run:
    motion = strapgen.motion("coning", a_deg_s=10, b_deg_s=-7, g_deg_s=3)
    return simulate(strapgen.backend("dcm", "rk1", 2, "numpy"), motion, "0.125", 60, None, "0.5")


def rows(text: str) -> list[dict[str, str]]:
    assert text.endswith("\n") and "\r" not in text
    return list(csv.DictReader(io.StringIO(text)))


def floats(table: list[dict[str, str]], *names: str) -> np.ndarray:
    return np.array([[float(row[name]) for name in names] for row in table])


def test_json_has_the_keys_in_their_order(run):
    data = json.loads(json.dumps(RunResult(dict(SETTINGS), run, matrices=run).data(), allow_nan=False))
    wanted = ["schema", *SETTINGS, "time_s", "scale", "skew_deg", "drift_deg", "mean_drift_deg"]
    assert list(data) == [*wanted, "computed", "true", "difference", "error"]
    assert data["computed"] == run.computed.tolist() and data["error"] == run.error.tolist()
    assert data["difference"] == (run.computed - run.true).tolist()
    assert data["time_s"] == run.time.tolist()
    assert data["scale"] == run.scale.tolist()
    np.testing.assert_allclose(np.radians(data["skew_deg"]), run.skew, rtol=1e-15)
    np.testing.assert_allclose(np.radians(data["drift_deg"]), run.drift, rtol=1e-15)
    largest = np.abs(data["drift_deg"]).max(axis=0)
    assert data["mean_drift_deg"] == pytest.approx(math.sqrt(sum(largest**2)), rel=1e-14)


def test_csv_comes_back_bit_for_bit(run):
    table = rows(run_table(run).as_csv())
    assert [*table[0]] == [
        *("time_s", *(f"scale_{axis}" for axis in "xyz")),
        *(f"{kind}_{axis}_deg" for kind in ("skew", "drift") for axis in "xyz"),
        *(f"{kind}_{place}" for kind in ("computed", "true", "difference", "error") for place in PLACES),
    ]
    assert len(table) == len(run.time) == 121
    np.testing.assert_array_equal(floats(table, "time_s")[:, 0], run.time)
    np.testing.assert_array_equal(floats(table, *(f"scale_{axis}" for axis in "xyz")), run.scale)
    drift = floats(table, *(f"drift_{axis}_deg" for axis in "xyz"))
    np.testing.assert_array_equal(drift, np.degrees(run.drift))
    for name in ("computed", "true", "error"):
        matrices = floats(table, *(f"{name}_{place}" for place in PLACES)).reshape(-1, 3, 3)
        np.testing.assert_array_equal(matrices, getattr(run, name))


def lines_of(run: Run) -> list[str]:
    return RunResult(dict(SETTINGS), run).text().splitlines()


def test_text_shows_settings_matrices_and_drift(run):
    lines = lines_of(run)
    assert lines[0] == ", ".join(f"{key} {value}" for key, value in SETTINGS.items())
    assert lines[-1] == f"mean drift, deg: {math.degrees(run.mean_drift):.6g}"
    start = lines.index("at 60 s")
    for title in ("computed C", "true C", "computed - true", "error matrix E"):
        assert title in lines[start + 1]
    shown = np.array([[float(cell) for cell in line.split()] for line in lines[start + 2 : start + 5]])
    assert shown.shape == (3, 12)
    np.testing.assert_allclose(shown[:, :3], run.computed[-1], rtol=0, atol=5e-10)
    np.testing.assert_allclose(shown[:, 3:6], run.true[-1], rtol=0, atol=5e-10)
    np.testing.assert_allclose(shown[:, 6:9], run.computed[-1] - run.true[-1], rtol=1e-4, atol=1e-300)
    np.testing.assert_allclose(shown[:, 9:], run.error[-1], rtol=1e-4, atol=1e-300)


def test_text_shows_the_nine_errors_in_time(run):
    lines = lines_of(run)
    assert lines[2].split() == ["time", "scale", "skew,", "deg", "drift,", "deg"]
    assert lines[3].split() == ["s", "x", "y", "z", "y-z", "z-x", "x-y", "x", "y", "z"]
    end = next(k for k, line in enumerate(lines) if line.startswith("("))
    shown = np.array([[float(cell) for cell in line.split()] for line in lines[4:end]])
    assert len(shown) == 37
    assert lines[end] == "(37 of 121 records; --format csv prints all, --record S thins them)"
    assert (shown[0, 0], shown[-1, 0]) == (0, 60)
    for row in shown:
        (k,) = np.flatnonzero(run.time == row[0])
        wanted = [*run.scale[k], *np.degrees(run.skew[k]), *np.degrees(run.drift[k])]
        np.testing.assert_allclose(row[1:], wanted, rtol=1e-4, atol=1e-300)


# Histories

NAMES = ("e_x", "e_y", "e_z", "e_s")


@pytest.fixture
def history(rng) -> History:
    states = rng.normal(size=(51, 4)).astype(np.float32)
    return History(5 + 0.25 * np.arange(51), states, 0.125, 3, NAMES)


def test_history_csv_comes_back(history):
    table = rows(history_table(history).as_csv())
    assert list(table[0]) == ["time_s", *NAMES]
    np.testing.assert_array_equal(floats(table, "time_s")[:, 0], history.time)
    np.testing.assert_array_equal(floats(table, *NAMES).astype(np.float32), history.states)


def test_history_data(history):
    settings = {"algorithm": "euler", "source": "gyro.csv"}
    data = json.loads(json.dumps(HistoryResult(settings, history).data(), allow_nan=False))
    wanted = ["step_s", "duration_s", "unused_increments", "elements", "time_s", "attitude"]
    assert list(data) == ["schema", *settings, *wanted]
    assert (data["step_s"], data["duration_s"], data["unused_increments"]) == (0.125, 12.5, 3)
    assert data["elements"] == list(NAMES)
    np.testing.assert_array_equal(np.array(data["attitude"], np.float32), history.states)


def test_history_text(history):
    lines = HistoryResult({"algorithm": "euler"}, history).text().splitlines()
    assert lines[0] == "algorithm euler"
    assert lines[2].split() == ["time,", "s", *NAMES]
    assert len(lines[3].split()) == 5
    assert lines[-2] == "(37 of 51 records; --format csv prints all)"
    assert lines[-1] == "3 increments at the end make no whole step and were not used"
    whole = History(history.time, history.states, history.step, 0)
    assert "no whole step" not in HistoryResult({}, whole).text()


def test_history_of_matrices_is_flat():
    elements = tuple(f"C_{place}" for place in PLACES)
    history = History(np.arange(2.0), np.tile(np.eye(3), (2, 1, 1)), 1.0, 0, elements)
    assert HistoryResult({}, history).data()["attitude"][1] == [1, 0, 0, 0, 1, 0, 0, 0, 1]
    assert len(rows(history_table(history).as_csv())[0]) == 10
