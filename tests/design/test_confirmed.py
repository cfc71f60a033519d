"""Answers of a design: what lines rectify to fourth order, what a run refuses, and errors that cancel."""

import math
from dataclasses import replace
from fractions import Fraction

import pytest

from strapgen.design.brief import read_brief
from strapgen.design.selection import causes
from strapgen.design.selection.candidates import contenders
from strapgen.design.selection.judgement import after_run, in_order, judgements, verdicts
from strapgen.design.selection.selection_report import SelectionResult
from strapgen.design.selection.simulated import algorithm_named, confirm, software_drifts, start_phases

#: Three lines of at most 0.17 deg, of which each is twice the one below: what is of third order has a mean.
OCTAVES = """
max_rate_deg_s = 100
[vibration]
lines = [
  {{ frequency_hz = 5.4, theta_x_rad = 3e-3, theta_y_rad = 2e-3, phase_rad = 1.2 }},
  {{ frequency_hz = {second}, theta_x_rad = 2e-3, theta_y_rad = 3e-3, phase_rad = 0.4 }},
  {{ frequency_hz = {third}, theta_x_rad = 1.5e-3, theta_y_rad = 2.5e-3, phase_rad = 2.0 }},
]
[gyro]
sample_hz = 200
[budget]
drift_deg_h = 0.01
[processor]
word = 64
"""
#: One line of 1 deg: what is of fourth order is no longer small.
STRONG = """
max_rate_deg_s = 100
[vibration]
lines = [{ frequency_hz = 17, theta_x_rad = 0.0174533, theta_y_rad = 0.0174533, phase_rad = 1.5707963 }]
[gyro]
sample_hz = 200
[budget]
drift_deg_h = 0.1
[processor]
word = 64
"""
#: The cheapest by prediction, one of third order in the rotation vector too, and one that is dearer still.
METHODS = ["coning-compressed:8", "coning-compressed:5", "coning-combined:3+3", "window-7-7"]


def judged(tmp_path, text, methods=METHODS):
    path = tmp_path / f"brief_{len([*tmp_path.iterdir()])}.toml"
    path.write_text(text)
    brief = read_brief(path)
    rows = judgements(path, contenders(brief, methods), jobs=1)
    return path, brief, in_order(one for row in rows for one in row)


@pytest.mark.parametrize(
    ("text", "first", "ran", "parts"),
    [
        (OCTAVES.format(second=10.8, third=21.6), 3.3e-7, 0.072, ("3", "4", "2")),
        (STRONG, 5.7e-7, 0.041, ("4", "2", "3")),
    ],
)
def test_higher_order_drift_is_predicted(text, first, ran, parts, tmp_path):
    path, brief, ordered = judged(tmp_path, text)
    by_name = {one.name: one for one in ordered}
    one = by_name["euler coning-compressed:8"]
    assert (one.meets, one.binding) == (False, "coning")
    assert one.coning_parts_deg_h["2"] == pytest.approx(first, rel=0.02)
    assert tuple(sorted(one.coning_parts_deg_h, key=lambda k: -one.coning_parts_deg_h[k])) == parts
    algorithm = algorithm_named(one, brief, path)
    run = software_drifts(brief, algorithm)["coning"]
    assert run == pytest.approx(ran, rel=0.02)
    at_its_phases = algorithm.rectification().at(start_phases(len(brief.environment.lines())))
    assert math.hypot(*at_its_phases) * causes.DEG_H == pytest.approx(run, rel=0.01)
    assert one.drift_deg_h["coning"] > 0.99 * run
    answer = confirm(brief, path, ordered)
    # The cheapest that meets it is the answer; its run confirms it, and no other one was run.
    assert answer[0].name == "euler coning-combined:3+3" and answer[0].meets
    assert answer[0].run_deg_h["coning"] == pytest.approx(answer[0].drift_deg_h["coning"], rel=0.01)
    assert [one.run_deg_h for one in answer[1:]] == [None] * 7
    third, fourth = (one.coning_parts_deg_h[order] for order in "34")
    assert verdicts(brief, answer)[2] == (
        "4 meet it to second order alone, the first euler coning-compressed:8: the lines leave "
        f"{third:.2g} deg/h of third order and {fourth:.2g} of fourth"
    )


def test_the_cheapest_that_holds_in_its_run_is_the_answer(tmp_path):
    """A sum of frequencies that is nearly another one is a slow oscillation, in a run of some seconds a drift."""
    path, brief, ordered = judged(tmp_path, OCTAVES.format(second=10.80001, third=21.6))
    assert ordered[0].name == "euler coning-compressed:8" and ordered[0].meets
    assert ordered[0].coning_parts_deg_h["3"] == 0
    answer = confirm(brief, path, ordered)
    assert answer[0].name == "euler coning-combined:3+3" and answer[0].meets
    refused = {one.name: one for one in answer if not one.meets}
    assert refused.keys() == {f"{state} coning-compressed:{n}" for state in ("euler", "dcm") for n in (5, 8)}
    first = refused["euler coning-compressed:8"]
    assert first.binding == "coning" and first.run_deg_h["coning"] == pytest.approx(0.072, rel=0.02)
    assert first.reason.startswith("in a run coning ") and first.reason.endswith(" is predicted")
    assert [one.run_deg_h for one in answer[1:] if one.meets] == [None] * 3
    said = verdicts(brief, answer)
    assert said[1].startswith("its run in time confirms it: ")
    assert said[2].startswith("4 cheaper by prediction do not meet it in a run, the first euler coning-")
    text = SelectionResult(brief, answer, None, "octaves").text()
    assert "the run of the first confirms it, the others are predicted" in text
    assert "coning, in its run" in text


