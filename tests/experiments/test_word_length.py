"""The word-length study: parts of the drift, told apart; cases that were run are not run again."""

from __future__ import annotations

import csv
import io

import pytest

from strapgen.experiments import word_length
from strapgen.experiments.word_length import cases, run, run_case
from strapgen.reports import plots
from strapgen.reports.word_length import word_length_report, word_length_text
from strapgen.support.exceptions import InputError

SMALL = {"duration": "5", "words": (12, 16, 24), "carries": ("none", "full")}


@pytest.fixture(scope="module")
def outcomes():
    planned = cases(**SMALL, pulses_arcsec=("0", "30"))
    found = {outcome.case: outcome for outcome in run(planned)}
    return [found[case] for case in planned]


def test_every_combination_is_run(outcomes):
    cases = [outcome.case for outcome in outcomes]
    assert len(set(cases)) == 2 * 3 * 2
    assert {(case.word, case.carry, case.pulse_arcsec) for case in cases} == {
        (word, carry, pulse) for word in (12, 16, 24) for carry in ("none", "full") for pulse in ("0", "30")
    }


def test_parts_of_the_drift(outcomes):
    for outcome in outcomes:
        assert outcome.rounding_deg <= outcome.bound_deg
        parts = outcome.rounding_deg + outcome.quantization_deg + outcome.truncation_deg
        assert outcome.drift_deg <= parts * 1.01
        assert outcome.dominates in ("rounding", "quantization", "truncation")
    by_word = {(o.case.word, o.case.carry, o.case.pulse_arcsec): o for o in outcomes}
    for carry in ("none", "full"):
        roundings = [by_word[word, carry, "0"].rounding_deg for word in (12, 16, 24)]
        assert roundings == sorted(roundings, reverse=True)
    assert by_word[24, "full", "30"].dominates == "quantization", "pulses of 30 arcsec"
    assert by_word[12, "none", "0"].dominates == "rounding", "12 bits, nothing kept"


def test_a_finished_case_is_not_run_again(outcomes, monkeypatch):
    monkeypatch.setattr(word_length, "_run", lambda case: pytest.fail("it was run before"))
    for outcome in outcomes:
        assert run_case(outcome.case) == outcome


def test_one_process_finds_the_same(outcomes):
    assert {o.case: o for o in run([o.case for o in outcomes], jobs=1)} == {o.case: o for o in outcomes}


def test_a_run_that_leaves_its_range_is_told():
    (outcome,) = run(cases(methods=("rk1",), words=(16,), carries=("none",), steps=("0.5",), duration="180"))
    assert outcome.drift_deg is None and outcome.rounding_deg is None
    assert outcome.dominates == "range"
    assert " - " in word_length_text([outcome])


def test_forms(outcomes):
    rows = list(csv.DictReader(io.StringIO(word_length_report(outcomes).written("csv"))))
    assert len(rows) == len(outcomes)
    assert float(rows[0]["rounding_deg"]) == outcomes[0].rounding_deg
    assert rows[0]["settings"] == "a_deg_s=10 b_deg_s=10 g_deg_s=10"
    text = word_length_text(outcomes)
    assert text.count("the method itself drifts by") == 2
    assert "pulses of 30 arcsec" in text


def test_image(outcomes):
    pytest.importorskip("matplotlib")
    assert plots.word_length_image(outcomes, "study.png").startswith(b"\x89PNG")
    with pytest.raises(InputError, match="file type 'xyz'"):
        plots.word_length_image(outcomes, "study.xyz")


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"words": ()}, "the study has 0 cases"),
        (
            {"words": tuple(range(8, 65)), "steps": tuple(f"{1 + k}" for k in range(100))},
            "1 to 5000 are allowed",
        ),
        ({"words": (7,)}, "word is 7"),
        ({"carries": ("p",)}, "carry 'p'"),
        ({"steps": ("0.7",)}, "not a whole multiple"),
        ({"pulses_arcsec": ("-1",)}, "pulse_arcsec is -1"),
    ],
)
def test_studies_that_cannot_be_run(values, said):
    with pytest.raises(InputError, match=said):
        cases(**values)
