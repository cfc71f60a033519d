"""The causes of drift: rounding with as little error feedback as meets a limit."""

from __future__ import annotations

from pathlib import Path

import pytest

from strapgen.catalogue import choose
from strapgen.design.brief import read_brief
from strapgen.design.selection import causes
from strapgen.design.selection.causes import CARRIES, Rounding
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

        monkeypatch.setattr(causes, "_certified", certified)
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
