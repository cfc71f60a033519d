"""Many runs with the random errors of a gyro: their drift is that of the closed forms, whoever works them out."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from commands import run

from strapgen import catalogue
from strapgen.cli import main
from strapgen.lab import random_runs as experiment
from strapgen.lab.random_runs import (
    Errors,
    MeanSquare,
    SteadyRuns,
    cases,
    predicted,
    random_runs,
)

PULSES, NOISE = Errors(2e-5, 0.0, 0.01), Errors(0.0, 2e-5, 0.01)


def outcome(runs, **options):
    return MeanSquare.of(random_runs(runs, jobs=options.pop("jobs", 1), **options))


@pytest.mark.parametrize(
    ("method", "increments", "previous", "ahead"),
    [("rk4", 2, 0, 0), ("coning-compressed", 1, 2, 0), ("window-3-3", 1, 3, 3)],
)
@pytest.mark.parametrize("errors", [PULSES, NOISE], ids=["pulses", "noise"])
def test_the_closed_forms_lie_in_the_interval_of_many_runs(method, increments, previous, ahead, errors):
    choice = catalogue.choose_step("euler", method, increments, previous=previous, ahead=ahead)
    low, high = outcome(SteadyRuns(choice, errors, 100, 500)).interval()
    assert low < predicted(choice, errors, 100) < high
    # An interval that holds anything would show nothing.
    assert high < 1.5 * low


def test_blocks_of_steps_do_not_change_the_result(monkeypatch):
    choice = catalogue.choose_step("euler", "coning-compressed", 3, previous=2)
    runs = SteadyRuns(choice, replace(PULSES, noise=1e-5), 40, 5)
    whole = outcome(runs)
    monkeypatch.setattr(experiment, "_DRAWN", 5 * 3 * 3 * 40)
    assert outcome(runs) == whole
    monkeypatch.setattr(experiment, "_DRAWN", 5 * 3 * 3 * 7)
    drawn = experiment._Gyro(replace(runs, errors=PULSES), beside=2)
    first, second = drawn.rows(9), drawn.rows(6)
    assert np.array_equal(first[:, 9:], second[:, :2]), "what lies beside the last step comes again"
    turned = np.concatenate([first[:, 2:9], second], axis=1).sum(axis=1) - [0, 0, 15 * PULSES.turn]
    assert np.abs(turned).max() <= PULSES.pulse / 2, "angles are whole numbers of pulses, the first one exact"


def test_blocks_of_a_run_have_independent_noise():
    drawn = experiment._Gyro(SteadyRuns(catalogue.choose_step("euler", "rk4", 2), NOISE, 6, 5), beside=0)
    rows = np.concatenate([drawn.rows(6), drawn.rows(6)])
    assert np.unique(rows).size == rows.size


def test_the_number_of_processes_changes_nothing(tmp_path):
    choice = catalogue.choose_step("euler", "rk2", 1)
    runs = SteadyRuns(choice, NOISE, 20, 600)
    one = {name: experiment.mean_square(part) for name, part in cases(runs).items()}
    several = tmp_path / "runs.jsonl"
    together = outcome(runs, jobs=2, results=several)
    assert together.total == math.fsum(part["total"] for part in one.values())
    assert {
        row["case"]: row["result"] for row in map(json.loads, several.read_text().splitlines()[1:])
    } == one
    more = outcome(replace(runs, runs=1000), results=several)
    assert more.runs == 1000 and len(several.read_text().splitlines()) == 1 + 3 + 2


@pytest.mark.long
def test_runs_of_more_steps_than_are_drawn_at_a_time_are_those_of_any_number_of_processes(capsys):
    # Ten parts of 250 runs: each of two processes has several.
    drifts, length = [], 1500
    assert length * 250 * 2 * 3 > experiment._DRAWN
    for words in ("--jobs 1", "--jobs 2"):
        command = f"study monte-carlo euler --runs 2500 --length {length} --format json {words}"
        run(command.split())
        data = json.loads(capsys.readouterr().out)
        assert (data["runs"], data["steps"]) == (2_500, length) and data["inside"]
        assert data["sweep_hours"] == pytest.approx(data["seconds"] * 400 / 3600)  # of a million runs
        drifts.append(data["drift_deg_h"])
    assert drifts[0] == drifts[1]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("--runs 0", "runs is 0"),
        ("--length many", "length is 'many'; a whole number is needed"),
        ("--pulse-arcsec -1", "--pulse-arcsec is -1; a number that is not below 0"),
        ("--noise-deg-sqrt-h 0", "are both 0"),
        ("--sample-hz 0", "sample-hz is 0"),
        ("--backend exact", "backend 'exact'"),
        ("--seed -1", "seed is -1"),
        ("--of 0", "of is 0"),
        ("--jobs 2 --cluster local:2", "--jobs and --cluster are both given"),
        ("--out a.txt --results a.txt", "--out and --results are both a.txt"),
    ],
)
def test_invalid_options_are_refused_in_one_line(options, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as stop:
        main(["study", "monte-carlo", "euler", *options.split()])
    error = capsys.readouterr().err
    assert stop.value.code == 2 and said in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_the_command_shows_the_drift_beside_the_closed_forms(capsys):
    command = "study monte-carlo euler --runs 500 --length 100 --backend numpy --jobs 1 --of 1000"
    run(command.split())
    text = capsys.readouterr().out
    assert text.startswith("500 runs of 100 steps, 2 s each: euler-rk4-2, numpy")
    assert "deg/h, inside" in text and "1000 runs take" in text
