"""The catalogue side by side."""

from __future__ import annotations

import json

import pytest
import sympy as sp

from strapgen.analysis.overview import OverviewResult, choices, methods, overview
from strapgen.catalogue import METHODS, choose
from strapgen.catalogue.methods.shaped_coning import SHAPE_TITLES
from strapgen.catalogue.methods.windows import WINDOW_TITLES


@pytest.mark.long
def test_rows():
    rows = list(overview([choose("dcm", "rk1", 1), choose("euler", "rk4", 2), choose("euler", "magnus2", 1)]))
    first, fourth, magnus = rows
    assert (first.order, first.constant_power, first.constant) == (1, 3, sp.Rational(1, 3))
    assert (fourth.constant_power, fourth.constant) == (5, sp.Rational(1, 1920))
    assert fourth.operations == 68
    assert magnus.constant is None
    assert magnus.contractive == "kept"
    # At the step where 544 operations a second do, 68 operations take 1/8 s.
    assert fourth.drift_at_equal_work_deg_h == fourth.coning_drift_deg_h
    text = OverviewResult(rows).text()
    assert "1/1920 x^5" in text
    assert "1/12 w0 x w1" in text
    data = json.loads(json.dumps([row.as_dict() for row in rows]))
    assert sp.sympify(data[1]["coning"]).free_symbols == set(sp.symbols("a b g"))


def test_the_whole_catalogue_is_offered():
    names = methods()
    assert {choice.method for choice in choices()} == set(names)
    series = {f"taylor{order}" for order in range(9, 21)} | {"fit-exact", "coning-exact-rest"}
    assert set(METHODS) - set(names) == series | set(WINDOW_TITLES) | set(SHAPE_TITLES)
