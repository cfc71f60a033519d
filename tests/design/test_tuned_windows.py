"""Filters that `design` makes for a brief's own gyro and vibration answer it; a gyro that differs is shown."""

from __future__ import annotations

from fractions import Fraction

import pytest
from tests.commands import says

from strapgen.catalogue.methods import windows
from strapgen.design.brief import read_brief
from strapgen.design.selection.candidates import contenders, window_brief
from strapgen.design.selection.judgement import in_order, judgements, verdicts
from strapgen.design.selection.simulated import confirm

#: A gyro of 40 Hz on a vibration of 0.11 deg at 18 Hz.
BRIEF = """
max_rate_deg_s = 60
vibration = { lines = [{ frequency_hz = 18, theta_x_rad = 1.92e-3, theta_y_rad = 1.92e-3, phase_rad = 1.5708 }] }
budget = { drift_deg_h = 0.005, over_s = 600, software_share = 0.1 }
processor = { word = 64, operations_per_s = 80_000 }

[gyro]
sample_hz = 100
response = { filter = "second-order", frequency_hz = 40, damping = 0.7071 }
"""


@pytest.fixture
def path(tmp_path):
    (tmp_path / "brief.toml").write_text(BRIEF)
    return tmp_path / "brief.toml"


def answered(path, methods):
    brief = read_brief(path)
    rows = judgements(path, contenders(brief, methods), jobs=1)
    return brief, confirm(brief, path, in_order(one for row in rows for one in row))


@pytest.mark.long
def test_filters_for_the_gyro_answer_where_nothing_else_does(path):
    brief, ordered = answered(path, ["tuned-window:1+5+5", "tuned-pair", "window-7-7", "coning-shaped-8"])
    first, *others = ordered
    assert first.name == "euler tuned-pair:2+7+7" and first.meets
    assert first.run_deg_h["coning"] < 5e-4 and first.drift_deg_h["coning"] < 5e-4
    assert first.run_deg_h["coning"] == pytest.approx(first.drift_deg_h["coning"], rel=0.1)
    assert [one.method for one in others if one.meets] == ["tuned-pair"] * 3 + ["tuned-window"] * 2
    assert all(one.binding == "coning" for one in others if not one.method.startswith("tuned"))
    assert "one of 1% higher frequencies leaves 0.0" in first.fragile
    assert any(sentence.endswith("deg/h") and "fragile" in sentence for sentence in verdicts(brief, ordered))


@pytest.mark.long
def test_its_code_is_generated_with_its_filters(path, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    status, _, error = says("design brief.toml --method tuned-window:1+5+5 --generate out", capsys)
    assert status == 0, error
    window = windows.read("out/coefficients.toml")  # whose conditions it verifies
    assert (window.previous, window.ahead, len(window.one_sided)) == (5, 5, 10)
    assert window.gyro == read_brief(path).gyro.seen
    assert (
        (tmp_path / "out" / "design.txt").read_text().startswith("Euler tuned-window:1+5+5 is the cheapest")
    )
    assert [*(tmp_path / "out").glob("*.c")]


def test_a_brief_gives_the_filters_their_band_noise_and_taps(path):
    brief = read_brief(path)
    (candidate,) = contenders(brief, ["tuned-window:1+7+7"])
    wanted = window_brief(brief, candidate)
    assert float(wanted.band) == pytest.approx(1.05 * 2 * 3.14159265 * 0.18, rel=1e-4)
    assert (wanted.gyro, wanted.noise, wanted.conditions) == (brief.gyro.seen, Fraction(1, 10**9), 4)
    assert window_brief(brief, contenders(brief, ["tuned-pair:1+8+8"])[0]).gyro == brief.gyro.seen
    text = BRIEF.replace("response =", "noise_deg_sqrt_h = 0.6\npulse_arcsec = 3 # response =")
    path.write_text(text)
    brief = read_brief(path)
    several = {one.name: window_brief(brief, one) for one in contenders(brief, ["tuned-pair"])}
    assert {name: one.taps for name, one in several.items()} == {
        "tuned-pair:1+8+8": (8, 6),
        "tuned-pair:2+7+7": (8, 7),
    }
    # 0.6/60/10 deg of random walk and 3/sqrt(12) arc seconds of pulses, by 0.6 deg in an interval.
    assert float(several["tuned-pair:1+8+8"].noise) == pytest.approx(
        (1e-6 + 1 / (12 * 1200**2)) ** 0.5 / 0.6, rel=1e-3
    )


@pytest.mark.parametrize("change", [("frequency_hz = 18", "frequency_hz = 40"), ("vibration", "# vibration")])
def test_no_filters_are_offered_without_a_band(path, change):
    path.write_text(BRIEF.replace(*change))
    assert not [one for one in contenders(read_brief(path)) if one.method in ("tuned-window", "tuned-pair")]
