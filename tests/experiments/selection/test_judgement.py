"""Judgements: each cause as a time simulation has it, what binds, and the verdicts."""

import csv
import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest

import strapgen
from strapgen.cli import main
from strapgen.experiments.selection import causes
from strapgen.experiments.selection.answer import in_order, judgements, verdicts
from strapgen.experiments.selection.brief import read_brief
from strapgen.experiments.selection.candidates import STATES, contenders
from strapgen.experiments.selection.environment import RecordedEnvironment
from strapgen.experiments.selection.judgement import CAUSES, Question, judged
from strapgen.experiments.selection.simulated import algorithm_named, run, vibration

BRIEFS = Path(__file__).resolve().parents[3] / "examples" / "briefs"
#: What a deterministic cause may differ by from a time simulation: a part of it, or this in deg/h, whichever is more.
PART, LEAST = 0.1, 1e-3


def answer(path, names):
    brief = read_brief(path)
    return brief, in_order(one for row in judgements(path, contenders(brief, names), jobs=1) for one in row)


def assert_as_simulated(brief, path, one):
    simulated = run(brief, one, algorithm_named(one, brief, path))
    for cause in ("truncation", "coning"):
        predicted, seen = one.drift_deg_h[cause], getattr(simulated, cause)
        assert predicted == pytest.approx(seen, rel=PART, abs=LEAST), (one.name, cause)
    assert simulated.rounding <= one.drift_deg_h["rounding"], one.name


def test_what_meets_a_brief_does_so_in_time_as_well():
    path = BRIEFS / "ahrs.toml"
    brief, ordered = answer(path, ["rk4:2", "coning-compressed:3", "rk1"])
    accepted = [one for one in ordered if one.meets]
    assert accepted[0].name == "euler coning-compressed:3"
    assert {one.name for one in ordered if not one.meets} == {"euler rk1:1", "dcm rk1:1"}
    for one in accepted:
        assert_as_simulated(brief, path, one)
    refused = ordered[-1]
    assert refused.binding == "truncation" and refused.drift_deg_h["rounding"] is None
    said = verdicts(brief, ordered)
    assert said[0].startswith("euler coning-compressed:3 is the cheapest of 4 that meet the brief")
    assert said[1].startswith("the coning loop is not needed here")
    assert verdicts(brief, [one for one in ordered if not one.meets])[0] == (
        "no algorithm meets the brief; what binds: truncation of 2"
    )


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "methods"),
    [
        ("ins-0.1", ["coning-compressed:4", "tuned-worst:4", "rk4:2"]),
        ("ins-1", ["window-3-3", "coning-compressed:6", "rk4:2"]),
        ("guidance", ["coning-combined:3", "taylor4", "rk1", "window-3-3"]),
    ],
)
def test_every_class_of_1984_has_an_answer_that_a_simulation_confirms(name, methods):
    path = BRIEFS / f"{name}.toml"
    brief, ordered = answer(path, methods)
    accepted = [one for one in ordered if one.meets]
    assert accepted and len(accepted) < len(ordered)
    assert_as_simulated(brief, path, accepted[0])


def test_coning_and_quantization_are_the_same_with_every_state():
    path = BRIEFS / "ahrs.toml"
    brief = read_brief(path)
    for contender in contenders(brief, ["rk2:1", "magnus4:2", "crouch-grossman3:2"]):
        several = [contender.choice(state, str(path)) for state in STATES]
        for cause in (causes.coning, causes.quantization):
            one, other = (cause(choice, brief) for choice in several)
            assert one == pytest.approx(other, rel=1e-9)


@pytest.mark.parametrize(
    ("limit", "binding"),
    [
        ("operations_per_s = 1000", "operations_per_s"),
        ("bytes = 100", "bytes"),
        ("instructions_per_s = 1000", "instructions_per_s"),
    ],
)
def test_what_the_processor_lacks_binds(tmp_path, limit, binding):
    if binding != "operations_per_s":
        shutil.which("arm-none-eabi-gcc") or pytest.skip("no arm-none-eabi-gcc")
    path = tmp_path / "brief.toml"
    text = (BRIEFS / "ahrs.toml").read_text()
    path.write_text(text.replace("operations_per_s = 50_000", limit))
    (euler, _) = judged(Question(str(path), contenders(read_brief(path), ["rk4:2"])[0]))
    assert (euler["meets"], euler["binding"]) == (False, binding)


