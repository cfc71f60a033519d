"""The help of every command, spellings that stay, progress on stderr."""

from __future__ import annotations

import io
import json
import re
import shlex
import sys
import time
from collections import defaultdict
from pathlib import Path

import pytest
from commands import run
from typer.main import get_command

from strapgen import registration
from strapgen.cli import app, help_layout, main, progress
from strapgen.cli.help_layout import summary
from strapgen.cli.options import MethodOptions
from strapgen.cli.program import PlainCommand, _label
from strapgen.ir.checks import SYNONYMS
from strapgen.run.backends import BACKENDS


def commands(group, path=()):
    """Yield every command and every group of commands of the program with its name."""
    yield " ".join(path), group
    for name, command in getattr(group, "commands", {}).items():
        yield from commands(command, (*path, name))


EVERY = dict(commands(get_command(app)))


def help_of(name: str) -> list[str]:
    command = EVERY[name]
    with command.make_context(f"strapgen {name}".strip(), [], resilient_parsing=True) as context:
        return command.get_help(context).splitlines()


@pytest.mark.long
@pytest.mark.parametrize("width", [60, 80, 100])
def test_no_line_is_wider_than_the_terminal(width, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(width))
    long = [f"{name}: {line}" for name in EVERY for line in help_of(name) if len(line) > width]

    assert not long


