"""Predictions to fourth order under lines of a brief, against runs in time at the same phases."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from strapgen.design.brief import LineEnvironment, read_brief
from strapgen.design.selection import causes
from strapgen.design.selection.candidates import Contender, algorithm_of
from strapgen.design.selection.simulated import software_drifts, start_phases

BRIEFS = Path(__file__).resolve().parents[2] / "examples" / "briefs"
BRIEF = """
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
GYRO = "bandwidth_hz = 60\ndamping = 0.6"
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
    path.write_text(BRIEF.format(lines=lines, gyro=gyro))
    return path


def predicted_and_run(path, contender, state):
    brief = read_brief(path)
    algorithm = algorithm_of(contender, state, brief, path)
    found = algorithm.rectification()
    at_its_phases = found.at(start_phases(len(brief.environment.lines())))
    run = software_drifts(brief, algorithm)["coning"]
    return math.hypot(*at_its_phases) * causes.DEG_H, found.worst() * causes.DEG_H, run


@pytest.mark.parametrize("hertz", FREQUENCIES)
@pytest.mark.parametrize(
    ("state", "contender"),
    [
        ("euler", Contender("coning-compressed", 2)),
        ("dcm", Contender("coning-compressed", 1, 2)),
        ("euler", Contender("coning-combined", 2, 1)),
        ("dcm", Contender("rk4", 2)),
        ("euler", Contender("taylor2", 1)),
        ("euler", Contender("window-3-3", 1, 3, 3)),
        ("dcm", Contender("two-speed", 4)),
        ("euler", Contender("two-speed", 2)),
    ],
)
def test_a_prediction_is_that_of_a_run_at_its_phases_and_above_it_at_the_worst(
    hertz, state, contender, tmp_path
):
    predicted, worst, run = predicted_and_run(written(tmp_path, hertz, GYRO), contender, state)
    assert predicted == pytest.approx(run, rel=0.01)
    assert worst > 0.99 * run


def test_lines_at_one_frequency_depend_on_how_they_begin(tmp_path):
    predicted, worst, run = predicted_and_run(
        written(tmp_path, ("20", "20")), Contender("coning-compressed", 2), "euler"
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