def test_noise_beyond_the_budget_binds_every_algorithm(tmp_path):
    path = tmp_path / "brief.toml"
    text = (BRIEFS / "ahrs.toml").read_text()
    path.write_text(text.replace("noise_deg_sqrt_h = 0.01", "noise_deg_sqrt_h = 3"))
    brief, ordered = answer(path, ["coning-compressed:4"])
    assert {one.binding for one in ordered} == {"noise"}
    assert verdicts(brief, ordered)[-1].startswith(
        "no algorithm helps: the gyro's noise alone leaves 7.3 deg/h"
    )


def test_random_walk_is_that_of_many_runs(rng):
    brief = read_brief(BRIEFS / "ahrs.toml")
    step = strapgen.backend("euler", "coning-compressed", 2)
    runs, steps = 400, 50
    seconds = steps * 2 / float(brief.gyro.sample_hz)
    scale = math.radians(brief.gyro.noise_deg_sqrt_h) / 60 / math.sqrt(float(brief.gyro.sample_hz))
    noisy = step.propagate(rng.normal(scale=scale, size=(runs, steps, 2, 3)), record_every=steps)[:, -1]
    squares = np.square(2 * noisy[:, :3]).sum(axis=1) * np.degrees(1) ** 2 * (3600 / seconds) ** 2
    predicted = (
        causes.noise(brief) ** 2 * float(brief.budget.over_s) / seconds
    )  # the drift falls as 1/sqrt(time)
    # Three squares of a normal number each: their mean has the relative deviation sqrt(2/3/runs).
    assert squares.mean() == pytest.approx(predicted, rel=4 * math.sqrt(2 / 3 / runs))


def test_a_recording_has_the_drift_of_the_vibration_that_it_is_of(tmp_path):
    path = BRIEFS / "ahrs.toml"
    brief = read_brief(path)
    shaken = vibration(brief.environment.lines(), brief)
    count, rate = 8192, brief.gyro.sample_hz
    rows = shaken.samples(1 / rate, 0, count)
    with (tmp_path / "log.csv").open("w") as file:
        table = csv.writer(file)
        table.writerow(["t", "dx", "dy", "dz"])
        table.writerows([[(k + 1) / float(rate), *row] for k, row in enumerate(rows)])
    recorded = RecordedEnvironment.read(tmp_path / "log.csv")
    (contender,) = contenders(brief, ["coning-compressed:4"])
    choice = contender.choice("euler", str(path))
    expected = strapgen.vibration.of(choice)
    step = causes.step_length(choice, brief.gyro)
    # What is recorded has passed the gyro: 1/|G|^2 of the vibration's coning.
    line = brief.environment.lines()[0]
    ratio = line.frequency_hz / float(brief.gyro.bandwidth_hz)
    gain = 1 / ((1 - ratio**2) ** 2 + (2 * float(brief.gyro.damping) * ratio) ** 2)
    assert recorded.error(expected, step) == pytest.approx(
        gain * brief.environment.error(expected, step), rel=0.02
    )


def test_the_command_prints_the_promised_json(capsys):
    words = ["design", str(BRIEFS / "ahrs.toml"), "--method", "rk1,coning-compressed:4", "--jobs", "1"]
    with pytest.raises(SystemExit) as stop:
        main([*words, "--format", "json"])
    assert stop.value.code in (0, None)
    rows = json.loads(capsys.readouterr().out)
    assert [row["meets"] for row in rows] == [True, True, False, False]
    assert list(rows[0])[:5] == ["name", "meets", "binding", "drift_deg_h", "operations_per_s"]
    assert tuple(rows[0]["drift_deg_h"]) == CAUSES
