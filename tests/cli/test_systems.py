"""Commands that take a described system in place of an algorithm: what they deliver, and what they refuse."""

from __future__ import annotations

import csv
import json
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from commands import says
from small_systems import COUNTING

from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.lab.motions.motions import motion
from strapgen.navigation.systems.system_runner import system_runner
from strapgen.navigation.systems.wiring import described
from strapgen.navigation.two_speed.two_speed_runner import LoopFiles, TwoSpeed
from strapgen.navigation.two_speed.two_speed_sources import loops

CONING = "--motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10"


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
        f"simulate {file} --input instants --recording {log} --columns t,dx,dy,dz --rate-unit rad/s --format json",
        capsys,
    )
    assert status == 0 and json.loads(out)["sample_hz"] == 100
    status, out, err = says(f"strapdown two-speed-euler --recording {log} --format json", capsys)
    assert (status, err) == (0, "")
    data = json.loads(out)
    assert data["units"] == {"slow_state": "1", "nav_velocity_change": "m/s"} and data["unused_samples"] == 0
    np.testing.assert_allclose(data["time_s"], 0.1 * np.arange(1, 21), rtol=1e-12)
    np.testing.assert_allclose(
        np.linalg.norm(data["outputs"]["nav_velocity_change"], axis=1), 0.981, rtol=1e-3
    )
    table = tmp_path / "course.csv"
    assert says(f"strapdown two-speed-euler --recording {log} --out {table}", capsys)[0] == 0
    rows = [*csv.reader(table.read_text().splitlines())]
    assert rows[0][:2] == ["time_s", "slow_state_x"] and rows[0][-1] == "nav_velocity_change_z, m/s"
    assert len(rows) == 21 and float(rows[-1][1]) == pytest.approx(
        data["outputs"]["slow_state"][-1][0], rel=1e-8
    )
    status, out, _ = says(f"strapdown two-speed-euler --recording {log} --initial-deg 0,0,90", capsys)
    assert "slow_state, unit 1, frame b to n" in out


def test_names_of_built_in_systems_are_listed(capsys):
    status, out, _ = says("list systems --format json", capsys)
    assert status == 0 and "two-speed-euler" in json.loads(out)["systems"]


def test_options_not_for_systems_are_refused_in_one_line(file, log, tmp_path, capsys):
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
        (f"simulate {file} --recording {log} --record 1", "goes with --motion"),
        (f"simulate {file} --recording {log} --specific-force 0,0,1", "--specific-force needs --motion"),
        (f"simulate euler {CONING} --step 0.1 --duration 1 --specific-force 0,0,1", "--specific-force goes"),
        (f"compare {run} --fail-above 1", "--fail-above does not go"),
        (f"compare {run} --source x.c", "x.c"),
        (f"compare {run} --plot {tmp_path}/x.png", "--plot does not go"),
        (f"compare {run} --increments 3", "--increments does not go"),
        (f"strapdown {file} --recording {log} --fast-cycles 4", "--fast-cycles does not go"),
        (f"strapdown {file} --recording {log} --frame-rate-deg-h 1,2,3", "--frame-rate-deg-h does not"),
        (f"strapdown {file} --recording {log} --plot {tmp_path}/x.png", "--plot does not go"),
        (f"strapdown dcm --recording {log}", "--fast-cycles is missing"),
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


SECOND_AT_400_HZ = f"{CONING} --duration 1 --step 0.0025"
GYRO = "--target c-fixed --sample-hz 400 --lsb 0.0175dps"


@pytest.fixture
def system_source(tmp_path, capsys) -> Path:
    assert says(f"system two-speed-dcm {GYRO} --out {tmp_path}/system", capsys)[0] == 0
    return tmp_path / "system" / "two_speed_dcm_w32.c"


@pytest.fixture
def two_speed(tmp_path, capsys) -> Path:
    assert says(f"two-speed dcm {GYRO} --out {tmp_path}/loops", capsys)[0] == 0
    return tmp_path / "loops" / "dcm_two_speed_2_w32.h"


