"""The algorithms from which one is selected."""

from __future__ import annotations

from pathlib import Path

from strapgen.catalogue import METHODS
from strapgen.design.brief import read_brief
from strapgen.design.selection.candidates import contenders

BRIEF = read_brief(Path(__file__).resolve().parents[2] / "examples" / "briefs" / "ahrs.toml")


def test_all_methods_of_the_catalogue_are_tried_but_the_reference_and_long_series():
    """The fit of an exact rotation is what others are held to; a ninth order of a series is below rounding."""
    methods = {one.method for one in contenders(BRIEF)}
    long_series = {f"taylor{order}" for order in range(9, 100)} & {*METHODS}
    assert long_series and "fit-exact" in METHODS
    assert methods & {*METHODS} == {*METHODS} - long_series - {"fit-exact"}
