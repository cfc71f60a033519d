"""The certified angle of a slow cycle of two loops: each of its parts by hand, as far as rounding can turn."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from strapgen.design.brief import read_brief
from strapgen.ir.fixed_settings import Settings
from strapgen.navigation.two_speed.two_speed_selection import TwoSpeedLoops

BRIEF = Path(__file__).resolve().parents[2] / "examples" / "briefs" / "ahrs.toml"
CYCLES = 4
#: Outputs of the loops with their elements, and the stages that have them.
OUTPUTS = {"next_angle_sum": "fast", "next_coning": "fast", "rotation_vector": "vector", "next": "update"}
SHORTEST = 1 - float(Settings().allowance)


def angle(state: str, unit: float = 0.0, high: int = 0, **errors: tuple[float, ...]) -> float:
    """Return the angle of a slow cycle in rad, for errors of outputs, a unit of samples and their largest sum."""
    loops = TwoSpeedLoops(state, CYCLES, read_brief(BRIEF))
    sources = {
        stage: SimpleNamespace(
            fixed=SimpleNamespace(
                outputs=[
                    SimpleNamespace(signal=SimpleNamespace(name=name), errors=errors.get(name, (0.0,) * 3))
                    for name, its_stage in OUTPUTS.items()
                    if its_stage == stage
                ]
            )
        )
        for stage in ("fast", "vector", "update")
    }
    argument = SimpleNamespace(format=SimpleNamespace(unit=unit), high=high)
    loops.__dict__["fixed"] = SimpleNamespace(
        sources=sources, arguments={"gyro": argument, "fast_angle_sum": argument}
    )
    return loops._angle_of_a_cycle()


@pytest.mark.parametrize("state", ["euler", "dcm"])
def test_errors_of_the_rotation_vector_turn_by_their_length(state):
    assert angle(state, rotation_vector=(2e-6, 3e-6, 6e-6)) == pytest.approx(7e-6, rel=1e-12)
    assert angle(state, next_coning=(3e-6, 4e-6, 0.0)) == pytest.approx(CYCLES * 5e-6, rel=1e-12)
    # A sample is off by a unit, and enters the sum; in the fast cycles it turns with the sum before, 512 units long.
    unit = 2.0**-18
    samples = math.sqrt(3) * unit * (1 + 2 * CYCLES * math.sqrt(3) * 512 * unit)
    assert angle(state, unit, 512) == pytest.approx(samples, rel=1e-12)


def test_parameters_of_the_least_length_turn_by_twice_the_angle_of_an_error_across_them():
    error = (6e-4, 0.0, 0.0, 8e-4)
    assert angle("euler", next=error) == pytest.approx(2 * math.asin(1e-3 / SHORTEST), rel=1e-12)


def test_a_change_across_the_least_stretch_turns_a_matrix_by_the_bound_but_for_its_unevenness():
    """A skew change turns a matrix by its length over the root of 2; where it is uneven, others turn it further."""
    change = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 0]]) * 1e-3
    left, _, right = np.linalg.svd(np.diag([SHORTEST, SHORTEST, 1]) + change)
    rotation = left @ right
    tangent = (rotation[0, 1] - rotation[1, 0]) / (rotation[0, 0] + rotation[1, 1])
    bound = angle("dcm", next=tuple(change.ravel()))
    assert math.atan(tangent) < bound
    longest = math.sqrt(2 - SHORTEST**2)
    further = math.sqrt(1 + ((longest - SHORTEST) / (longest + SHORTEST)) ** 2)
    shortened = SHORTEST / (SHORTEST - np.linalg.norm(change))  # by the error itself
    assert bound == pytest.approx(tangent * further * shortened, rel=1e-12)


def test_words_that_are_too_short_for_a_bound_are_refused():
    with pytest.raises(ValueError, match="the words are too short for a bound"):
        angle("dcm", next=(SHORTEST / 2, 0.0, 0.0))
    with pytest.raises(ValueError, match="the sum of the increments is rounded"):
        angle("dcm", next_angle_sum=(0.0, 0.0, 1e-9))
