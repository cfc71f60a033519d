"""Variants of strapgen.toml: what they may state, the commands that take them, and the gate of `build --check`."""

from __future__ import annotations

import json
import re
from pathlib import Path

import jsonschema
import pytest
from commands import run

from strapgen.catalogue.toml_models import schemas
from strapgen.ir.exceptions import InputError
from strapgen.storage.resources import PACKAGE
from strapgen.variants import build
from strapgen.variants.variant_file import read, words_of

TEXT = """\
[variant.attitude]
algorithm = "euler"
method = "rk4"
increments = 2
sample_hz = 200
max_rate_deg_s = 400
target = ["c-fixed", "numpy"]
word = [16, 32]
out = "firmware"

[variant.attitude.checks]
vectors = 20

[variant.attitude.simulate]
motion = "coning"
set = { a_deg_s = 10, b_deg_s = 10, g_deg_s = 10 }
duration = 1
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "strapgen.toml").write_text(TEXT)
    return tmp_path


def test_init_build_and_check_in_an_empty_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    run(["init"])
    assert "Samples of the gyro in a second: 200" in capsys.readouterr().err
    run(["build"])
    run(["build", "--check", "--format", "json"])
    answer = json.loads(capsys.readouterr().out.partition("{\n")[2].join(["{", ""]))
    assert answer["holds"]
    assert [step["command"].split()[1] for step in answer["steps"]] == ["generate", "verify", "of"]
    assert "strapgen build --check" in (tmp_path / ".github/workflows/strapgen.yml").read_text()
    run(["init"], 2)
    assert "strapgen.toml is there already" in capsys.readouterr().err


def test_build_writes_each_target_and_word_with_vectors_and_names_the_variant(folder, capsys):
    run(["build"])
    names = {path.name for path in (folder / "firmware").iterdir()}
    for word in (16, 32):
        assert {f"euler_rk4_2_w{word}.c", f"test_euler_rk4_2_w{word}.c"} <= names
    assert "euler_rk4_2.py" in names
    head = " ".join(
        (folder / "firmware/euler_rk4_2_w16.h").read_text().split("*/")[0].replace("*", " ").split()
    )
    assert "--variant attitude --target c-fixed --word 16 --max-rate-deg-s 400 --sample-hz 200" in head
    capsys.readouterr()
    run(["build", "--check"])
    assert "all hold" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "old", "new", "said"),
    [
        ("euler_rk4_2_w32.c", "48", "49", "generate"),
        ("euler_rk4_2_w16_vectors.h", "{0, 0, 0, 16384", "{0, 0, 0, 16383", "vectors"),
        ("euler_rk4_2.py", "0.5", "0.25", "generate"),
    ],
)
def test_check_fails_on_a_changed_file(folder, capsys, name, old, new, said):
    run(["build"])
    path = folder / "firmware" / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    capsys.readouterr()
    run(["build", "--check"], 1)
    out = capsys.readouterr().out
    assert re.search(rf"^FAILS attitude: .*{said}", out, re.MULTILINE), out


def test_vectors_that_the_code_does_not_meet_fail_the_check(folder, capsys):
    run(["build"])
    source = folder / "firmware" / "euler_rk4_2_w32.c"
    text = source.read_text()
    source.write_text(re.sub(r"return 0;", "next[3] ^= 1; return 0;", text))
    assert source.read_text() != text
    capsys.readouterr()
    run(["build", "--check"], 1)
    assert "FAILS attitude: test of euler_rk4_2_w32 on its vectors" in capsys.readouterr().out


@pytest.mark.needs("arm-none-eabi-gcc")
@pytest.mark.parametrize(("most", "status"), [(100_000, 0), (10, 1)])
def test_cost_is_held_to_its_limit(folder, capsys, most, status):
    text = TEXT.replace("vectors = 20", f'cost = [{{ cpu = "cortex-m3", code_bytes = {most} }}]')
    (folder / "strapgen.toml").write_text(
        text.replace("[16, 32]", "32").replace('"c-fixed", "numpy"', '"c-fixed"')
    )
    run(["build"])
    run(["build", "--check"], status)
    assert ("code_bytes is" in capsys.readouterr().out) == bool(status)


def test_options_of_the_command_line_win(folder, capsys):
    run(["derive", "dcm", "--method", "rk1", "--variant", "attitude", "--format", "json"])
    assert json.loads(capsys.readouterr().out)["kernel"] == "dcm-rk1-2"


def test_simulation_takes_algorithm_step_and_back_end_of_a_variant(folder, capsys):
    run(["simulate", "--variant", "attitude", "--format", "json"])
    answer = json.loads(capsys.readouterr().out)
    assert (answer["backend"], answer["step_s"], answer["motion"]) == ("c-fixed16", 0.01, "coning")


def test_options_of_fixed_point_do_not_reach_a_target_in_floating_point(folder):
    assert "max_rate_deg_s" in words_of("attitude", "generate", ["--target", "c-fixed"])
    assert "max_rate_deg_s" not in words_of("attitude", "generate", ["--target", "numpy"])


def test_step_follows_from_sampling_rate_and_increments(folder):
    assert read(folder / "strapgen.toml")["attitude"].step == "1/100"


def test_a_project_of_another_kind_is_held_in_step(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = TEXT.replace('"c-fixed", "numpy"', '"c-fixed"').replace("[16, 32]", "32")
    (tmp_path / "strapgen.toml").write_text(
        text.replace("increments = 2", 'increments = 2\nproject = "fmu3"')
    )
    run(["build"])
    assert [path.name for path in (tmp_path / "firmware").iterdir()] == ["euler_rk4_2_w32.fmu3.fmu"]
    run(["build", "--check"])
    assert "1 step" in capsys.readouterr().out.splitlines()[-1]
    (tmp_path / "firmware" / "euler_rk4_2_w32.fmu3.fmu").write_bytes(b"")
    run(["build", "--check"], status=1)


def test_pyproject_has_variants_below_tool_strapgen(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = TEXT.replace("[variant", "[tool.strapgen.variant")
    (tmp_path / "pyproject.toml").write_text(f'[project]\nname = "a"\n{text}')
    below = tmp_path / "below"
    below.mkdir()
    monkeypatch.chdir(below)
    run(["derive", "--variant", "attitude", "--show", "program"])
    assert "p_x" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('algorithm = "euler"\n', "", "variant.attitude.algorithm is missing"),
        ("sample_hz = 200", "sample_hz = -1", "--sample-hz is -1; a number above 0 is needed"),
        ("increments = 2", "incremnts = 2", "key 'incremnts' is not known (did you mean increments?)"),
        ("increments = 2", "increments = true", "variant.attitude.increments is true"),
        ('"c-fixed", ', '"c-fixd", ', "target 'c-fixd' is not known (did you mean c-fixed or"),
        ("vectors = 20", "vectors = -2", "variant.attitude.checks.vectors is -2"),
        ("vectors = 20", "verify = 1", "variant.attitude.checks.verify is 1; true or false is needed"),
        (
            'motion = "coning"',
            'moton = "coning"',
            "variant.attitude.simulate.moton: key 'moton' is not known",
        ),
        ("[variant.attitude]", "[variants.attitude]", "key 'variants' is not known (did you mean variant?)"),
    ],
)
def test_wrong_file_is_refused_with_its_key(folder, capsys, old, new, said):
    assert TEXT.count(old) == 1
    (folder / "strapgen.toml").write_text(TEXT.replace(old, new))
    run(["build"], 2)
    line = capsys.readouterr().err
    assert line.startswith("strapgen: strapgen.toml: ")
    assert said in line
    assert line.count("\n") == 1
    assert not (folder / "firmware").exists()


@pytest.mark.parametrize(
    ("command", "said"),
    [
        (["build", "attitud"], "variant 'attitud' is not known (did you mean attitude?)"),
        (["derive", "--variant", "x"], "--variant 'x' is not known; allowed: attitude"),
        (["list", "--variant", "attitude"], "strapgen list takes no option from a variant"),
    ],
)
def test_unknown_variant_or_command_without_options_is_refused(folder, capsys, command, said):
    run(command, 2)
    assert said in capsys.readouterr().err


def test_the_order_of_sums_goes_to_targets_in_floating_point(folder, capsys):
    text = TEXT.replace("word = [16, 32]", 'sums = "tree"').replace(
        '["c-fixed", "numpy"]', '["c-fixed", "c"]'
    )
    (folder / "strapgen.toml").write_text(text)
    assert words_of("attitude", "generate", ["--target", "c"])["sums"] == "tree"
    assert "sums" not in words_of("attitude", "generate", ["--target", "c-fixed"])
    assert "sums" not in words_of("attitude", "evidence", [])
    run(["build"])
    assert "--sums tree" in (folder / "firmware/euler_rk4_2.c").read_text()
    assert "--sums" not in (folder / "firmware/euler_rk4_2_w32.c").read_text()
    run(["build", "--check"])


def test_no_file_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match="strapgen init writes one"):
        words_of("attitude", "derive", [])


def test_schema_takes_the_file_and_refuses_a_wrong_key(folder):
    import tomllib

    schema = schemas()["variants"]()
    assert json.loads((PACKAGE / "schemas/variants.json").read_text()) == schema
    jsonschema.validate(tomllib.loads(TEXT), schema)
    for old, new in [("increments = 2", "incremnts = 2"), ('algorithm = "euler"', "")]:
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(tomllib.loads(TEXT.replace(old, new)), schema)


@pytest.mark.long
def test_init_takes_the_algorithm_that_meets_a_brief(tmp_path, monkeypatch, capsys):
    brief = Path(__file__).parents[2] / "examples/briefs/ahrs.toml"
    monkeypatch.chdir(tmp_path)
    run(["init", "ahrs", "--brief", str(brief), "--out", "fw"])
    assert read(tmp_path / "strapgen.toml")["ahrs"].options["method"] == "coning-compressed"
    run(["build"])
    run(["build", "--check"])


def test_a_failed_step_says_why():
    step = build.Step("a", "strapgen verify x.c", False, "x.c differs\nin line 3")
    assert step.line == "FAILS a: strapgen verify x.c\n  x.c differs\n  in line 3"
