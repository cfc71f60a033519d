"""README, API page and examples: what they show is what happens."""

from __future__ import annotations

import doctest
import re
import runpy
import shlex
import subprocess
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

import pytest

from strapgen.cli import main

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text()


@pytest.mark.parametrize(
    "page", ["python-api", "canonical-form", "fixed-point", "series", "coning", "two-speed", "vibration"]
)
def test_page(page):
    result = doctest.testfile(str(ROOT / "docs" / f"{page}.md"), module_relative=False)
    assert result.attempted >= 10
    assert result.failed == 0


def test_readme_snippet():
    (code,) = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    exec(code, {})


def commands() -> list[str]:
    return re.findall(r"^    (strapgen .*)$", README, flags=re.MULTILINE)


def test_readme_shows_every_command():
    shown = {shlex.split(command)[1].replace("stress", "rate-table") for command in commands()}
    assert shown == {
        "list",
        "tableau",
        "derive",
        "generate",
        "simulate",
        "compare",
        "converge",
        "check",
        "coning",
        "two-speed",
        "strapdown",
        "vibration",
        "study",
        "series",
        "stability",
        "rate-table",
    }
    assert "`strapgen tables`" in README


def not_ignored(paths: Iterable[str]) -> list[str]:
    """Return which paths of a checkout would be new files that git does not ignore."""
    git = ["git", "-C", str(ROOT)]
    names = sorted(paths)
    try:
        known = subprocess.run([*git, "ls-files", *names], capture_output=True, text=True, check=True)
    except (FileNotFoundError, subprocess.CalledProcessError):
        pytest.skip("no git, or no checkout")
    asked = "\n".join(names)
    ignored = subprocess.run([*git, "check-ignore", "--stdin"], input=asked, capture_output=True, text=True)
    return sorted({*names} - {*known.stdout.splitlines(), *ignored.stdout.splitlines()})


def shown_commands() -> list[str]:
    """Return every command of README, docs, examples and help texts, each on one line."""
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md"), *(ROOT / "examples").glob("*.py")]
    pages += (ROOT / "codegen" / "strapgen" / "cli").rglob("*.py")
    texts = (re.sub(r"\\+\n\s*|\n +(?=--[a-z])", " ", page.read_text()) for page in pages)
    return [
        line
        for text in texts
        for line in re.findall(r"^ +(?:Example: )?(strapgen [a-z].*)$", text, re.MULTILINE)
    ]


def test_no_command_writes_into_the_checkout_what_git_does_not_ignore():
    written = {}
    for command in shown_commands():
        words = shlex.split(command)
        for option, value in pairwise(words):
            if option in ("--out", "--plot"):
                written[f"{value}/file.c" if words[1] in ("generate", "two-speed") else value] = command
        assert words[1] not in ("generate", "two-speed") or {"--out", "--all"} & {*words}, command
    assert len(written) >= 9
    assert [written[path] for path in not_ignored(written)] == []


#: Commands that take seconds: many kernels, or many terms.
LONG = (
    "strapgen stress ",
    "strapgen rate-table ",
    "strapgen series euler --method rk4 --motion coning",
    "strapgen series euler --all",
)


@pytest.mark.parametrize(
    "command",
    [
        pytest.param(command, marks=pytest.mark.long if command.startswith(LONG) else ())
        for command in commands()
    ],
)
def test_readme_command(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    with pytest.raises(SystemExit) as stop:
        main(shlex.split(command)[1:])
    assert stop.value.code == 0, capsys.readouterr().err
    (tmp_path / "examples").unlink()
    assert not_ignored(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file()) == []


def cells(line: str) -> list[str]:
    return re.sub(r"(?<=\d)([*r])", r" \1 ", line).split()


@pytest.mark.long
def test_readme_tables_are_the_command_s(capsys):
    with pytest.raises(SystemExit):
        main(["tables"])
    printed = capsys.readouterr().out.strip().splitlines()
    (block,) = re.findall(r"```\n(Table 1.*?)```", README, flags=re.DOTALL)
    shown = block.strip().splitlines()
    assert len(shown) == len(printed)
    for ours, theirs in zip(cells("\n".join(shown)), cells("\n".join(printed)), strict=True):
        try:
            value = float(theirs)
        except ValueError:
            assert ours == theirs
            continue
        # Round-off differs from one mathematical library to the next: it rules the figures of single precision
        # at fourth order, and touches double precision below 1e-10 degrees.
        assert float(ours) == pytest.approx(value, rel=1e-3 if value > 1e-3 else 0.5)


def test_the_commands_of_the_page_on_vibration(tmp_path, monkeypatch, capsys):
    page = (ROOT / "docs" / "vibration.md").read_text()
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    shown = re.findall(r"^    (strapgen .*)$", page, flags=re.MULTILINE)
    assert len(shown) == 4
    for command in shown:
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(command)[1:])
        assert stop.value.code == 0, capsys.readouterr().err


def test_the_page_on_own_algorithms(tmp_path, monkeypatch, capsys):
    """Its tableau and its algorithm are what it says, and its commands run."""
    page = (ROOT / "docs" / "own-algorithms.md").read_text()
    for kind, name in (("toml", "heun3.toml"), ("python", "two_sample.py")):
        (block,) = re.findall(rf"```{kind}\n(.*?)```", page, flags=re.DOTALL)
        (tmp_path / name).write_text(block)
    monkeypatch.chdir(tmp_path)
    shown = re.findall(r"^    (strapgen (?!: ).*)$", page, flags=re.MULTILINE)
    commands = [command for command in shown if not command.startswith("strapgen:")]
    assert {shlex.split(command)[1] for command in commands} == {
        "tableau",
        "generate",
        "converge",
        "check",
        "compare",
    }
    for command in commands:
        with pytest.raises(SystemExit) as stop:
            main(shlex.split(command)[1:])
        assert stop.value.code == 0, capsys.readouterr().err
    (failure,) = re.findall(r"^    strapgen: heun3.toml: (.*)$", page, flags=re.MULTILINE)
    broken = (tmp_path / "heun3.toml").read_text().replace('"1/4", "0", "3/4"', '"0", "0", "1"')
    (tmp_path / "heun3.toml").write_text(broken)
    capsys.readouterr()
    with pytest.raises(SystemExit) as stop:
        main(["tableau", "heun3.toml"])
    assert (stop.value.code, capsys.readouterr().err) == (2, f"strapgen: heun3.toml: {failure}\n")


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, marks=pytest.mark.long if path.stem == "word_length_study" else (), id=path.stem)
        for path in sorted((ROOT / "examples").glob("*.py"))
    ],
)
def test_example(path, capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", [str(path)])
    namespace = runpy.run_path(str(path))
    if "algorithm" in namespace:  # for strapgen to load, see `strapgen check`
        assert namespace["algorithm"]().companions is not None
        return
    if path.stem.startswith("make_"):
        assert namespace["text"]() == namespace["LOG"].read_text()
        return
    namespace["main"]()
    assert capsys.readouterr().out.count("\n") >= 3
