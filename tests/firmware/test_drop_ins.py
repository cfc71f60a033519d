"""Generated code in place of common integrators: short, with the drift before and after that the page shows."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from commands import run, says

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "examples/drop_ins"
PAGE = (FOLDER / "README.md").read_text()
#: A command of the page, and the lines below it.
SHOWN = [
    (" ".join(command.replace("\\\n", " ").split()), lines.splitlines())
    for command, lines in re.findall(
        r"^    (strapgen check (?:.*\\\n)*.*)\n\n```text\n((?:(?!```).*\n)*)", PAGE, re.MULTILINE
    )
]
GENERATED = re.findall(r"^    (strapgen generate .*)$", PAGE, re.MULTILINE)


@pytest.fixture
def workplace(tmp_path, monkeypatch, capsys) -> Path:
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    for command in GENERATED:
        run(shlex.split(command)[1:])
    capsys.readouterr()
    return tmp_path


def number(line: str) -> float:
    return float(re.search(r" (\S+) deg/h", line)[1])


@pytest.mark.parametrize("after", [*FOLDER.glob("*_after.*")], ids=lambda path: path.stem)
def test_a_drop_in_is_short_and_has_the_interface_of_the_other(after):
    before = after.with_name(after.name.replace("_after", "_before"))
    texts = [path.read_text() for path in (before, after)]
    assert all(len(text.splitlines()) < 40 for text in texts)
    declared = [
        re.findall(r"^ *(?:void|bool|float) (?:delta_|\w+\().*", text, re.MULTILINE) for text in texts
    ]
    assert declared[0] and declared[0] == declared[1]


def test_the_page_measures_every_file():
    assert len(GENERATED) == 2
    assert {shlex.split(command)[2] for command, _ in SHOWN} == {
        f"examples/drop_ins/{path.name}" for path in FOLDER.iterdir() if path.suffix in (".c", ".hpp")
    }


@pytest.mark.long
@pytest.mark.needs("gcc", "g++")
@pytest.mark.parametrize(
    ("command", "lines"), SHOWN, ids=[shlex.split(c)[2].rpartition("/")[2] for c, _ in SHOWN]
)
def test_the_drift_is_that_of_the_page(command, lines, workplace, capsys):
    pytest.importorskip("clang")
    status, printed, error = says(shlex.split(command)[1:], capsys)
    assert status == int("_before" in command), error
    for line in lines:
        (found,) = [one for one in printed.splitlines() if one.split()[:2] == line.split()[:2]]
        if "deg/h" in line:
            # The rounding of another compiler's libraries may differ.
            assert found.split()[:2] == line.split()[:2] and number(found) == pytest.approx(
                number(line), rel=0.05
            )
            assert found.partition("; ")[2].startswith(line.partition("; ")[2])
        else:
            assert found.partition(" (confidence")[0] == line


def test_the_drift_falls_by_what_the_correction_is_worth():
    drift = {command.partition(".")[0].rpartition("/")[2]: number(lines[0]) for command, lines in SHOWN}
    assert drift["integrator_after"] < drift["integrator_before"] / 10_000
    assert drift["attitude_after"] < drift["attitude_before"] / 40
