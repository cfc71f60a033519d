"""What redundancy management makes of failing sensors, as a result and drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from strapgen.navigation.redundancy.parity_equations import SensorSet
from strapgen.navigation.redundancy.redundancy_study import Outcomes, SensorErrors
from strapgen.results import figures
from strapgen.results.records import INTERNAL, entry, properties, reader_table
from strapgen.results.result import Result

_KEYS = (
    *("removed", "size", "detected", "undetected", "false_alarms", "isolated", "wrong", "selected"),
    *("table_isolated", "table_wrong", "table_selected"),
)


@dataclass(frozen=True)
class RedundancyResult(Result):
    """What redundancy management makes of failing sensors."""

    computed = properties(name=entry())
    drawn_by = f"{__name__}:redundancy_image"

    sensors: SensorSet = field(metadata=INTERNAL)
    errors: SensorErrors
    outcomes: Sequence[Outcomes] = field(metadata=entry(key="rows"))

    @property
    def name(self) -> str:
        """Name of the set of sensors."""
        return self.sensors.name

    def rows(self) -> list[dict[str, Any]]:
        """Return the counts of each step."""
        return [{key: getattr(row, key) for key in _KEYS} for row in self.outcomes]

    def text(self) -> str:
        """Return the counts as a table."""
        head = (
            f"{self.name}: {self.outcomes[0].trials} trials in every row; size of the failure in trip levels of "
            "equations of length 1;\nselected: a triad without the failing sensor\n"
        )
        return f"{head}\n{reader_table(self.outcomes, Outcomes, *_KEYS).as_text()}"


def redundancy_image(result: RedundancyResult, path: str | Path) -> bytes:
    """Return the shares of detected and isolated failures against their size, a panel for each number removed."""
    groups: dict[int, list[Outcomes]] = {}
    for row in result.outcomes:
        groups.setdefault(row.removed, []).append(row)
    figure, grid = figures.grid_of_axes(1, len(groups), (2.0 + 3.6 * len(groups), 4.2), sharey=True)
    for axes, (removed, group) in zip(grid[0], groups.items(), strict=True):
        _draw(axes, group)
        axes.set_title(f"sensors removed before: {removed}", loc="left", fontsize=10)
        axes.set_xlabel("failure, trip levels")
    grid[0][0].set_ylabel("share of the trials")
    figures.common_legend(figure, list(grid[0]), loc="outside right center")
    figures.title(figure, f"{result.name}: what becomes of a failure of one more sensor")
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
