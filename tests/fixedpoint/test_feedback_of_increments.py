"""Error feedback of increments that go out, and of sums, with ``carry="all"``."""

from fractions import Fraction

import numpy as np
import pytest

from strapgen import catalogue
from strapgen.ir.fixed_settings import Settings
from strapgen.run import backends as run

#: A count is 5/1024 of the unit of an output in this format.
SCALE, FORMAT, UNIT = "5/1073741824", "Q-5.20", Fraction(1, 1 << 20)


def sent(backend, carry, counts):
    """Return the outputs for counts, one call after the other, in units."""
    settings = Settings(
        word=16, carry=carry, ranges={"count": Fraction(60)}, formats={"count": "Q15.0", "increment": FORMAT}
    )
    choice = catalogue.choose("angle-counts", constants={"scale": SCALE})
    evaluator = run.evaluator(choice, backend, settings)
    feedback, rows = evaluator.fresh(1), []
    for row in counts:
        (output,), feedback = evaluator.run([row[None]], feedback)
        rows.append(output[0])
    return np.array(rows, int)


@pytest.mark.parametrize("backend", ["fixed-model", "c-fixed16"])
def test_what_an_increment_loses_comes_with_the_next(backend, rng):
    counts = rng.integers(-60, 61, (300, 3)) + np.array([0, 20, -20])
    counts = counts.clip(-60, 60)
    exact = counts.cumsum(axis=0) * 5 / 1024
    assert np.abs(sent(backend, "all", counts).cumsum(axis=0) - exact).max() <= 0.5
    # Without it every increment, of less than half a unit, is rounded to zero.
    assert not sent(backend, "none", counts).any()


def test_sums_are_fed_back_too():
    names = {
        carry: [
            feedback.name
            for feedback in run.evaluator(
                "two-speed-fast-2", "fixed-model", Settings(carry=carry)
            ).interface.residuals
        ]
        for carry in ("full", "all")
    }
    assert set(names["full"]) < set(names["all"])
    assert {"residual_next_coning_x", "residual_next_eta_z"} <= set(names["all"])