def test_system_runs_on_the_counts_of_its_header(system_source, capsys):
    line = f"compare two-speed-dcm --source {system_source} --backend c-fixed32 --reference exact {SECOND_AT_400_HZ}"
    status, out, _ = says(f"{line} --format json", capsys)
    rows = json.loads(out)
    assert status == 0 and [row["backend"] for row in rows] == ["c-fixed32"] * 2 + [str(system_source)] * 2
    # The back end of the same word runs on the same counts, and computes the same integers.
    alike = [{**row, "backend": ""} for row in rows]
    assert alike[:2] == alike[2:]
    assert 0 < rows[0]["one_pass"] <= rows[0]["bound"]
    # Each of 50 slow cycles adds the bound of a pass to three elements of a row, which only turn, and 7 passes of the
    # fast loop, less than a tenth of it. Without whole counts for all, half a count would be between the two.
    assert 0 < rows[0]["run"] <= 50 * 3 * rows[0]["bound"] < 7.6e-7 / 2


def test_two_speeds_run_at_the_rates_of_the_built_in_system(two_speed, capsys):
    line = f"compare two-speed-dcm --source {two_speed} --reference exact {SECOND_AT_400_HZ} --format json"
    status, out, _ = says(line, capsys)
    rows = {row["output"]: row for row in json.loads(out)}
    assert status == 0 and {*rows} == {"slow_state", "nav_velocity_change"}
    fast, slow, navigation = loops("dcm", 2, "c-fixed", Settings.of(sample_hz=400, lsb="0.0175dps"))
    sums = sum(max(a.errors) for a in fast.fixed.outputs[:2])
    turned = max(slow.fixed.outputs[0].errors) + max(navigation.fixed.outputs[0].errors)
    # 50 slow cycles of 20 ms, each with the sums of 8 fast ones in three components, and the rounding of two loops.
    assert 0 < rows["slow_state"]["run"] <= float(50 * (3 * 8 * sums + 3 * turned))
    assert rows["slow_state"]["one_pass"] is None


@pytest.mark.parametrize("algorithm", ["dcm", "euler"])
def test_loops_run_as_the_built_in_system_does(algorithm, rng):
    """In floating point both compute the same numbers, but for rounding, in a navigation frame that turns."""
    description = described(f"two-speed-{algorithm}", Fraction(400))
    inputs = {
        signal.name: rng.uniform(-0.5, 0.5, (80, 3)) * float(signal.bound)
        for signal in description.system.inputs
    }
    expected = system_runner(description, "numpy").run(inputs).values
    values = LoopFiles(TwoSpeed(algorithm, 2, "numpy"), description.system).run(inputs).values
    assert {*values} == {*expected} and len(values) == 2
    for name, rows in expected.items():
        # Turns of up to 5e-5 rad in ten slow cycles; rounding of doubles of at most 10 m/s, some hundred times.
        np.testing.assert_allclose(values[name], rows, rtol=0, atol=1e-13)
    with pytest.raises(InputError, match="has 79 cycles; two speeds take whole navigation cycles, of 40"):
        LoopFiles(TwoSpeed(algorithm, 2, "numpy"), description.system).run(
            {name: rows[1:] for name, rows in inputs.items()}
        )


def test_files_that_are_no_part_of_the_comparison_are_refused(system_source, two_speed, tmp_path, capsys):
    def refused(line: str, said: str) -> None:
        status, out, error = says(f"compare {line}", capsys)
        assert (status, out, error.count("\n")) == (2, "", 1) and said in error, error

    at = f"{SECOND_AT_400_HZ}"
    for file in (system_source, two_speed):
        refused(
            f"two-speed-dcm --source {file} {CONING} --duration 1", "is for 400 Hz, and 3200 Hz is compared"
        )
    refused(f"two-speed-euler --source {system_source} {at}", "another two_speed_euler is compared")
    refused(f"two-speed-euler --source {two_speed} {at}", "which are not those of two_speed_euler")
    stage = system_source.with_name("two_speed_dcm_fast_w32.c")
    refused(f"two-speed-dcm --source {stage} {at}", "is no source or header of a described system")
    other = tmp_path / "other"
    assert says(f"two-speed dcm {GYRO.replace('0.0175', '0.02')} --out {other}", capsys)[0] == 0
    both = f"--source {two_speed} --source {other}"
    refused(f"two-speed-dcm {both} {at}", "are different gyros; one run has the counts of one")
    for file in (system_source, two_speed):
        source = file.with_suffix(".c")
        source.write_text(source.read_text().replace("return 0;", "return  0;", 1))
        refused(f"two-speed-dcm --source {file} {at}", "edited: return 0;")
        line = f"compare two-speed-dcm --source {file} {at} --run-differing --format json"
        assert says(line, capsys)[0] == 0
