"""Reports observed orders in every format."""

from __future__ import annotations

from collections.abc import Sequence

from strapgen.lab.converge.convergence import Convergence, Rung, labels
from strapgen.results.report import Report
from strapgen.results.table import ERROR, SECONDS, Column, TextTable

#: Algorithms side by side in a report.
_MOST_COLUMNS = 4
_COLUMNS = (
    Column("kernel", "<"),
    Column("backend", "<"),
    Column("step_s", spec=SECONDS),
    Column("error_rad", spec=ERROR),
    Column("slope", spec=".2f"),
    Column("used"),
    Column("observed_order", spec=".3f"),
    Column("predicted_order"),
    Column("label", "<"),
)


def convergence_text(outcomes: Sequence[Convergence], title: str) -> str:
    """Return outcomes as a report: the error and the local slope at every step, the observed and predicted orders."""
    lines = [title, "largest error in rad; in brackets the slope from the step before; * fitted"]
    names = labels(outcomes)
    for first in range(0, len(outcomes), _MOST_COLUMNS):
        some = slice(first, first + _MOST_COLUMNS)
        lines += ["", *_table(outcomes[some], names[some]).lines()]
    named = list(zip(names, outcomes, strict=True))
    notes = [f"{name}: {one.order}" for name, one in named if one.order is not None and one.order.limited]
    notes += [f"{name}: {one.hidden}" for name, one in named if one.hidden]
    return "\n".join([*lines, *([""] if notes else []), *notes])


def _table(outcomes: Sequence[Convergence], names: Sequence[str]) -> TextTable:
    """Return a row for every step, then the orders; cells end where the mark of a fitted error stands."""
    rows: list[list[object]] = [
        [rung.step_s, *(_cell(one.rungs[k]) for one in outcomes)] for k, rung in enumerate(outcomes[0].rungs)
    ]
    rows.append(["observed", *(None if one.observed is None else f"{one.observed:.3f} " for one in outcomes)])
    rows.append(
        ["predicted", *(None if one.predicted is None else f"{one.predicted}     " for one in outcomes)]
    )
    return TextTable([Column("step, s", spec=SECONDS), *map(Column, names)], rows)


def _cell(rung: Rung) -> str:
    if rung.error_rad is None:
        return "out of range "
    slope = "" if rung.slope is None else f" ({rung.slope:.2f})"
    return f"{rung.error_rad:{ERROR}}{slope}{'*' if rung.used else ' '}"


def convergence_report(outcomes: Sequence[Convergence], title: str) -> Report:
    """Return outcomes as a report, whose table has a row for every step of every algorithm."""
    return Report(
        lambda: convergence_text(outcomes, title),
        lambda: [
            {**one.as_dict(), "label": name} for name, one in zip(labels(outcomes), outcomes, strict=True)
        ],
        lambda: ladder_table(*outcomes),
    )


def ladder_table(*outcomes: Convergence) -> TextTable:
    """Return a table with a row for every step of every algorithm."""
    rows = [
        (
            *(one.kernel, one.backend, rung.step_s, rung.error_rad, rung.slope, rung.used),
            *(one.observed, one.predicted, name),
        )
        for name, one in zip(labels(outcomes), outcomes, strict=True)
        for rung in one.rungs
    ]
    return TextTable(_COLUMNS, rows)
