"""Several algorithms along one recording: their spread, beside their errors on a cone and the noise that is put in."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from strapgen import backend, choose, motion, simulate
from strapgen.cli import main
from strapgen.ir.exceptions import InputError
from strapgen.lab.attitude_spread import spread
from strapgen.lab.recordings.recording import Recording
from strapgen.lab.runs import angles

CONE = motion("cone", half_angle_deg=1, frequency_hz=10)
STEP, SECONDS = 0.02, 20
#: Angle random walk in deg/sqrt(h).
WALK = 0.2


def cone(rest: float = 0.0) -> Recording:
    """The increments of a cone, two a step, after a rest with noise."""
    samples = CONE.samples(0.01, 0, round(SECONDS / 0.01))
    noise = np.random.default_rng(1).normal(
        0, math.radians(WALK) / 60 * math.sqrt(0.01), (round(rest / 0.01), 3)
    )
    return Recording(0.0, 0.01, np.concatenate([noise, samples]))


def test_spread_on_a_cone_is_that_of_the_errors():
    """The exact attitude of the cone tells the error of each; one of them has hardly any."""
    methods = ("rk4", "coning-compressed")
    result = spread([choose("euler", method, 2) for method in methods], cone())
    errors = [
        math.degrees(angles(simulate(backend("euler", method, 2), CONE, "0.02", SECONDS))[-1])
        for method in methods
    ]
    assert result.spread_end_deg == pytest.approx(errors[0] - errors[1], rel=0.02)
    assert result.algorithms[0].largest_deg == 0
    assert result.algorithms[1].end_deg == pytest.approx(result.spread_end_deg, rel=1e-9)
    assert result.noise_deg is None and "no rest tells the noise" in result.text()


def test_steps_of_other_lengths_are_compared_at_common_times():
    """Two and three increments a step meet every six; a window begins later."""
    choices = [
        choose("euler", "rk4", 2),
        choose("dcm", "coning-compressed", 3),
        choose("euler", "window-3-3"),
    ]
    time = np.arange(300)[:, None] * 0.01
    result = spread(choices, Recording(0.0, 0.01, np.sin(time * (1, 2, 3) + (0, 1, 2)) * 0.02))
    assert np.allclose(np.diff(result.time), 0.06)
    assert result.spread_deg < 1e-3


def test_worth_is_beside_the_noise():
    result = spread([choose("euler", "rk4", 2), choose("euler", "coning-compressed", 2)], cone(rest=20))
    np.testing.assert_allclose(result.noise_deg_sqrt_h, WALK, rtol=0.4)
    total = math.sqrt(40 / 3600) * np.linalg.norm(result.noise_deg_sqrt_h)
    assert result.noise_deg == pytest.approx(total)
    part = 100 * (1 - total / math.hypot(total, result.spread_end_deg))
    assert f"takes off at most {part:.2g} % of both" in result.text()
    stated = spread([choose("euler", "rk4", 2), choose("dcm", "rk4", 2)], cone(), noise_deg_sqrt_h=3)
    assert stated.noise_deg == pytest.approx(3 * math.sqrt(3 * SECONDS / 3600))


def test_pieces_are_refused():
    pieces = Recording(0.0, 0.01, np.zeros((100, 3)), breaks=((50, 0.7),))
    with pytest.raises(InputError, match=r"^the recording is split into pieces"):
        spread([choose("euler"), choose("dcm")], pieces)


LOG = ["--recording", str(Path(__file__).parents[1] / "data" / "increments.csv")]


def run(arguments: list[str], capsys) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as stop:
        main(["compare", *arguments])
    return int(stop.value.code or 0), *capsys.readouterr()


def test_command_compares_all_methods_of_all_algorithms(capsys, tmp_path):
    plot = tmp_path / "spread.svg"
    arguments = ["euler,dcm", "--method", "rk2,rk4", *LOG, "--plot", str(plot), "--format", "json"]
    status, out, _ = run(arguments, capsys)
    names = [one["kernel"] for one in json.loads(out)["algorithms"]]
    assert (status, names) == (0, ["euler-rk2-2", "euler-rk4-2", "dcm-rk2-2", "dcm-rk4-2"])
    assert b"angle from euler-rk2-2" in plot.read_bytes()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ["euler,dcm", "--motion", "constant", "--set", "z_deg_s=1", "--step", "1", "--duration", "2"],
            "--motion does",
        ),
        (["euler,dcm", *LOG, "--backend", "c-fixed32"], "--backend c-fixed32 does not go"),
        (["euler,dcm", *LOG, "--backend", "numpy,c"], "--backend numpy,c does not go"),
        (["euler,dcm", *LOG, "--fail-above", "1"], "--fail-above does not go"),
        (["euler,eler", *LOG], "'eler' is not known"),
        (["euler", *LOG, "--noise-deg-sqrt-h", "1"], "--noise-deg-sqrt-h goes with several algorithms"),
    ],
)
def test_refusal_is_one_line(arguments, said, capsys):
    status, out, error = run(arguments, capsys)
    assert (status, out, error.count("\n")) == (2, "", 1) and said in error