def test_commands_stand_in_groups_with_a_whole_sentence_each(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    lines = help_of("")
    headings = [line[:-1] for line in lines if re.fullmatch(r"[A-Z]\w+:", line)]
    assert headings[-5:] == ["Derive", "Generate", "Run", "Analyse", "Reproduce"]
    shown = {
        heading: [
            line.split()[0]
            for line in "\n".join(lines).split(f"\n{heading}:\n")[1].split("\n\n")[0].split("\n")
        ]
        for heading in headings[-5:]
    }
    assert shown == {heading: [*names] for heading, names in help_layout.commands().items()}
    assert not [line for line in lines[1:] if line.endswith("...")]
    assert "stress" not in " ".join(lines)


def test_help_of_the_program_has_its_options(capsys):
    """It is printed without the library that reads them."""
    labels = [label for label, _ in help_layout.PROGRAM.panels["Options"]]
    with EVERY[""].make_context("strapgen", [], resilient_parsing=True) as context:
        options = EVERY[""].get_params(context)
    assert labels == [_label(option) for option in options]
    known = {label: text for label, text in help_layout.PROGRAM.panels["Options"]}
    assert all(known[_label(option)] == option.help for option in options if option.help)
    for words in (["-h"], ["--help"], ["help"], ["--verbose", "--help"]):
        with pytest.raises(SystemExit) as stop:
            main(words)
        assert (stop.value.code, capsys.readouterr().out) == (0, f"{help_layout.program_help()}\n")


def test_summaries_of_the_list_are_first_sentences_of_the_commands():
    listed = {
        name: command.summary
        for one in registration.built_in().values()
        for name, command in one.commands.items()
        if command.heading
    }
    assert listed == {name: summary(EVERY[name].help) for name in listed}


def test_an_option_and_its_value_stay_on_one_line_of_an_example(monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    text = "\n".join(help_of("simulate"))
    assert "    --set a_deg_s=10 b_deg_s=10 g_deg_s=10" in text
    first = text.split("Examples:\n\n")[1].split("\n\n")[0].splitlines()
    assert first[0].startswith("  strapgen simulate euler --method rk4")
    assert all(line.endswith(" \\") for line in first[:-1]) and not first[-1].endswith("\\")


def test_every_value_has_a_name_in_capitals():
    for name, command in EVERY.items():
        for parameter in command.params:
            if not getattr(parameter, "is_flag", False) and parameter.name != "show_completion":
                assert re.fullmatch(r"[A-Z][][A-Z_0-9=,.:|mnQ]*", parameter.metavar or ""), (
                    name,
                    parameter.name,
                )


def test_one_option_has_one_metavar_and_one_beginning_of_its_sentence():
    """A list of values has an ellipsis; files and folders differ, and the order of a method and of a run's steps."""
    metavars = defaultdict(set)
    for command in EVERY.values():
        for parameter in command.params:
            if parameter.opts[0].startswith("--") and not parameter.is_flag:
                metavars[parameter.opts[0]].add(parameter.metavar.removesuffix(",..."))
    several = {option: names for option, names in metavars.items() if len(names) > 1}
    assert several == {"--out": {"FILE", "FOLDER"}, "--order": {"N", "ORDER"}}


def test_no_option_is_declared_in_the_plural():
    singular = {option.opts[0] for command in EVERY.values() for option in command.params}
    assert not {option for option in singular if f"{option[:-1]}" in singular} - {"--samples", "--states"}
    assert all(isinstance(command, PlainCommand) or hasattr(command, "listed") for command in EVERY.values())


def test_every_synonym_leads_to_a_name_that_exists():
    from strapgen import catalogue
    from strapgen.run.backends import BACKENDS
    from strapgen.targets import TARGETS

    names = {
        "algorithm": catalogue.reserved(),
        "kernel": catalogue.reserved(),
        "method": catalogue.METHODS,
        "motion": catalogue.MOTIONS,
        "target": TARGETS,
        "backend": BACKENDS,
        "reference": BACKENDS,
    }
    for kind, synonyms in SYNONYMS.items():
        for synonym, meant in synonyms.items():
            assert {*meant} <= {*names[kind]}, (kind, synonym)
            assert kind in ("algorithm", "kernel") or synonym not in names[kind], (kind, synonym)


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


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a moment short."""
    monkeypatch.setattr(progress, "_PATIENCE", 0.02)
    monkeypatch.setattr(progress, "_INTERVAL", 0.02)


def wait_for(stream: io.StringIO, text: str) -> None:
    """Wait until a text has been written; the test's own time limit ends it otherwise."""
    for _ in range(3000):
        if text in stream.getvalue():
            return
        time.sleep(0.01)
    raise AssertionError(f"{text!r} was never written")


def test_progress_is_shown_and_erased(impatient, monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream := Terminal())
    with progress.waiting("deriving own.py"):
        wait_for(stream, "deriving own.py 0 s")
    assert stream.getvalue().endswith("\r\x1b[2K")


@pytest.mark.parametrize("stream", [Terminal(), io.StringIO()])
def test_progress_is_silent_when_fast_or_without_terminal(stream, monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream)
    # However busy the machine is, an hour is not over.
    monkeypatch.setattr(progress, "_PATIENCE", 3600.0 if stream.isatty() else 0.0)
    with progress.waiting("deriving own.py"):
        pass
    assert stream.getvalue() == ""


def test_an_error_ends_it(impatient, monkeypatch):
    monkeypatch.setattr(sys, "stderr", stream := Terminal())
    with pytest.raises(ZeroDivisionError), progress.waiting("deriving own.py"):
        wait_for(stream, "deriving")
        raise ZeroDivisionError
    assert stream.getvalue().endswith("\r\x1b[2K")


def test_a_file_that_takes_its_time_shows_that_it_is_derived(tmp_path, impatient, monkeypatch):
    path = tmp_path / "slow.py"
    path.write_text("def algorithm():\n    import time; time.sleep(0.5)\n    return 3\n")
    monkeypatch.setattr(sys, "stderr", stream := Terminal())
    with pytest.raises(ValueError, match=r"returned int; a Kernel is needed"):
        MethodOptions().choose(str(path))
    assert re.search(r"deriving \S*slow\.py \d s", stream.getvalue())


def test_reading_and_running_a_recording_are_shown(impatient, monkeypatch, tmp_path, capsys):
    from strapgen.lab.recordings import recording

    (tmp_path / "log.csv").write_text("".join(f"{k / 10},0,0,0\n" for k in range(4)))
    stream = Terminal()

    def slowly(function, text):
        def wait(*arguments):
            wait_for(stream, text)
            return function(*arguments)

        return wait

    monkeypatch.setattr(sys, "stderr", stream)
    for name, text in (("recorded", "reading log.csv"), ("propagate", "running euler-rk4-2")):
        monkeypatch.setattr(recording, name, slowly(getattr(recording, name), text))
    run(["simulate", "euler", "--input", "increments", "--recording", str(tmp_path / "log.csv")])
    assert stream.getvalue().endswith("\r\x1b[2K")
