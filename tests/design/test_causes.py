"""The causes of drift: rounding by error feedback, lines to fourth order against runs, and what is compared."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from strapgen.catalogue import METHODS, choose
from strapgen.design.brief import LineEnvironment, read_brief
from strapgen.design.frontier import Candidate
from strapgen.design.selection import causes
from strapgen.design.selection.candidates import algorithm_of, contenders
from strapgen.design.selection.causes import CARRIES, Rounding
from strapgen.design.selection.simulated import software_drifts, start_phases
from strapgen.ir.exceptions import InputError

BRIEF = read_brief(Path(__file__).resolve().parents[2] / "examples" / "briefs" / "ahrs.toml")
#: Bounds in deg/h by the error feedback; None where there is none.
BOTH, FULL_ALONE, NEITHER = (
    {"none": 8.0, "full": 2.0},
    {"none": None, "full": 2.0},
    {"none": None, "full": None},
)


@pytest.fixture
def rounding(monkeypatch):
    """Return what is chosen for a limit where the certified bounds are these."""

    def chosen(bounds: dict[str, float | None], allowed: float) -> tuple[str, list[str]]:
        tried = []

        def certified(_choice, _brief, carry):
            tried.append(carry)
            if bounds[carry] is None:
                raise InputError("no bound")
            return Rounding(bounds[carry], carry)

        monkeypatch.setattr(causes, "_certified_drift", certified)
        monkeypatch.setattr(causes, "_least_without_feedback", lambda *_: 1.0)
        return causes.rounding(choose("euler"), BRIEF, allowed).carry, tried

    return chosen


@pytest.mark.parametrize(
    ("bounds", "allowed", "carry", "tried"),
    [
        (BOTH, 9.0, "none", ["none"]),
        (BOTH, 8.0, "none", ["none"]),  # it is met by a bound that equals it
        (BOTH, 7.9, "full", ["none", "full"]),
        (BOTH, 1.0, "full", ["none", "full"]),  # nothing meets it: the smallest bound
        (BOTH, 0.9, "full", ["full"]),  # below what any bound without feedback exceeds
        (FULL_ALONE, 9.0, "full", ["none", "full"]),
        (NEITHER, 9.0, "none", ["none", "full"]),
    ],
)
def test_the_least_feedback_that_meets_a_limit_is_chosen(rounding, bounds, allowed, carry, tried):
    assert CARRIES == ("none", "full")
    assert rounding(bounds, allowed) == (carry, tried)


def test_all_methods_of_the_catalogue_are_tried_but_the_reference_and_long_series():
    """The fit of an exact rotation is what others are held to; a ninth order of a series is below rounding."""
    methods = {one.method for one in contenders(BRIEF)}
    long_series = {f"taylor{order}" for order in range(9, 100)} & {*METHODS}
    assert long_series and "fit-exact" in METHODS
    assert methods & {*METHODS} == {*METHODS} - long_series - {"fit-exact"}


BRIEFS = Path(__file__).resolve().parents[2] / "examples" / "briefs"
LINES_BRIEF = """
max_rate_deg_s = 100
[vibration]
lines = [
{lines}
]
[gyro]
sample_hz = 200
{gyro}
[budget]
drift_deg_h = 1
"""
GYRO = 'response = "second-order:60:0.6"'
#: Frequencies of lines that add up, in two ways; the last ones to whole periods in a step of two samples.
FREQUENCIES = [("6", "12", "18"), ("4.5", "13.5", "9"), ("41.5", "58.5")]


def written(folder, hertz, gyro="", seed=0):
    rng = np.random.default_rng(seed)
    lines = ",\n".join(
        f"{{ frequency_hz = {one}, theta_x_rad = {x:.4f}, theta_y_rad = {y:.4f}, phase_rad = {p:.3f} }}"
        for one, x, y, p in zip(
            hertz, *rng.uniform(0.002, 0.01, (2, len(hertz))), rng.uniform(-3, 3, len(hertz)), strict=True
        )
    )
    path = folder / f"brief_{len([*folder.iterdir()])}.toml"
    path.write_text(LINES_BRIEF.format(lines=lines, gyro=gyro))
    return path


def predicted_and_run(path, candidate, state):
    brief = read_brief(path)
    algorithm = algorithm_of(candidate, state, brief, path)
    found = algorithm.rectification()
    at_its_phases = found.at(start_phases(len(brief.environment.lines())))
    run = software_drifts(brief, algorithm)["coning"]
    return math.hypot(*at_its_phases) * causes.DEG_H, found.worst() * causes.DEG_H, run


@pytest.mark.parametrize("hertz", FREQUENCIES)
@pytest.mark.parametrize(
    ("state", "candidate"),
    [
        ("euler", Candidate("coning-compressed", 2)),
        ("dcm", Candidate("coning-compressed", 1, 2)),
        ("euler", Candidate("coning-combined", 2, 1)),
        ("dcm", Candidate("rk4", 2)),
        ("euler", Candidate("taylor2", 1)),
        ("euler", Candidate("window-3-3", 1, 3, 3)),
        ("dcm", Candidate("two-speed", 4)),
        ("euler", Candidate("two-speed", 2)),
    ],
)
def test_a_prediction_is_that_of_a_run_at_its_phases_and_above_it_at_the_worst(
    hertz, state, candidate, tmp_path
):
    predicted, worst, run = predicted_and_run(written(tmp_path, hertz, GYRO), candidate, state)
    assert predicted == pytest.approx(run, rel=0.01)
    assert worst > 0.99 * run


def test_lines_at_one_frequency_depend_on_how_they_begin(tmp_path):
    predicted, worst, run = predicted_and_run(
        written(tmp_path, ("20", "20")), Candidate("coning-compressed", 2), "euler"
    )
    assert predicted == pytest.approx(run, rel=0.01)
    assert worst > 1.05 * run


def test_tones_are_the_exact_lines_as_the_gyro_passes_them_on(tmp_path):
    brief = read_brief(written(tmp_path, ("5.4", "10.8"), GYRO))
    one, two = causes.tones(brief)
    assert two.frequency_hz == 2 * one.frequency_hz
    line = brief.environment.lines()[0]
    assert [abs(c) for c in one.angles] == pytest.approx([line.theta_x, line.theta_y, 0])
    assert np.angle(one.angles[1] / one.angles[0]) == pytest.approx(line.phase)
    ratio = 5.4 / 60
    assert one.gain == pytest.approx(1 / complex(1 - ratio**2, 2 * 0.6 * ratio))
    assert causes.tones(read_brief(written(tmp_path, ("5.4",))))[0].gain == 1


def test_spectra_and_very_many_lines_are_predicted_to_second_order_alone(tmp_path):
    assert causes.tones(read_brief(BRIEFS / "ins-1.toml")) == []
    hertz = [str(k + 1) for k in range(causes.MOST_LINES)]
    assert len(causes.tones(read_brief(written(tmp_path, hertz)))) == len(hertz)
    brief = read_brief(written(tmp_path, [*hertz, "77"]))
    assert isinstance(brief.environment, LineEnvironment) and causes.tones(brief) == []
