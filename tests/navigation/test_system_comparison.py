"""Described systems on several back ends, and generated files of systems held to their commands."""

from __future__ import annotations

import json
from dataclasses import replace
from fractions import Fraction

import pytest
from small_systems import COUNTING

from strapgen.cli import main
from strapgen.lab.motions.motions import motion
from strapgen.lab.motions.specific_forces import velocity_increments
from strapgen.navigation.systems import system_comparison
from strapgen.navigation.systems.system_comparison import compare_system
from strapgen.navigation.systems.system_runs import samples
from strapgen.navigation.systems.wiring import described

CONING = motion("coning", a_deg_s=10, b_deg_s=10, g_deg_s=10)


def says(arguments: list[str], capsys) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    said = capsys.readouterr()
    return int(stop.value.code or 0), said.out, said.err


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "counting.toml"
    path.write_text(COUNTING)
    return path


def inputs_of(description, cycles):
    interval = 1 / description.system.sample_hz
    angle = CONING.samples(interval, 0, cycles)
    velocity = velocity_increments(CONING.attitude, (0.5, -0.3, 9.81), interval, cycles)
    return samples(description, angle, velocity)


@pytest.mark.parametrize(
    ("name", "backends"),
    [
        ("", ["c", "c-fixed32"]),
        pytest.param("two-speed-euler", ["c", "c-float", "c-fixed32", "c-fixed16"], marks=pytest.mark.long),
        pytest.param("two-speed-dcm-1", ["c-float", "c-fixed16", "fixed-model"], marks=pytest.mark.long),
    ],
)
def test_every_pass_keeps_its_bound_and_the_models_run_as_c(name, backends, file):
    description = described(name or file, Fraction(400) if name else None)
    rows = compare_system(description, backends, "numpy", inputs_of(description, 400))
    assert [row.backend for row in rows] == [b for b in backends for _ in description.system.outputs]
    for row in rows:
        if row.one_pass is None:
            continue
        assert row.bound is not None and row.share is not None and row.reason == ""
        assert 0 <= row.one_pass <= row.bound and row.share <= 1
        if "fixed" in row.backend:
            assert row.share > 0.02 and row.run >= row.one_pass * (1 - 1e-9)  # a bound that means something
        if row.backend == "c":
            assert row.run == 0


@pytest.mark.long
def test_a_pass_outside_its_bound_fails_the_command(file, capsys, monkeypatch):
    command = (
        f"compare {file} --backend c-fixed16 --motion constant --set z_deg_s=10 --duration 0.4 --format json"
    )
    status, out, err = says(command.split(), capsys)
    rows = json.loads(out)
    assert status == 0 and not err and rows[0]["output"] == "attitude_state" and rows[0]["share"] > 0
    real = system_comparison.agreement

    def broken(*arguments):
        passes = real(*arguments)
        return replace(passes, share={name: 1 + share for name, share in passes.share.items()})

    monkeypatch.setattr(system_comparison, "agreement", broken)
    status, _, err = says(command.split(), capsys)
    assert status == 1 and err == "strapgen: outside the certified bound: attitude_state on c-fixed16\n"


@pytest.mark.long
def test_files_of_a_system_hold_until_one_is_changed(file, capsys):
    folder = file.parent / "firmware"
    generate = f"system {file} --target c-fixed --word 16 --out {folder}".split()
    assert says(generate, capsys)[0] == 0

    def verified(place=folder):
        status, out, err = says(["verify", str(place), "--format", "json"], capsys)
        assert not err
        return status, json.loads(out)

    status, data = verified()
    assert status == 0 and data["holds"] and data["files"] == 6 and data["differences"] == []
    assert [stage["holds"] for stage in data["stages"]] == [True, True]
    unit, stage = folder / "counting_w16.c", folder / "counting_attitude_w16.c"
    for path, old, new, reason in [
        (unit, "memory->cycle", "memory->cycIe", "edited"),
        (stage, "INT32_C(1) <<", "INT32_C(2) <<", "edited"),
        (stage.with_suffix(".h"), "--word 16", "--word 32", "other options"),
        (unit.with_suffix(".h"), '_VERSION "', '_VERSION "0.0.', "strapgen 0.0."),
    ]:
        text = path.read_text()
        place = text.index(old)
        path.write_text(text[:place] + new + text[place + len(old) :])
        status, data = verified(unit.with_suffix(".h") if reason == "edited" else folder)
        number = text[:place].count("\n") + 1
        assert status == 1 and not data["holds"]
        assert [line for line in data["differences"] if line.startswith(f"{path}:{number}: {reason}")], path
        path.write_text(text)
    unit.unlink()
    status, data = verified()
    assert status == 1 and data["differences"] == [f"{unit}: is not there"]
    file.unlink()
    status, _, err = says(["verify", str(folder)], capsys)
    assert status == 2 and err.count("\n") == 1 and "counting.toml cannot be read" in err