def test_the_verdict_of_a_run_is_by_all_limits(tmp_path):
    _, brief, ordered = judged(tmp_path, STRONG, ["coning-combined:3+3"])
    one = ordered[0]
    share = brief.budget.drift_deg_h * brief.budget.software_share
    assert after_run(brief, one, {"truncation": 0.0, "coning": 0.9 * share}).meets
    beyond = after_run(brief, one, {"truncation": 0.6 * share, "coning": 0.6 * share})
    assert (beyond.meets, beyond.binding) == (False, "truncation")
    noisy = replace(one, drift_deg_h={**one.drift_deg_h, "noise": brief.budget.drift_deg_h})
    loud = after_run(brief, noisy, {"truncation": 0.0, "coning": 0.5 * share})
    assert (loud.meets, loud.binding) == (False, "noise")


def test_a_win_by_errors_that_cancel_is_said_to_be_fragile(tmp_path):
    # The error at a line goes with the product of its angles: a second line of the other sense undoes the first.
    brief = STRONG.replace("0.0174533", "1e-3")
    path, read, ordered = judged(tmp_path, brief, ["coning-compressed:2"])
    (error, gyro) = algorithm_named(ordered[0], read, path).line_errors()
    assert gyro == 0.0 and abs(error) == pytest.approx(ordered[0].drift_deg_h["coning"])
    opposite = brief.replace(
        "lines = [",
        "lines = [{ frequency_hz = 17, theta_x_rad = 1e-3, theta_y_rad = 999e-6, phase_rad = -1.5707963 }, ",
    )
    share = abs(error) * 1.5
    tight = opposite.replace("drift_deg_h = 0.1", f"drift_deg_h = {share * 10:.3e}")
    path, read, ordered = judged(tmp_path, tight, ["coning-compressed:2"])
    one = ordered[0]
    assert one.meets and one.drift_deg_h["coning"] < share / 100
    assert (
        one.fragile.startswith(f"errors of up to {abs(error):.2g} deg/h")
        and "at 2 lines, cancel" in one.fragile
    )
    assert any(sentence.startswith("the choice is fragile: ") for sentence in verdicts(read, ordered))
    loose = opposite.replace("drift_deg_h = 0.1", f"drift_deg_h = {abs(error) * 30:.3e}")
    assert judged(tmp_path, loose, ["coning-compressed:2"])[2][0].fragile == ""


def test_errors_of_a_line_are_those_of_the_step_and_of_the_gyro(tmp_path):
    gyro = '[gyro]\nresponse = "second-order:80:0.7"\n'
    path, brief, ordered = judged(tmp_path, STRONG.replace("[gyro]\n", gyro), ["coning-compressed:3"])
    step, of_gyro = algorithm_named(ordered[0], brief, path).line_errors()
    plain = judged(tmp_path, STRONG, ["coning-compressed:3"])
    assert step == pytest.approx(algorithm_named(plain[2][0], plain[1], path).line_errors()[0])
    # |G|^2 - 1 of a second-order gyro times the rate of the cone, half the product of the angles times 2 pi f.
    ratio = 17 / 80
    gain = 1 / ((1 - ratio**2) ** 2 + (2 * 0.7 * ratio) ** 2)
    rate = 0.0174533**2 / 2 * 2 * 3.141592653589793 * 17 * causes.DEG_H
    assert abs(of_gyro) == pytest.approx(rate * abs(gain - 1), rel=1e-3)


def test_the_position_is_half_the_acceleration_times_the_square_of_the_time(tmp_path):
    text = STRONG.replace("phase_rad = 1.5707963", "phase_rad = 0.3, acceleration_y_m_s2 = 2")
    text = text.replace("[budget]\n", "[budget]\nover_s = 600\nvelocity_m_s = 1e3\nposition_m = 1e6\n")
    text = text.replace("0.0174533", "1e-5")
    path, brief, ordered = judged(tmp_path, text, ["coning-compressed:3"])
    error = algorithm_named(ordered[0], brief, path).sculling()
    assert error and ordered[0].velocity_m_s == pytest.approx(error * 600)
    assert ordered[0].position_m == pytest.approx(error * 600**2 / 2)
    # The software's share of the position, a tenth, binds before that of the velocity.
    limit = ordered[0].position_m * 9
    tight = text.replace("position_m = 1e6", f"position_m = {limit}")
    refused = judged(tmp_path, tight, ["coning-compressed:3"])[2][0]
    assert (refused.meets, refused.binding) == (False, "position")
    assert judged(tmp_path, text.replace("1e6", f"{limit * 1.3}"), ["coning-compressed:3"])[2][0].meets


def test_random_causes_count_with_the_software_against_the_budget(tmp_path):
    text = STRONG.replace("[gyro]\n", "[gyro]\nnoise_deg_sqrt_h = 0.05\n").replace("0.0174533", "1e-5")
    one = judged(tmp_path, text, ["coning-compressed:3"])[2][0]
    assert (one.meets, one.binding) == (True, None)
    # sqrt(3) N / sqrt(t) over the hour of the budget.
    assert one.drift_deg_h["noise"] == pytest.approx(3**0.5 * 0.05)
    budget = Fraction(str(one.drift_deg_h["noise"])) * Fraction("0.999")
    tight = text.replace("drift_deg_h = 0.1", f"drift_deg_h = {float(budget)}")
    assert judged(tmp_path, tight, ["coning-compressed:3"])[2][0].binding == "noise"
