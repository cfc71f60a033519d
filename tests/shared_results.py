"""What tests of commands share: analyses that several commands show, images without a costly layout, one process.

A module of tests takes it all with ``from shared_results import shared_results``.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from fractions import Fraction
from functools import cache, wraps
from pathlib import Path
from typing import Any

import pytest

from strapgen.analysis import error_analysis, growth, overview, ratios
from strapgen.analysis.series import constant_rate, error_rate, series
from strapgen.analysis.unknowns.unknown_tableau import UnknownTableau
from strapgen.design import coning_design, family, window_report
from strapgen.design import coning_report as coning_reports
from strapgen.ir.fixed_settings import Settings
from strapgen.results import figures
from strapgen.thesis import predicted_tables, thesis_statements, thesis_tables

#: Modules that analyse, and the pure functions of a choice, a motion and a number of terms that they call.
ANALYSES = (error_analysis, overview, ratios)
ONCE = {
    "accumulate": cache(error_rate.accumulate),
    "constant_rate": cache(constant_rate.constant_rate),
    "growth": cache(growth.growth),
    "series": cache(series.series),
}


def _once(function: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """Let a function of one argument return what it returned before; arguments that have no hash it computes again."""
    known: dict[Any, Any] = {}

    @wraps(function)
    def call(argument: Any) -> Any:
        try:
            there = argument in known
        except TypeError:
            return function(argument)
        if not there:
            known[argument] = function(argument)
        return known[argument]

    return call


_coefficients, _filters, _window_result = (
    _once(coning_design.design),
    _once(family.design),
    cache(window_report.WindowResult.of),
)
_figures = _once(coning_reports.ShapedDrift.figures)
_draw, _entries = figures.image, thesis_tables.entries
_predicted, _claims = predicted_tables.predicted, ratios.claims
_statements, _solve = thesis_statements.statements, cache(UnknownTableau.solve)


@cache
def _predicted_once() -> tuple[predicted_tables.PredictedEntry, ...]:
    """Predict the last table; tests/experiments predicts all."""
    return tuple(_predicted(thesis_tables.TABLES[-1:]))


@cache
def _statements_once() -> tuple[thesis_statements.Statement, ...]:
    return tuple(_statements())


@cache
def _claims_once() -> tuple[ratios.Claim, ...]:
    return tuple(_claims())


@cache
def _table(
    number: int, backend_name: str, settings: Settings | None, interval: Fraction
) -> tuple[thesis_tables.TableEntry, ...]:
    (table,) = (table for table in thesis_tables.TABLES if table.number == number)
    return tuple(_entries(table, backend_name, settings, interval))


def _entries_once(
    table: thesis_tables.Table,
    backend_name: str,
    settings: Settings | None = None,
    interval: Fraction = thesis_tables.INTERVAL,
) -> tuple[thesis_tables.TableEntry, ...]:
    return _table(table.number, backend_name, settings, interval)


def _image(figure: Any, path: str | Path) -> bytes:
    """Draw a figure once, as its axes stand; tests/reports draws with the layout that users get."""
    figure.set_layout_engine("none")
    return _draw(figure, path)


@pytest.fixture(autouse=True)
def shared_results(monkeypatch: pytest.MonkeyPatch) -> None:
    """Analyse a step once in a process, run a table of the thesis once, and leave the layout of images out.

    The cases of a study run in this process where a command does not say in how many: what they derive is here for
    the next command. tests/support and tests/experiments run them in several.
    """
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    for module in ANALYSES:
        for name, function in ONCE.items():
            if hasattr(module, name):
                monkeypatch.setattr(module, name, function)
    monkeypatch.setattr(thesis_tables, "entries", _entries_once)
    monkeypatch.setattr(predicted_tables, "predicted", _predicted_once)
    monkeypatch.setattr(ratios, "claims", _claims_once)
    monkeypatch.setattr(thesis_statements, "statements", _statements_once)
    monkeypatch.setattr(coning_design, "design", _coefficients)
    monkeypatch.setattr(family, "design", _filters)
    monkeypatch.setattr(coning_reports.ShapedDrift, "figures", lambda drift: dict(_figures(drift)))
    monkeypatch.setattr(window_report.WindowResult, "of", staticmethod(_window_result))
    monkeypatch.setattr(UnknownTableau, "solve", lambda self, equations="general": _solve(self, equations))
    monkeypatch.setattr(figures, "image", _image)
