"""Evidence as a list and as a page."""

from __future__ import annotations

import json
import re
from dataclasses import replace

from strapgen.evidence.evidence_report import EvidenceResult, evidence_page, summary, without_versions
from strapgen.evidence.verdicts import Verdict, failures

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
