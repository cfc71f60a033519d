"""Reports and draws what redundancy management makes of failing sensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from strapgen.navigation.redundancy.parity_equations import SensorSet
from strapgen.navigation.redundancy.redundancy_study import Outcomes, SensorErrors
from strapgen.results import figures
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable

_COLUMNS = (
    Column("removed"),
    Column("size", spec=".3g"),
    Column("detected", group="equations"),
    Column("undetected", group="equations"),
    Column("false_alarms", group="equations"),
    *(
        Column(header, group=group)
        for group in ("rule", "tables")
        for header in ("isolated", "wrong", "selected")
    ),
)
_KEYS = (
    *("removed", "size", "detected", "undetected", "false_alarms", "isolated", "wrong", "selected"),
    *("table_isolated", "table_wrong", "table_selected"),
)


def redundancy_report(sensors: SensorSet, errors: SensorErrors, rows: Sequence[Outcomes]) -> Report:
    """Return the study as a report."""
    counts = [asdict(row) | {"undetected": row.undetected, "false_alarms": row.false_alarms} for row in rows]
    values = [[row[key] for key in _KEYS] for row in counts]
    head = (
        f"{sensors.name}: {rows[0].trials} trials in every row; size of the failure in trip levels of equations of "
        "length 1;\nselected: a triad without the failing sensor\n"
    )
    return Report(
        lambda: f"{head}\n{TextTable(_COLUMNS, values).as_text()}\n",
        lambda: {"name": sensors.name, "errors": asdict(errors), "rows": counts},
        lambda: TextTable([Column(key, spec=".6g") for key in _KEYS], values),
    )


def redundancy_image(sensors: SensorSet, rows: Sequence[Outcomes], path: str | Path) -> bytes:
    """Return the shares of detected and isolated failures against their size, a panel for each number removed."""
    groups: dict[int, list[Outcomes]] = {}
    for row in rows:
        groups.setdefault(row.removed, []).append(row)
    figure, grid = figures.grid_of_axes(1, len(groups), (2.0 + 3.6 * len(groups), 4.2), sharey=True)
    for axes, (removed, group) in zip(grid[0], groups.items(), strict=True):
        _draw(axes, group)
        axes.set_title(f"sensors removed before: {removed}", loc="left", fontsize=10)
        axes.set_xlabel("failure, trip levels")
    grid[0][0].set_ylabel("share of the trials")
    figures.common_legend(figure, list(grid[0]), loc="outside right center")
    figures.title(figure, f"{sensors.name}: what becomes of a failure of one more sensor")
    return figures.image(figure, path)


def _draw(axes: Any, group: Sequence[Outcomes]) -> None:
    sizes = [row.size for row in group]
    lines = (
        ("an equation fails", "detected", "-"),
        ("isolated by the rule", "isolated", "-"),
        ("isolated by the tables", "table_isolated", ":"),
        ("another one by the tables", "table_wrong", ":"),
        ("selected without it", "selected", "--"),
    )
    for (label, key, line), colour in zip(lines, figures.several_colours(len(lines)), strict=True):
        shares = [getattr(row, key) / row.trials for row in group]
        axes.plot(sizes, shares, line, color=colour, linewidth=1.6, label=label)
    figures.style(axes)
