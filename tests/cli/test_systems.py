"""Commands that take a described system in place of an algorithm: what they deliver, and what they refuse."""

from __future__ import annotations

import csv
import json
import shlex

import numpy as np
import pytest
from small_systems import COUNTING

from strapgen.cli import main
from strapgen.lab.motions.motions import motion

CONING = "--motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10"


def says(command: str, capsys) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(command))
    said = capsys.readouterr()
    return int(stop.value.code or 0), said.out, said.err


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "counting.toml"
    path.write_text(COUNTING)
    return path


@pytest.fixture
def log(tmp_path):
    """Coning at 100 samples a second, on a body that does not fall."""
    path = tmp_path / "log.csv"
    angle = motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10).increments(1 / 100, 200, 1)[:, 0]
    rows = [[(k + 1) / 100, *map(float, row), 0, 0, 0.0981] for k, row in enumerate(angle)]
    path.write_text("\n".join(["t,dx,dy,dz,dvx,dvy,dvz", *(",".join(map(repr, row)) for row in rows)]))
    return path


def test_simulate_shows_the_errors_of_a_system(file, tmp_path, capsys):
    command = f"simulate {file} {CONING} --duration 1 --record 0.1"
    status, out, err = says(f"{command} --format json --matrices --initial-deg 10,20,30", capsys)
    assert (status, err) == (0, "")
    data = json.loads(out)
    assert data["system"] == str(file) and data["sample_hz"] == 100
    assert data["specific_force_m_s2"] == [0, 0, 0] and len(data["time_s"]) == 11
    # Half a count of 1e-5 rad on each axis, three times for the turns between.
    assert 0 < data["mean_drift_deg"] < np.degrees(3 * 0.5e-5 * np.sqrt(3))
    np.testing.assert_allclose(data["computed"], data["true"], atol=3e-5)
    assert "mean drift, deg" in says(command, capsys)[1]
    # A step of its own replaces the rate of the file.
    status, out, _ = says(f"simulate {file} {CONING} --duration 1 --step 0.005 --format json", capsys)
    assert json.loads(out)["sample_hz"] == 200 and len(json.loads(out)["time_s"]) == 101


def test_a_recording_gives_attitude_and_outputs(file, log, tmp_path, capsys):
    status, out, _ = says(
        f"simulate {file} --rates-csv {log} --columns t,dx,dy,dz --rate-unit rad/s --format json", capsys
    )
    assert status == 0 and json.loads(out)["sample_hz"] == 100
    status, out, err = says(f"strapdown two-speed-euler --increments-csv {log} --format json", capsys)
    assert (status, err) == (0, "")
    data = json.loads(out)
    assert data["units"] == {"slow_state": "1", "nav_velocity_change": "m/s"} and data["unused_samples"] == 0
    np.testing.assert_allclose(data["time_s"], 0.1 * np.arange(1, 21), rtol=1e-12)
    np.testing.assert_allclose(
        np.linalg.norm(data["outputs"]["nav_velocity_change"], axis=1), 0.981, rtol=1e-3
    )
    table = tmp_path / "course.csv"
    assert says(f"strapdown two-speed-euler --increments-csv {log} --out {table}", capsys)[0] == 0
    rows = [*csv.reader(table.read_text().splitlines())]
    assert rows[0][:2] == ["time_s", "slow_state_x"] and rows[0][-1] == "nav_velocity_change_z, m/s"
    assert len(rows) == 21 and float(rows[-1][1]) == pytest.approx(
        data["outputs"]["slow_state"][-1][0], rel=1e-8
    )
    status, out, _ = says(f"strapdown two-speed-euler --increments-csv {log} --initial-deg 0,0,90", capsys)
    assert "slow_state, unit 1, frame b to n" in out


def test_names_of_built_in_systems_are_listed(capsys):
    status, out, _ = says("list systems --format json", capsys)
    assert status == 0 and "two-speed-euler" in json.loads(out)["systems"]


def test_what_does_not_go_with_a_system_is_refused_in_one_line(file, log, tmp_path, capsys):
    gyro = tmp_path / "gyro.toml"
    gyro.write_text(
        COUNTING.partition('[[stage]]\nname = "attitude"')[0].replace("attitude.state", "gyro.increment")
    )
    run = f"{file} {CONING} --duration 1"
    for command, said in [
        (f"simulate {run} --method rk4", "--method does not go with a described system"),
        (f"simulate {run} --orthonormalize 1", "--orthonormalize does not go"),
        (f"simulate {run} --scheme dcm-normalize", "--scheme does not go"),
        (f"simulate {run} --print 1", "--print does not go"),
        (f"simulate {run} --backend c-fixed32 --max-rate-deg-s 9", "--max-rate-deg-s does not go"),
        (f"simulate {run} --word 16", "--word is for fixed-point back ends"),
        (f"simulate {run} --specific-force 1,2", "--specific-force is '1,2'; three numbers"),
        (f"simulate {run} --specific-force 1,2,x", "specific-force"),
        (f"simulate {run} --record 0.03", "record"),
        (f"simulate {file} {CONING}", "--motion needs --duration"),
        (f"simulate {file} {CONING} --duration 0.03", "no whole number of cycles"),
        (f"simulate {file} {CONING} --duration 1 --step 0", "step"),
        (f"simulate {gyro} {CONING} --duration 1", "system gyro has no attitude among its outputs"),
        (f"simulate {tmp_path}/none.toml {CONING} --duration 1", "none.toml cannot be read"),
        (f"simulate {file} --increments-csv {log} --record 1", "go with --motion"),
        (f"simulate {file} --increments-csv {log} --specific-force 0,0,1", "--specific-force needs --motion"),
        (f"simulate euler {CONING} --step 0.1 --duration 1 --specific-force 0,0,1", "--specific-force goes"),
        (f"compare {run} --fail-above 1", "--fail-above does not go"),
        (f"compare {run} --source x.c", "x.c"),
        (f"compare {run} --plot {tmp_path}/x.png", "--plot does not go"),
        (f"compare {run} --increments 3", "--increments does not go"),
        (f"strapdown {file} --increments-csv {log} --fast-cycles 4", "--fast-cycles does not go"),
        (f"strapdown {file} --increments-csv {log} --frame-rate-deg-h 1,2,3", "--frame-rate-deg-h does not"),
        (f"strapdown {file} --increments-csv {log} --plot {tmp_path}/x.png", "--plot does not go"),
        (f"strapdown dcm --increments-csv {log}", "--fast-cycles is missing"),
        (f"evidence {file} --method rk4 --tool z3", "--method does not go"),
        (f"evidence {file} --lsb-rad 1 --tool z3", "--lsb-rad does not go"),
        (f"verify {tmp_path}", "holds none of the headers of a system"),
    ]:
        status, out, err = says(command, capsys)
        assert (status, out, err.count("\n")) == (2, "", 1) and said in err, (command, err)
    assert not [*tmp_path.glob("*.png")]


@pytest.mark.long
def test_evidence_examines_every_stage_as_it_stands_in_the_system(file, capsys):
    pytest.importorskip("flint")
    status, out, _ = says(f"evidence {file} --word 16 --tool balls --format json", capsys)
    rows = json.loads(out)
    assert status == 0
    assert {row["result"] for row in rows} == {"agrees"}
    assert [*dict.fromkeys(row["kernel"] for row in rows)] == ["counting_gyro_w16", "counting_attitude_w16"]
