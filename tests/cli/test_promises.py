"""Spellings and JSON keys that earlier releases had: they go on working, whatever else the commands learn."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

import pytest
from commands import run
from typer.main import get_command

from strapgen.cli import app
from strapgen.run.backends import BACKENDS

DATA = Path(__file__).resolve().parents[1] / "data"
PROMISED = json.loads((DATA / "promised_command_line.json").read_text())


def command(name: str):
    found = get_command(app)
    for word in name.split():
        found = found.commands[word]
    return found


@pytest.mark.parametrize("name", PROMISED["options"])
def test_every_option_is_still_taken(name):
    taken = {spelling for option in command(name).params for spelling in option.opts}
    assert {*PROMISED["options"][name].split()} <= taken


def test_back_ends_keep_their_names():
    assert {"numpy", "c", "c-float", "c-q31", "c-q15", "fixed-model", "exact"} <= BACKENDS.keys()


@pytest.mark.long
@pytest.mark.parametrize("promise", PROMISED["json"])
def test_every_line_answers_with_the_keys_that_it_had(tmp_path, monkeypatch, capsys, promise):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "data").symlink_to(DATA)
    (tmp_path / "examples").symlink_to(DATA.parents[1] / "examples")
    if "--plot" in promise["line"]:
        pytest.importorskip("matplotlib")
    run(shlex.split(promise["line"]))
    said = capsys.readouterr()
    answer = json.loads(said.out)
    assert isinstance(answer, list) == promise["list"]
    assert {*promise["keys"].split()} <= (answer[0] if promise["list"] else answer).keys()
