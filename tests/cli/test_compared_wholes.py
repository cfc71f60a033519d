"""`compare --source` on files of systems and of two speeds: on the counts of their headers, and only if in step."""

from __future__ import annotations

import json
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from strapgen.cli import main
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.navigation.systems.system_runner import system_runner
from strapgen.navigation.systems.wiring import described
from strapgen.navigation.two_speed.two_speed_runner import LoopFiles, TwoSpeed
from strapgen.navigation.two_speed.two_speed_sources import loops

GYRO = "--target c-fixed --sample-hz 400 --lsb 0.0175dps"
CONING = "--motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 --duration 1"


def says(line: str, capsys) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as stop:
        main(line.split())
    said = capsys.readouterr()
    return int(stop.value.code or 0), said.out, said.err


@pytest.fixture
def system(tmp_path, capsys) -> Path:
    assert says(f"system two-speed-dcm {GYRO} --out {tmp_path}/system", capsys)[0] == 0
    return tmp_path / "system" / "two_speed_dcm_w32.c"


@pytest.fixture
def two_speed(tmp_path, capsys) -> Path:
    assert says(f"two-speed dcm {GYRO} --out {tmp_path}/loops", capsys)[0] == 0
    return tmp_path / "loops" / "dcm_two_speed_2_w32.h"


def test_system_runs_on_the_counts_of_its_header(system, capsys):
    line = f"compare two-speed-dcm --source {system} --backend c-fixed32 --reference exact {CONING} --step 0.0025"
    status, out, _ = says(f"{line} --format json", capsys)
    rows = json.loads(out)
    assert status == 0 and [row["backend"] for row in rows] == ["c-fixed32"] * 2 + [str(system)] * 2
    # The back end of the same word runs on the same counts, and computes the same integers.
    alike = [{**row, "backend": ""} for row in rows]
    assert alike[:2] == alike[2:]
    assert 0 < rows[0]["one_pass"] <= rows[0]["bound"]
    # Each of 50 slow cycles adds the bound of a pass to three elements of a row, which only turn, and 7 passes of the
    # fast loop, less than a tenth of it. Without whole counts for all, half a count would be between the two.
    assert 0 < rows[0]["run"] <= 50 * 3 * rows[0]["bound"] < 7.6e-7 / 2


def test_two_speeds_run_at_the_rates_of_the_built_in_system(two_speed, capsys):
    line = (
        f"compare two-speed-dcm --source {two_speed} --reference exact {CONING} --step 0.0025 --format json"
    )
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


def test_files_that_are_no_part_of_the_comparison_are_refused(system, two_speed, tmp_path, capsys):
    def refused(line: str, said: str) -> None:
        status, out, error = says(f"compare {line}", capsys)
        assert (status, out, error.count("\n")) == (2, "", 1) and said in error, error

    at = f"{CONING} --step 0.0025"
    for file in (system, two_speed):
        refused(f"two-speed-dcm --source {file} {CONING}", "is for 400 Hz, and 3200 Hz is compared")
    refused(f"two-speed-euler --source {system} {at}", "another two_speed_euler is compared")
    refused(f"two-speed-euler --source {two_speed} {at}", "which are not those of two_speed_euler")
    stage = system.with_name("two_speed_dcm_fast_w32.c")
    refused(f"two-speed-dcm --source {stage} {at}", "is no source or header of a described system")
    other = tmp_path / "other"
    assert says(f"two-speed dcm {GYRO.replace('0.0175', '0.02')} --out {other}", capsys)[0] == 0
    both = f"--source {two_speed} --source {other}"
    refused(f"two-speed-dcm {both} {at}", "are different gyros; one run has the counts of one")
    for file in (system, two_speed):
        source = file.with_suffix(".c")
        source.write_text(source.read_text().replace("return 0;", "return  0;", 1))
        refused(f"two-speed-dcm --source {file} {at}", "edited: return 0;")
        line = f"compare two-speed-dcm --source {file} {at} --run-differing --format json"
        assert says(line, capsys)[0] == 0
