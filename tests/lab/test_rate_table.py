"""The rate-table test of 1984."""

from __future__ import annotations

import math

import numpy as np
import pytest

from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.navigation.rate_table import MOTIONS, RateTableResult, angles, stress


def test_both_motions_pass_the_vertical():
    """About (1, 1, 1) the body's x axis comes to point straight up after a third of a turn, or two."""
    for motion in MOTIONS:
        turned = angles(motion, np.linspace(0, 60, 60001)) * math.sqrt(3)
        third = 2 * math.pi / 3
        assert np.abs(turned[:, 0] - third).min() < 2e-3
    rows = list(stress(20, backends=["numpy"], algorithms=["euler"]))
    for motion in MOTIONS:  # a record a second: not every run is looked at where it is steepest
        assert max(row.pitch_deg for row in rows if row.motion == motion) > 85


@pytest.mark.long
@pytest.mark.parametrize("backend", ["numpy", "c", pytest.param("c-fixed32", marks=pytest.mark.long)])
def test_orders_are_in_order(backend):
    """Each order of the thesis is better than the one before, and exponentials have rounding alone."""
    rows = list(stress(20, backends=[backend], algorithms=["euler"]))
    for motion in MOTIONS:
        drifts = [row.drift_deg for row in rows if row.motion == motion]
        first, second, third, fourth, magnus, coning = drifts
        assert first > second > third
        # 1e-9 deg is a thousand times what 2,000 steps in double round; 1e-4 deg that of 31 bits.
        floor = 1e-4 if backend == "c-fixed32" else 1e-9
        assert third > fourth or third < floor
        assert magnus < floor
        assert coning < floor


@pytest.mark.long
def test_residuals_carried_on_are_better_than_rounded_away():
    """On 16 bits, where rounding is all that is lost; over the hour rounding adds up, residuals do not."""
    carried, rounded = (
        [
            row.drift_deg
            for row in stress(
                60, backends=["c-fixed16"], algorithms=["euler"], settings=Settings(carry=carry)
            )
            if row.algorithm == "euler-rk4-2"
        ]
        for carry in ("full", "none")
    )
    assert all(kept < lost / 4 for kept, lost in zip(carried, rounded, strict=True))


def test_two_speeds():
    rows = list(stress(4, backends=["numpy", "c"], algorithms=["two-speed"]))
    names = [(backend, f"{name} two-speed") for name in ("dcm", "euler") for backend in ("numpy", "c")]
    assert [(row.backend, row.algorithm) for row in rows] == names * 2
    assert all(row.drift_deg < 1e-9 for row in rows)
    text = RateTableResult(rows, "4", "0.01").text()
    assert "oscillating; pitch up to" in text


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"duration": 0}, "duration is 0"),
        ({"sample": "0.3"}, "record 1 is no multiple of sample|multiple"),
        ({"sample": "0.1"}, "record is 10 samples; a multiple of 4"),
        ({"backends": ["c-q7"]}, "backend 'c-q7' is not known"),
        ({"algorithms": ["bortz"]}, "algorithm 'bortz' is not known"),
    ],
)
def test_invalid_input_is_refused(arguments, says):
    with pytest.raises(InputError, match=says):
        next(stress(**({"duration": 12} | arguments)))
