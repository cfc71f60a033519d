"""Where described systems begin, and what is said of their runs: the truth begins with the motion."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest

from strapgen.cli import main

CONING = "--motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10"
#: A system of one stage that turns an attitude.
SYSTEM = """title = "one stage"
sample_hz = 100
outputs = ["turn.{output}"]
[inputs.gyro]
unit = "rad"
frame = "b"
range = 1
[[stage]]
name = "turn"
kernel = "{kernel}"
every = 1
wires = {{ rotation_vector = "gyro" }}
{rest}
"""


def says(words: str, capsys) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(words))
    said = capsys.readouterr()
    return int(stop.value.code or 0), said.out, said.err


@pytest.fixture
def system(tmp_path: Path):
    def write(kernel: str, output: str = "state", rest: str = "") -> Path:
        path = tmp_path / "one.toml"
        path.write_text(SYSTEM.format(kernel=kernel, output=output, rest=rest))
        return path

    return write


@pytest.mark.parametrize("kernel", ["euler-update", "dcm-update", "cayley-klein-update"])
def test_attitude_begins_without_rotation_and_follows_the_motion(kernel, system, capsys):
    status, out, _ = says(f"simulate {system(kernel)} {CONING} --duration 10 --format json", capsys)
    drift = json.loads(out)["mean_drift_deg"]
    assert status == 0 and 0 < drift < 0.1


def test_truth_does_not_begin_with_the_system(system, capsys):
    """It is turned by 180 deg about z; its drift vector is that of a half turn but for its sign: not small."""
    path = system("euler-update", rest="initial = { state = [0, 0, 0.6, 0.8] }")
    status, out, _ = says(f"simulate {path} {CONING} --duration 1 --format json", capsys)
    assert status == 0 and json.loads(out)["mean_drift_deg"] > 50


def test_rows_without_initial_are_refused(system, capsys):
    status, out, error = says(
        f"simulate {system('dcm-two-rows-update', 'row_1')} {CONING} --duration 1", capsys
    )
    assert (status, out, error.count("\n")) == (2, "", 1)
    assert "row_1 is of length 1, and zero is none; state it under initial" in error


def test_attitude_that_is_no_rotation_has_no_drift(system, capsys):
    path = system("euler-update", rest="initial = { state = [0, 0, 0, 0] }")
    status, out, error = says(f"simulate {path} {CONING} --duration 1", capsys)
    assert (status, out, error.count("\n")) == (2, "", 1) and "is no rotation at 0 s" in error


@pytest.mark.parametrize("duration", ["1e308", "1e7"])
def test_run_of_too_many_cycles_is_refused_before_it_begins(duration, system, capsys):
    status, out, error = says(f"simulate {system('euler-update')} {CONING} --duration {duration}", capsys)
    assert (status, out, error.count("\n")) == (2, "", 1) and "up to 20,000,000 are run" in error


def test_records_of_blocks_are_those_of_one_run(system, capsys, monkeypatch):
    from strapgen.navigation.systems import system_runner

    line = f"simulate {system('euler-update')} {CONING} --duration 1.5 --record 0.05 --format json"
    whole = json.loads(says(line, capsys)[1])
    monkeypatch.setattr(system_runner, "BLOCK", 7)
    assert json.loads(says(line, capsys)[1]) == whole
