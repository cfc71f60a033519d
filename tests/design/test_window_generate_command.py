"""The command that writes C which commits an attitude late."""

from __future__ import annotations

import json
import shlex
from dataclasses import replace
from fractions import Fraction

import pytest

import strapgen
from strapgen.catalogue.methods.window import GyroResponse
from strapgen.catalogue.methods.windows import WINDOWS
from strapgen.cli import main
from strapgen.design.commit_late.commit_late_sources import sources
from strapgen.design.family import written
from strapgen.run.standard_tree import command_of


@pytest.fixture
def run(capsys, tmp_path, monkeypatch):
    """Return a function that runs a command line in a folder of its own and returns status, stdout and stderr."""
    monkeypatch.chdir(tmp_path)

    def run(command: str) -> tuple[object, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(command))
        return stop.value.code, *capsys.readouterr()

    return run


def test_files_are_those_of_the_library_and_are_in_step(run, tmp_path):
    command = "window generate window-3-3 --out out"
    status, said, _ = run(command)
    files = sources("window-3-3").files
    assert status == 0
    assert said.split()[:3] == ["euler_late_3_3", "for", "c"]
    assert {path.name: path.read_text() for path in (tmp_path / "out").iterdir()} == files
    assert run(f"{command} --check") == (0, "", "")
    (tmp_path / "out" / "euler_late_3_3.c").write_text("/* mine */\n")
    status, said, _ = run(f"{command} --check")
    assert status == 1
    assert "-/* mine */" in said
    status, _, warned = run(command)
    assert status == 2
    assert "--force writes over it" in warned


def test_options_choose_numbers_attitude_and_name(run):
    status, said, _ = run(
        "window generate window-3-3 --algorithm dcm --target c-float --name nav --format json --out out"
    )
    data = json.loads(said)
    assert status == 0
    assert (data["name"], data["target"]) == ("nav", "c-float")
    assert data["files"][:3] == ["out/nav.h", "out/nav.c", "out/dcm_window_3_3_float.h"]
    assert data["operations"] == sources("window-3-3", "dcm", "c-float").operations


@pytest.mark.long
def test_filters_for_a_gyro_are_refused_at_another_rate(run, tmp_path):
    family = replace(
        WINDOWS["window-3-3"],
        name="slow-gyro",
        title="Slow gyro",
        conditions=1,
        gyro=GyroResponse(Fraction(40), Fraction(7, 10), Fraction(100)),
    )
    one_sided = tuple(replace(one, conditions=1, gyro=family.gyro) for one in family.one_sided)
    family = replace(family, one_sided=one_sided)
    (tmp_path / "gyro.toml").write_text(written(family, "strapgen window design"))
    for option, reason in (
        ("", "no sampling rate is stated"),
        ("--sample-hz 200", "the sampling rate is 200 Hz"),
    ):
        status, said, warned = run(f"window generate gyro.toml {option} --out out")
        assert (status, said) == (2, "")
        assert reason in warned and warned.count("\n") == 1
    assert not (tmp_path / "out").exists()
    status, said, _ = run("window generate gyro.toml --sample-hz 100 --out out")
    assert status == 0
    assert "euler_late_slow_gyro.h" in said


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("window-3-3 --target c-fixed --word 16", "words of 32 bits"),
        ("window-3-4", "window 'window-3-4' is not known"),
        ("window-4-2", "whole family"),
        ("window-3-3 --algorithm quaternion", "algorithm 'quaternion'"),
        ("window-3-3 --target numpy", "target 'numpy'"),
        ("window-3-3 --sample-hz never", "never"),
        ("window-3-3 --name 3d", "a letter first"),
        ("missing.toml", "missing.toml"),
    ],
)
def test_wrong_options_are_refused_in_one_line(options, message, run, tmp_path):
    status, said, warned = run(f"window generate {options} --out out")
    assert (status, said) == (2, "")
    assert message in warned and warned.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_fixed_point_has_its_options_in_the_command(run, tmp_path):
    options = "--target c-fixed --max-rate-deg-s 400 --sample-hz 100 --carry full"
    status, said, _ = run(f"window generate window-3-3 {options} --out out")
    assert status == 0
    assert "out/euler_late_3_3_w32.h" in said
    header = (tmp_path / "out" / "euler_late_3_3_w32.h").read_text()
    assert command_of(header) == (
        "strapgen window generate window-3-3 --algorithm euler --target c-fixed --word 32 --max-rate-deg-s 400 "
        "--sample-hz 100 --rounding nearest --carry full --drift-allowance 1/16"
    )
    # The command of the header writes the same files.
    again = command_of(header).removeprefix("strapgen ")
    assert run(f"{again} --out out --check")[:2] == (0, "")
    status, said, warned = run("window generate window-3-3 --carry full --out other")
    assert (status, said) == (2, "")
    assert "c-fixed" in warned


def test_a_window_runs_over_a_recording_from_end_to_end(run, tmp_path):
    row = strapgen.motion("random", rate_deg_s=200).samples(Fraction(1, 100), 0, 20)
    lines = [f"{0.01 * (k + 1):.2f},{','.join(map(repr, sample.tolist()))}" for k, sample in enumerate(row)]
    (tmp_path / "log.csv").write_text("\n".join(["t,dx,dy,dz", *lines]))
    command = "simulate euler --method window-3-3 --increments-csv log.csv --backend numpy --format json"
    status, said, warned = run(command)
    assert status == 0, warned
    data = json.loads(said)
    times = data["time_s"]
    assert len(times) == 21
    assert times[-1] - times[0] == pytest.approx(0.2)
