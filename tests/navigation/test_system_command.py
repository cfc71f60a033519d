"""``strapgen system``: what it shows, what it writes, and that its files say how they are made."""

from __future__ import annotations

import json
import shlex
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from xml.etree import ElementTree

import pytest
from c_programs import needed
from cli.test_display import generated_by
from navigation.described_files import ATTITUDE, TWO_SPEEDS
from small_systems import COUNTING

from strapgen import pipeline
from strapgen.catalogue import choose
from strapgen.cli import main
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import Format
from strapgen.lab.motions.motions import motion
from strapgen.lab.motions.specific_forces import velocity_increments
from strapgen.navigation.systems import system_comparison
from strapgen.navigation.systems.system_comparison import compare_system
from strapgen.navigation.systems.system_generation import _moved
from strapgen.navigation.systems.system_runs import samples
from strapgen.navigation.systems.wiring import described


def run(command: str, capsys: pytest.CaptureFixture[str], status: int = 0) -> str:
    """Run the command and return what it prints."""
    with pytest.raises(SystemExit) as stop:
        main(["system", *shlex.split(command)])
    assert stop.value.code == status
    return capsys.readouterr().out


@pytest.fixture
def two(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("two.toml").write_text(TWO_SPEEDS)
    Path("att.toml").write_text(ATTITUDE)
    return tmp_path


def test_the_summary_shows_stages_values_and_the_budget(two, capsys):
    said = run("two.toml --target c-fixed --word 16", capsys)
    assert said.startswith("Two speeds (two, c-fixed, 3200 Hz)\n")
    rows = {line.split()[0]: line.split() for line in said.splitlines() if line}
    assert rows["slow"][:5] == ["slow", "8", "400", "euler-two-speed-slow-2", "16"]
    assert rows["gyro"][1:5] == ["1", "rad", "b", "3"]
    assert rows["slow_state"][2:8] == ["1", "b", "to", "n", "4", "Q1.14"]
    assert float(rows["slow_state"][-1]) > 0  # the error of a pass
    assert "outputs: slow_state, navigation_velocity_change" in said
    assert [path.name for path in sorted(two.iterdir())] == ["att.toml", "two.toml"]  # nothing is written


def test_json_has_the_keys_that_the_page_promises(two, capsys):
    data = json.loads(run("two.toml --target c-fixed --word 16 --format json", capsys))
    assert list(data) == [
        *("schema", "name", "title", "target", "sample_hz"),
        *("stages", "inputs", "values", "outputs", "budget", "files"),
    ]
    budget = data["budget"]
    assert budget["operations_per_second"] == sum(
        stage["hz"] * sum(stage["operations"].values()) for stage in data["stages"]
    )
    assert budget["memory_bytes"] == sum(
        budget[f"{part}_bytes"] for part in ("cell", "feedback", "counter", "padding")
    )
    assert budget["cpu"] is None
    assert {value["name"] for value in data["values"]} >= set(data["outputs"])
    page = (Path(__file__).parents[2] / "docs" / "systems.md").read_text()
    nested = [*data, *data["stages"][0], *data["values"][0], *budget, *budget["rates"][0]]
    assert [key for key in nested if f"`{key}`" not in page] == []


@pytest.mark.long
@pytest.mark.parametrize("target", ["c", "c-fixed", "numpy", "fixed-model"])
def test_every_file_says_which_command_makes_it(target, two, capsys):
    word = " --word 16 --carry state --drift-allowance 0.05" if "fixed" in target else ""
    folder = Path("first") / target
    said = run(f"two.toml --target {target} --sample-hz 1600{word} --out {folder}", capsys)
    files = sorted(folder.iterdir())
    listed, _, summary = said.partition("\n\n")  # rates, bounds and budget are said too
    assert "All rates:" in summary
    assert [line.strip() for line in listed.splitlines()[1:]] == [
        str(folder / path.name) for path in sorted(files, key=lambda path: said.index(path.name))
    ]
    for number, path in enumerate(files):
        command = generated_by(path).removeprefix("strapgen ")
        again = Path("again") / target / str(number)
        with pytest.raises(SystemExit) as stop:
            main([*shlex.split(command), "--out", str(again)])
        assert stop.value.code == 0
        names = [entry.name for entry in again.iterdir()]
        same = again / (
            path.name if path.name in names else names[0]
        )  # a stage in Python has a name of its own
        assert same.read_bytes() == path.read_bytes()
    capsys.readouterr()


def test_files_are_compared_and_not_written_over(two, capsys):
    run("two.toml --out o --with-runs", capsys)
    assert {path.name for path in Path("o").iterdir()} >= {"two.h", "two.c", "two_runs.h", "two_fast.c"}
    assert "in step" in run("two.toml --out o --with-runs --check", capsys)
    header = Path("o/two.h")
    header.write_text(header.read_text().replace("Two speeds", "Three speeds"))
    assert "Three speeds" in run("two.toml --out o --with-runs --check", capsys, status=1)
    data = json.loads(run("two.toml --out o --check --format json", capsys, status=1))
    assert set(data) == {"schema", "in_step", "difference"}
    run("two.toml --out o --sample-hz 1600", capsys, status=2)  # another command made the files
    assert "Three speeds" in header.read_text()
    run("two.toml --out o --sample-hz 1600 --force", capsys)
    assert "1600" in header.read_text()


@pytest.mark.long
def test_instructions_are_counted_on_a_processor_and_stand_in_the_header(two, capsys):
    needed("arm-none-eabi-gcc", "qemu-system-arm")
    data = json.loads(run("att.toml --target c-fixed --cpu cortex-m3 --format json", capsys))
    counts = {stage["name"]: stage["executed"] for stage in data["stages"]}
    assert all(count > 20 for count in counts.values())
    assert data["budget"]["instructions_per_second"] == sum(
        stage["hz"] * stage["executed"] for stage in data["stages"]
    )
    run("att.toml --target c-fixed --cpu cortex-m3 --out o", capsys)
    header = " ".join(Path("o/att_w32.h").read_text().replace("\n *", " ").split())
    assert "--cpu cortex-m3" in header
    assert "On cortex-m3: " in header


@pytest.mark.parametrize("example, picture", [("attitude", "system"), ("strapdown", "strapdown")])
def test_a_picture_of_the_page_is_that_of_its_example(example, picture, tmp_path, capsys):
    root = Path(__file__).parents[2]
    run(f"{root}/examples/{example}.toml --target numpy --draw {tmp_path}/{picture}.svg", capsys)
    assert (tmp_path / f"{picture}.svg").read_text() == (root / "docs" / f"{picture}.svg").read_text()


@pytest.mark.long
@pytest.mark.parametrize("name", ["two", "att"])
def test_a_drawing_shows_every_stage_input_and_wire(name, two, capsys):
    run(f"{name}.toml --draw {name}.svg", capsys)
    tree = ElementTree.parse(f"{name}.svg").getroot()
    space = "{http://www.w3.org/2000/svg}"
    texts = [element.text or "" for element in tree.iter(f"{space}text")]
    wires = {
        element.find(f"{space}title").text: element for element in tree.iter(f"{space}path") if len(element)
    }
    kinds = {title: element.get("class").split()[1] for title, element in wires.items()}
    assert "prefers-color-scheme: dark" in next(tree.iter(f"{space}style")).text
    if name == "two":
        assert {"fast", "slow", "navigation", "3200 Hz", "400 Hz", "200 Hz"} <= set(texts)
        assert kinds["fast.coning → slow.coning"] == "forward"
        assert kinds["earth → slow.turn"] == "forward"
        assert kinds["slow.state → navigation.state, the same memory"] == "shared"
        assert len(kinds) == 10
    else:
        assert kinds["matrix.attitude → turned.state, one cycle late"] == "delayed"
        assert kinds["gyro → step.increments"] == "forward"
    width, height = (float(tree.get(name)) for name in ("width", "height"))
    for element in tree.iter(f"{space}rect"):
        x, y, w, h = (element.get(name, "0") for name in ("x", "y", "width", "height"))
        if "%" not in w:
            assert float(x) >= 0
            assert float(y) >= 0
            assert float(x) + float(w) <= width
            assert float(y) + float(h) <= height


def test_a_value_is_moved_by_the_places_between_two_formats_and_held_in_the_word_of_its_destination():
    interface = pipeline.compile(choose("euler-product"), "c-fixed", Settings(word=16)).fixed
    there = replace(interface.inputs[0], format=Format(16, 12))
    finer, coarser = replace(there, format=Format(32, 20)), replace(there, format=Format(16, 9))
    assert _moved("a.b", there, finer) == f"_moved(a.b, 8, {2**31 - 1})"
    assert _moved("a.b", there, coarser) == f"_moved(a.b, -3, {2**15 - 1})"
    assert _moved("a.b", there, there) == "a.b"
    assert _moved("a.b", None, finer) == _moved("a.b", finer, None) == "a.b"


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
