"""The word-length study: parts of the drift, told apart; cases that were run are not run again."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import pytest

from strapgen.ir.exceptions import InputError
from strapgen.lab import word_length
from strapgen.lab.certificate import largest_rounding
from strapgen.lab.motions import users_motions
from strapgen.lab.word_length import cases, run, run_case
from strapgen.lab.word_length_report import WordLengthResult, word_length_image

SMALL = {"duration": "5", "words": (12, 16, 24), "carries": ("none", "full")}


@pytest.fixture(scope="module")
def outcomes():
    planned = cases(**SMALL, pulses_arcsec=("0", "30"))
    found = {outcome.case: outcome for outcome in run(planned)}
    return [found[case] for case in planned]


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


def test_pulses_have_the_noise_of_the_closed_form_beside_them(outcomes):
    pulse, step, duration = math.radians(30 / 3600), 0.125, 5.0
    rate = math.radians(10)
    # The coning rate is sqrt(a^2 + g^2) in size at all times; one end of the run adds on three axes, w across two.
    wanted = pulse**2 / 12 * (3 + 2 * 5 / 9 * 2 * rate**2 * step * duration)
    for outcome in outcomes:
        if outcome.case.pulse_arcsec == "0":
            assert outcome.expected_deg is None
            continue
        assert math.radians(outcome.expected_deg) ** 2 == pytest.approx(wanted, rel=1e-3)
        # The largest error of one run with a real counter is of the size of the mean error at its end.
        assert 0.3 < outcome.quantization_deg / outcome.expected_deg < 4
    text = WordLengthResult(outcomes).text()
    assert text.count("if their errors are independent") == 1
    assert "5*h*q**2*t*w**2/108 + q**2/12" in text


def test_the_file_of_a_motion_takes_the_place_of_its_parameters(tmp_path, monkeypatch):
    monkeypatch.setattr(users_motions, "require_consistent", lambda *_: None)  # tested where it belongs
    file = tmp_path / "turn.py"
    text = "import numpy as np\ndef attitude(t): return np.eye(3) + np.zeros((*np.shape(t), 3, 3))\n"
    text += "def increments(step, steps, samples, previous=0, ahead=0):\n"
    text += "    return np.full((steps, samples, 3), RATE * step)\n"
    drifts = []
    for rate in (0.0, 0.01):
        file.write_text(text.replace("RATE", str(rate)))
        (case,) = cases(duration="5", words=24, carries="full", motion_name=str(file))
        assert case.settings == ()
        drifts.append(run_case(case).truncation_deg)
        WordLengthResult([run_case(case)]).text()
    assert drifts[0] == 0 < drifts[1], "another content of the file is another case"


def test_what_the_arithmetic_adds_is_certified_below_the_rounding_of_a_double():
    """A word of 50 bits with error feedback rounds less than a double: the other run was the coarser one."""
    pytest.importorskip("flint")
    (case,) = cases(duration="5", words=(50,), carries=("full",))
    outcome = run_case(case)
    assert 0 < outcome.rounding_radius_deg < 1e-9 * outcome.rounding_deg
    assert outcome.rounding_deg <= outcome.bound_deg
    (longer,) = cases(duration="5", words=(54,), carries=("full",))
    assert run_case(longer).rounding_radius_deg is None  # a double does not hold its states


def test_without_balls_the_run_in_double_is_compared(monkeypatch):
    (case,) = cases(duration="5", words=(16,), carries=("full",))
    certified = run_case(case)
    for module in (word_length, largest_rounding):
        monkeypatch.setattr(module, "has_balls", lambda: False)
    compared = run_case(case)  # another key of the cache
    assert compared.rounding_radius_deg is None
    assert compared.rounding_deg == pytest.approx(certified.rounding_deg, rel=1e-3)


def test_a_finished_case_is_not_run_again(outcomes, monkeypatch):
    monkeypatch.setattr(word_length, "backend", lambda *_, **__: pytest.fail("it was run before"))
    for outcome in outcomes:
        assert run_case(outcome.case) == outcome


def test_a_run_out_of_range_is_reported():
    (outcome,) = run(cases(methods=("rk1",), words=(16,), carries=("none",), steps=("0.5",), duration="180"))
    assert outcome.drift_deg is None and outcome.rounding_deg is None
    assert outcome.dominates == "range"
    assert " - " in WordLengthResult([outcome]).text()


def test_forms(outcomes):
    rows = list(csv.DictReader(io.StringIO(WordLengthResult(outcomes).written("csv"))))
    assert len(rows) == len(outcomes)
    assert float(rows[0]["rounding_deg"]) == outcomes[0].rounding_deg
    assert rows[0]["settings"] == "a_deg_s=10 b_deg_s=10 g_deg_s=10"
    text = WordLengthResult(outcomes).text()
    assert text.count("the method itself drifts by") == 2
    assert "pulses of 30 arcsec" in text


def test_image(outcomes):
    pytest.importorskip("matplotlib")
    assert word_length_image(WordLengthResult(outcomes), "study.png").startswith(b"\x89PNG")
    with pytest.raises(InputError, match="file type 'xyz'"):
        word_length_image(WordLengthResult(outcomes), "study.xyz")


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
def test_invalid_studies_are_refused(values, said):
    with pytest.raises(InputError, match=said):
        cases(**values)


def test_a_window_takes_its_samples_from_beside_the_step():
    """Of a user's rate too, and with pulses, which are counted along the whole row."""
    rate = str(Path(__file__).resolve().parents[2] / "examples" / "own_rate.py")
    chosen = {
        "increments": 1,
        "methods": ("window-3-3", "rk4"),
        "duration": "2",
        "words": (24,),
        "carries": ("full",),
    }
    window, rk4 = map(run_case, cases(**chosen, motion_name=rate, pulses_arcsec=("2",)))
    # One increment alone leaves a rate that does not change in the step: an order of 2 in place of 6.
    assert window.truncation_deg < 1e-2 * rk4.truncation_deg
    assert window.rounding_deg <= window.bound_deg
    assert 0.1 < window.quantization_deg / window.expected_deg < 4


def test_operations_are_those_of_the_step_in_a_second():
    """37 multiplications and 31 additions of the fourth order on two increments, eight times a second."""
    [case] = cases(words=12, carries="full", duration="2")
    assert run_case(case).operations_per_s == (37 + 31) * 8


def test_one_word_and_several_steps_are_drawn_against_operations(tmp_path):
    outcomes = [
        run_case(case) for case in cases(words=16, carries="full", duration="2", steps=("1/2", "1/4"))
    ]
    image = word_length_image(WordLengthResult(outcomes), tmp_path / "drift.svg").decode()
    assert "operations in a second" in image and "word, bits" not in image
