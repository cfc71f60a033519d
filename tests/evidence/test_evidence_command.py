"""The command that collects evidence: its list, its page, and its exit status."""

from __future__ import annotations

import json
import shlex
from concurrent.futures import ThreadPoolExecutor

import pytest

from strapgen.cli import main
from strapgen.evidence import collection, gappa

needs_gappa = pytest.mark.skipif(not gappa.TOOL.installed(), reason=f"install {gappa.TOOL.package}")


def status(command: str) -> int:
    with pytest.raises(SystemExit) as stop:
        main(["evidence", *shlex.split(command)])
    return stop.value.code


@pytest.mark.long
@needs_gappa
def test_the_list_and_the_page_of_a_kernel(capsys, tmp_path):
    page, folder = tmp_path / "page.md", tmp_path / "files"
    command = f"euler-product --tool gappa --page {page} --format json"
    assert status(f"{command} --out {folder}") == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["kernel"] for row in rows] == ["euler_product_w32"] * 3
    claims = {"one step", "one step in double", "one step in float"}
    assert {row["claim"] for row in rows} == {f"error bound: {claim}" for claim in claims}
    assert {(row["tool"], row["result"]) for row in rows} == {("Gappa", "proved")}
    assert all(row["seconds"] > 0 and row["version"] for row in rows)
    assert (folder / "euler_product_w32" / "one_step.g").is_file()

    assert status(f"{command} --check") == 0
    assert "in step" in capsys.readouterr().err
    text = page.read_text().replace("| proved, Gappa |", "| - |", 1)
    page.write_text(text)
    assert status(f"{command} --check") == 1
    assert "out of step" in capsys.readouterr().err
    assert page.read_text() == text


def test_a_tool_that_is_missing_is_named_and_fails_where_all_must_be_there(capsys, monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert status("euler-product --tool eva") == 0
    assert "install frama-c-base" in capsys.readouterr().out
    # Several examinations run side by side: here in threads, which begin more quickly than processes.
    monkeypatch.setattr(collection, "ProcessPoolExecutor", lambda *_: ThreadPoolExecutor(2))
    assert status("euler-product --tool eva,gappa --complete") == 1
    said = capsys.readouterr().out
    assert "install frama-c-base" in said and "install gappa" in said


@pytest.mark.parametrize(
    ("command", "line"),
    [
        ("", "a kernel is needed, or --all"),
        ("euler --all", "NAME... and --all are both given; one is needed"),
        ("euler --check", "--check needs --page"),
        ("euler --tool gapa", "did you mean gappa"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(command, line, capsys):
    assert status(command) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n")) == ("", 1)
    assert line in said.err
