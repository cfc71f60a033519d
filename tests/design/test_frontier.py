"""The comparison of drift and cost: what is compared, what it costs, and a study that goes on where it was."""

from __future__ import annotations

import json
import math

import pytest
import sympy as sp

from strapgen.catalogue import METHODS
from strapgen.catalogue.methods.coning_coefficients import design
from strapgen.design import frontier
from strapgen.design.design_plots import frontier_image
from strapgen.design.frontier import (
    CANDIDATES,
    MOTIONS,
    Candidate,
    FrontierResult,
    candidates,
    in_order,
    pareto,
)
from strapgen.ir.exceptions import InputError
from strapgen.lab import runs

FEW = ("coning-compressed:1+1", "rk4:2", "coning-compressed:4")


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Return a short study with its results file."""
    path = tmp_path_factory.mktemp("frontier") / "results.jsonl"
    several = candidates(FEW)
    return several, path, in_order(frontier.frontier(several, "100", "2", path, 1), several)


def test_every_candidate_can_be_chosen():
    assert len({candidate.name for candidate in CANDIDATES}) == len(CANDIDATES)
    for candidate in CANDIDATES:
        choice = candidate.choice
        assert (choice.increments, choice.previous, choice.ahead) == (
            candidate.increments,
            candidate.previous,
            candidate.ahead,
        )


def test_names_stand_for_candidates():
    assert [one.name for one in candidates(["magnus6"])] == ["magnus6:3", "magnus6:4", "magnus6:3+3"]
    # A method without candidates has its own samples; what is named twice is compared once.
    assert [one.name for one in candidates(["rk2", "rk2:2", "rk4:1+2"])] == ["rk2:2", "rk4:1+2"]
    assert (
        candidates(["window-7-7"]) == candidates(["window-7-7:1+7+7"]) == [Candidate("window-7-7", 1, 7, 7)]
    )
    assert candidates() == list(CANDIDATES)
    (file,) = candidates(["examples/modified_rodrigues.py:3"])
    assert file.choice.increments == 3


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("rk5", "method 'rk5' is not known"),
        ("rk5:2", "method 'rk5' is not known"),
        ("rk4:x", "number of samples in rk4:x is 'x'; a whole number is needed"),
        ("rk4:0", "increments is 0"),
        ("rk4:1+2+3+4", "has 4 numbers of samples; METHOD:N\\+P\\+L has at most three"),
        ("rk4:9", "increments is 9"),
        ("coning-combined:3+0+3", "takes no increments ahead"),
        ("missing.py:1", "missing.py"),
    ],
)
def test_candidates_that_cannot_be_chosen(name, words):
    with pytest.raises(InputError, match=words):
        candidates([name])


@pytest.mark.long
def test_costs_are_those_of_the_program_for_each_sample(study):
    _, _, drifts_and_costs = study
    by_name = {drift_and_cost.name: drift_and_cost for drift_and_cost in drifts_and_costs}
    rk4 = by_name["rk4:2"]  # 37 multiplications and 31 additions in a step, as in docs/canonical-form.md
    assert (rk4.multiply, rk4.add, rk4.other) == (37, 31, 0)
    assert rk4.per_second(100) == 1850
    assert by_name["coning-compressed:1+1"].other == 3  # square root, sine and cosine


def test_drifts_are_those_of_the_closed_forms(study):
    """A cone of a small half-angle: two samples, by 4/3 of their cross product at b = 2 pi f T."""
    from math import cos, degrees, pi, radians, sin

    _, _, drifts_and_costs = study
    rk4 = drifts_and_costs[1]
    b, angle = 2 * pi * 5 / 100, radians(0.1)
    left = (2 * b - sin(2 * b)) / 2 - 2 / 3 * 2 * sin(b) * (1 - cos(b))
    assert rk4.drifts["cone 0.1/5"] == pytest.approx(degrees(left * angle**2 / 0.02) * 3600, rel=0.01)


def on_cone(method: str, half_angle: str, frequency: str, duration: str) -> float:
    """Return the drift of one algorithm on a cone, as the command shows it."""
    (one,) = candidates([method])
    cone = {"cone": ("cone", {"half_angle_deg": half_angle, "frequency_hz": frequency})}
    return frontier._drift(one.choice, "cone", frontier.RunSpec(one, "100", duration, cone))


@pytest.mark.parametrize("half_angle", ["0.01", "0.001"])
def test_a_drift_that_rounding_hides_is_that_of_its_series(half_angle):
    # The closed form is of second order in the half-angle: the fourth adds 2.3e-4 of it at 0.01 deg, and its square.
    symbols = {"alpha": math.radians(float(half_angle)), "omega": 10 * math.pi, "T": 0.01}
    closed = sp.sympify(design(3, 3, "combined").residual().expression).evalf(30, subs=symbols)
    expected = abs(math.degrees(float(closed))) * 3600
    assert expected < 1e-11
    allowed = 3e-4 * (float(half_angle) / 0.01) ** 2 + 1e-9
    assert on_cone("coning-combined:3+3", half_angle, "5", "1.2") == pytest.approx(expected, rel=allowed)


def test_both_arithmetics_agree_where_both_show_a_drift(monkeypatch):
    plain = on_cone("coning-combined:3+3", "1", "5", "1.2")
    monkeypatch.setattr(runs, "_UNITS_A_STEP", math.inf)
    # Rounding of double precision is a unit in the last place at most in each of the 40 steps.
    rounding = math.degrees(40 * 2.0**-52) / 1.2 * 3600
    many_digits = on_cone("coning-combined:3+3", "1", "5", "1.2")
    assert many_digits == pytest.approx(plain, abs=rounding) and many_digits != plain


def test_results_come_in_the_order_of_the_candidates(study):
    several, _, drifts_and_costs = study
    assert (
        [drift_and_cost.name for drift_and_cost in drifts_and_costs]
        == [one.name for one in several]
        == list(FEW)
    )
    assert all(list(drift_and_cost.drifts) == list(MOTIONS) for drift_and_cost in drifts_and_costs)


def test_interrupted_study_resumes(study, monkeypatch):
    several, path, drifts_and_costs = study

    def never(trial):
        raise AssertionError("a result that is there is not worked out again")

    monkeypatch.setattr(frontier, "run_case", never)
    assert in_order(frontier.frontier(several, "100", "2", path, 1), several) == drifts_and_costs
    with pytest.raises(InputError, match='holds another study: duration_s is "2" there and "3" here'):
        list(frontier.frontier(several, "100", "3", path, 1))
    with pytest.raises(InputError, match='holds another study: sample_hz is "100" there and "50" here'):
        list(frontier.frontier(several, "50", "2", path, 1))


def test_a_step_longer_than_the_run_is_refused():
    with pytest.raises(
        InputError, match=r"duration 0\.03 s is shorter than a step of coning-compressed:4 at 100 Hz"
    ):
        list(frontier.frontier(candidates(["coning-compressed:4"]), "100", "0.03"))
    with pytest.raises(InputError, match="duration 1 s is not a whole multiple of the sampling interval"):
        list(frontier.frontier(candidates(["rk4:2"]), "7/2", "1"))


def test_a_run_that_leaves_its_numbers_has_no_drift():
    trial = frontier.RunSpec(Candidate("rk4", 1), "1", "600")
    assert frontier._drift(trial.candidate.choice, "cone 15/20", trial) is None


def test_a_users_motion_stands_alone():
    mine = {"coning": ("coning", {"a_rad_s": "1", "b_rad_s": "1.5", "g_rad_s": "0.6"})}
    several = candidates(["rk1:2", "rk4:2"])
    drifts_and_costs = in_order(frontier.frontier(several, "100", "2", jobs=1, motions=mine), several)
    assert all(list(one.drifts) == ["coning"] for one in drifts_and_costs)
    assert (
        drifts_and_costs[1].drifts["coning"] < 1e-5 * drifts_and_costs[0].drifts["coning"]
    )  # orders 1 and 4 at 1/50 rad
    report = FrontierResult(drifts_and_costs, 100.0, 2.0, mine)
    data = json.loads(report.written("json"))
    assert data["motions"] == {"coning": {"motion": "coning", **mine["coning"][1]}}
    assert report.written("csv").splitlines()[0].endswith(",multiply_per_s,coning deg/h")
    text = report.written("text")
    assert "drift on coning, a_rad_s=1, b_rad_s=1.5, g_rad_s=0.6" in text and "drift on cones" not in text


def test_sensors_with_errors_leave_what_their_samples_are_off_by(tmp_path):
    mine = {"cone": ("cone", {"half_angle_deg": "1", "frequency_hz": "20"})}
    several, drifts = candidates(["window-7-7", "coning-compressed:1+1"]), {}
    for name, text in {
        "exact": "",
        "pulses": "[gyro]\npulse_arcsec = 5",
        "jitter": "[sampling]\njitter_s = 1e-4",
    }.items():
        (tmp_path / f"{name}.toml").write_text(text)
        errors = str(tmp_path / f"{name}.toml")
        found = in_order(frontier.frontier(several, "100", "6", jobs=1, motions=mine, errors=errors), several)
        drifts[name] = [one.drifts["cone"] for one in found]
    window, classic = drifts["exact"]
    assert window < 1e-3 and classic == pytest.approx(270, rel=0.1)
    assert 0.3 < drifts["pulses"][0] < 5  # docs/windows.md, of 60 s: 1.4
    assert 0.1 < drifts["jitter"][0] < 9
    assert drifts["pulses"][1] == pytest.approx(classic, rel=0.1)
    report = FrontierResult(found, 100.0, 6.0, mine, errors)
    assert "increments at 100 Hz of sensors with errors" in report.written("text")
    assert frontier.identity("100", "6", mine, errors) != frontier.identity("100", "6", mine)
    with pytest.raises(InputError, match="cannot be read"):
        list(frontier.frontier(several, "100", "6", jobs=1, motions=mine, errors="missing.toml"))


def test_a_motion_that_is_not_known_is_refused():
    with pytest.raises(InputError, match="'conin' is not known"):
        list(frontier.frontier(candidates(["rk4:2"]), jobs=1, motions={"conin": ("conin", {})}))


def test_all_stands_for_every_method_with_its_samples():
    every = candidates(["all"])
    assert {one.method for one in every} == {*METHODS}
    assert every[: len(CANDIDATES)] == list(CANDIDATES) and len({one.name for one in every}) == len(every)


def test_frontier_has_the_points_that_none_undercuts():
    points = {
        "a": (1.0, 5.0),
        "b": (2.0, 6.0),
        "c": (2.0, 3.0),
        "d": (2.0, 4.0),
        "e": (9.0, 3.0),
        "f": (10.0, 1.0),
    }
    assert pareto(points) == ["a", "c", "f"]
    assert pareto(points, gain=0.5) == ["a", "f"]
    assert pareto({}) == []


def test_reports_have_every_figure(study, tmp_path):
    _, _, drifts_and_costs = study
    report = FrontierResult(drifts_and_costs, 100.0, 2.0)
    data = json.loads(report.written("json"))
    assert [row["algorithm"] for row in data["algorithms"]] == list(FEW)
    assert data["algorithms"][1]["drift_deg_h"] == drifts_and_costs[1].drifts
    lines = report.written("csv").splitlines()
    assert len(lines) == 4 and all(f"{label} deg/h" in lines[0] for label in MOTIONS)
    text = report.written("text")
    assert max(map(len, text.split("sources")[0].splitlines())) <= 120
    assert text.count("rk4:2") == 5  # costs, three tables of drifts, and its source
    assert "every figure is measured here" in text
    assert report.written("markdown").count("\n") == 4


@pytest.mark.long
def test_the_plot_is_an_image(study, tmp_path):
    _, _, drifts_and_costs = study
    assert frontier_image(FrontierResult(drifts_and_costs, 100.0, 2.0), tmp_path / "a.png").startswith(
        b"\x89PNG"
    )
