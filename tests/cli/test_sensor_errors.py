"""`--errors`: simulate, strapdown and compare with sensors that have errors, and what is refused."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import numpy as np
import pytest

from strapgen.cli import main

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
MOTION = "--motion coning --set a_deg_s=10 b_deg_s=10 g_deg_s=10 --duration 2"
VIBRATION = (
    "vibration euler --step 0.01 --frequency-hz 20 --theta-x-rad 0.01 --theta-y-rad 0.01 --phase-rad 0"
)
LOG = "--increments-csv log.csv"


@pytest.fixture
def run(capsys, tmp_path, monkeypatch):
    """Return a function that runs a command in an empty folder, and returns status, output and what stderr says."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "none.toml").write_text("")
    (tmp_path / "bias.toml").write_text("[gyro]\nbias_deg_h = 3600\n")
    (tmp_path / "pulse.toml").write_text("[gyro]\npulse_arcsec = 1\n")
    (tmp_path / "force.toml").write_text("[gyro]\ng_deg_h_g = { xz = 360 }\n")
    (tmp_path / "bad.toml").write_text("[gyro]\nbias = 3600\n")
    # Two of the slowest cycles of what reads it.
    (tmp_path / "log.csv").write_text(
        "".join((EXAMPLES / "inertial_log.csv").read_text().splitlines(keepends=True)[:201])
    )
    (tmp_path / "inc.csv").write_text(
        "t,dx,dy,dz\n" + "".join(f"{k / 100},0,0,{0.001 * (k % 3)}\n" for k in range(1, 51))
    )

    def result(command: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(command))
        printed = capsys.readouterr()
        return int(stop.value.code or 0), printed.out, printed.err

    return result


def output(run, command: str) -> str:
    status, text, said = run(command)
    assert status == 0, said
    return text


def without_errors(text: str) -> object:
    data = json.loads(text)
    if isinstance(data, dict):
        data.pop("errors", None)
    return data


@pytest.mark.parametrize(
    "command",
    [
        f"simulate euler {MOTION} --step 0.02 --format json",
        f"simulate dcm --method rk2 {MOTION} --step 0.02 --format json --backend c",
        "simulate euler --increments-csv inc.csv --format json",
        f"simulate {EXAMPLES}/attitude.toml {MOTION} --format json",
        f"strapdown dcm {LOG} --fast-cycles 4 --slow-cycles 25 --format json",
        f"strapdown {EXAMPLES}/strapdown.toml {LOG} --format json",
    ],
)
def test_a_file_without_errors_changes_no_digit(command, run):
    assert without_errors(output(run, f"{command} --errors none.toml")) == json.loads(output(run, command))


def test_compare_without_errors_changes_no_angle(run):
    command = f"compare euler {MOTION} --step 0.02 --backend numpy,c --format json"

    def angles(text: str) -> list[float]:
        return [row["max_abs_rad"] for row in json.loads(text)]

    plain = angles(output(run, command))
    assert len(plain) == 2 and angles(output(run, f"{command} --errors none.toml")) == plain


def test_a_bias_of_a_degree_a_second_is_seen_by_every_command(run):
    rest = "--motion constant --set z_deg_s=0 --duration 2 --errors bias.toml"
    data = json.loads(output(run, f"simulate euler {rest} --step 0.02 --format json"))
    angle = np.radians(2.0)
    # The error matrix of a turn about (1, 1, 1) by sqrt(3) times the angle of an axis; what leads has a negative drift.
    about = -np.sin(angle * np.sqrt(3)) / np.sqrt(3)
    np.testing.assert_allclose(np.radians(data["drift_deg"][-1]), about, rtol=1e-6)
    assert data["errors"] == "bias.toml"
    (row,) = json.loads(output(run, f"compare euler {rest} --step 0.02 --backend c --format json"))
    assert row["drift_deg"] == pytest.approx(2 * np.sqrt(3), rel=1e-2)
    system = json.loads(output(run, f"simulate {EXAMPLES}/attitude.toml {rest} --format json"))
    np.testing.assert_allclose(np.radians(system["drift_deg"][-1]), about, rtol=1e-4)
    log = f"{LOG} --format csv"
    for algorithm in ("dcm --fast-cycles 4 --slow-cycles 25", f"{EXAMPLES}/strapdown.toml"):
        command = f"strapdown {algorithm} {log}"
        assert output(run, f"{command} --errors bias.toml") != output(run, command)


def test_a_class_and_every_example_run(run):
    for name in ("ins-0.1", "ins-1", "ahrs", "midcourse", *sorted((EXAMPLES / "sensors").glob("*.toml"))):
        text = output(
            run, f"simulate euler {MOTION} --step 0.02 --record 1 --specific-force 0,0,9.81 --errors {name}"
        )
        assert "errors" in text
    assert len([*(EXAMPLES / "sensors").glob("*.toml")]) == 6


def test_fixed_point_takes_formats_that_hold_the_errors(run):
    rest = "--motion constant --set z_deg_s=0 --duration 2 --step 0.02 --errors bias.toml --format json"
    fixed, plain = (
        json.loads(output(run, f"simulate euler --backend {name} {rest}"))
        for name in ("fixed-model", "numpy")
    )
    # The formats are those of 3.5e-4 rad in a step of 32 bits, far finer than the drift.
    np.testing.assert_allclose(fixed["drift_deg"][-1], plain["drift_deg"][-1], rtol=1e-5)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (f"simulate euler {MOTION} --step 0.02 --errors nothing.toml", "nothing.toml cannot be read"),
        (
            f"simulate euler {MOTION} --step 0.02 --errors bad.toml",
            "bad.toml: gyro: key 'bias' is not known",
        ),
        (f"compare euler {MOTION} --step 0.02 --errors bad.toml", "bad.toml: gyro: key 'bias' is not known"),
        (
            f"strapdown dcm {LOG} --fast-cycles 4 --errors bad.toml",
            "bad.toml: gyro: key 'bias' is not known",
        ),
        (f"simulate euler {MOTION} --step 0.02 --errors force.toml", "a specific force is needed"),
        (f"simulate euler {MOTION} --step 0.02 --rates --errors bias.toml", "the algorithm takes rates"),
        (f"simulate euler {MOTION} --step 0.02 --pulse-arcsec 1 --errors pulse.toml", "are both there"),
        (
            f"simulate euler {MOTION} --step 0.02 --specific-force 0,0,1",
            "--specific-force goes with a described",
        ),
        (f"{VIBRATION} --gyro-bandwidth-hz 80,60,40 --gyro-damping 1", "one number or two with a comma"),
        (f"{VIBRATION} --gyro-bandwidth-hz 80,0 --gyro-damping 1", "gyro-bandwidth-hz is 0"),
        ("simulate euler --increments-csv inc.csv --errors force.toml", "no velocity increments"),
        (
            f"simulate euler {MOTION} --step 0.02 --errors bias.toml --out bias.toml",
            "is a file that the command reads",
        ),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line(command, words, run):
    status, text, said = run(command)
    assert (status, text) == (2, "")
    assert words in said and said.count("\n") == 1
