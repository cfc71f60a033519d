"""Evidence as a list and as a page."""

from __future__ import annotations

import json
import re
import shlex
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

from strapgen.cli import main
from strapgen.evidence import collection, gappa
from strapgen.evidence.collection import Verdict, failures
from strapgen.evidence.evidence_report import EvidenceResult, evidence_page, summary, without_versions

_ALARM = Verdict("dcm_w32", "no overflow: x86_64", "Frama-C Eva", "25.0", "fails", 1.25, "2 alarms")
_PROOF = Verdict("dcm_w32", "no overflow: x86_64", "bitwuzla", "0.9", "proved", 3.0)
_BITS = Verdict("dcm_w32", "same bits: avr", "simavr", "1.6", "agrees", 0.5)
_BEYOND = Verdict("euler_w32", "error bound: one step", "Gappa", "1.4", "not examined", 0.1, "a quotient")
_MISSING = Verdict("euler_w32", "same bits: avr", "simavr", "", "not installed", 0.0, "install simavr")


def test_a_proof_by_one_tool_makes_up_for_alarms_of_another():
    assert failures([_ALARM, _PROOF]) == []
    assert failures([_ALARM, _BITS]) == [_ALARM]


def test_json_has_the_keys_that_programs_read():
    rows = json.loads(EvidenceResult([_ALARM, _BEYOND, _MISSING]).written("json"))
    assert [{*row} for row in rows] == [
        {"schema", "kernel", "claim", "tool", "version", "result", "seconds", "detail"}
    ] * 2
    assert rows[0]["seconds"] == 1.25
    assert rows[1]["result"] == "not installed"


def test_the_text_says_claim_tool_result_time_and_why():
    text = EvidenceResult([_ALARM, _PROOF, _BEYOND]).written("text")
    assert "euler_w32, error bound: one step, Gappa 1.4: a quotient" in text
    assert re.search("no overflow: x86_64 +Frama-C Eva +fails", text)
    assert "2 alarms" in text


def test_the_page_has_a_table_for_each_promise_and_does_not_depend_on_times():
    page = evidence_page([_ALARM, _PROOF, _BITS, _MISSING], {"dcm_w32": "0123"})
    assert "| dcm_w32 | proved, bitwuzla |" in page
    assert "| euler_w32 | not installed, simavr |" in page
    assert "- x86_64, Frama-C Eva: 2 alarms (dcm_w32)" in page
    assert "- Frama-C Eva 25.0" in page
    assert "1.25" not in page
    newer = evidence_page([replace(_ALARM, version="26.0"), _PROOF, _BITS, _MISSING], {"dcm_w32": "0123"})
    assert newer != page
    assert without_versions(newer) == without_versions(page)


def test_the_summary_counts_results_by_claim_and_tool():
    rows = summary([_ALARM, _PROOF, _BITS, _MISSING]).rows
    assert ["same bits: avr", "simavr", 0, 1, 0, 0, 1] in rows


needs_gappa = pytest.mark.skipif(not gappa.GAPPA.installed(), reason=f"install {gappa.GAPPA.package}")


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
def test_invalid_options_are_refused_in_one_line(command, line, capsys):
    assert status(command) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n")) == ("", 1)
    assert line in said.err
