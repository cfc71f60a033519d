"""Observed orders as a result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from strapgen.lab.convergence import Convergence, StepError, labels
from strapgen.results import figures
from strapgen.results.result import Result
from strapgen.results.table import ERROR, SECONDS, Column, TextTable

if TYPE_CHECKING:
    from strapgen.lab.convergence import Convergence

_LADDER_COLUMNS = (
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
#: Algorithms side by side in a text.
_MOST_COLUMNS = 4


@dataclass(frozen=True)
class ConvergenceResult(Result):
    """Errors on a ladder of steps, with observed and predicted orders: a row for each algorithm and back end."""

    row: ClassVar[type | None] = Convergence
    drawn_by: ClassVar[str] = "strapgen.lab.convergence_report:convergence_image"

    outcomes: Sequence[Convergence]
    #: The runs in words
    title: str

    def rows(self) -> Sequence[Convergence]:
        """Return the outcomes with their labels."""
        return [
            replace(one, label=name) for one, name in zip(self.outcomes, labels(self.outcomes), strict=True)
        ]

    def table(self) -> TextTable:
        """Return a row for every step of every algorithm."""
        return ladder_table(*self.outcomes)

    def text(self) -> str:
        """Return the error and the local slope at every step, the observed and predicted orders."""
        outcomes, names = self.outcomes, labels(self.outcomes)
        lines = [self.title, "largest error in rad; in brackets the slope from the step before; * fitted"]
        for first in range(0, len(outcomes), _MOST_COLUMNS):
            some = slice(first, first + _MOST_COLUMNS)
            lines += ["", *_side_by_side(outcomes[some], names[some]).lines()]
        named = list(zip(names, outcomes, strict=True))
        notes = [f"{name}: {one.order}" for name, one in named if one.order is not None and one.order.limited]
        notes += [f"{name}: {one.hidden}" for name, one in named if one.hidden]
        return "\n".join([*lines, *([""] if notes else []), *notes])


def _side_by_side(outcomes: Sequence[Convergence], names: Sequence[str]) -> TextTable:
    """Return a row for every step, then the orders; cells end where the mark of a fitted error stands."""
    rows: list[list[object]] = [
        [rung.step_s, *(_cell(one.rungs[k]) for one in outcomes)] for k, rung in enumerate(outcomes[0].rungs)
    ]
    rows.append(["observed", *(None if one.observed is None else f"{one.observed:.3f} " for one in outcomes)])
    rows.append(
        ["predicted", *(None if one.predicted is None else f"{one.predicted}     " for one in outcomes)]
    )
    return TextTable([Column("step, s", spec=SECONDS), *map(Column, names)], rows)


def _cell(rung: StepError) -> str:
    if rung.error_rad is None:
        return "out of range "
    slope = "" if rung.slope is None else f" ({rung.slope:.2f})"
    return f"{rung.error_rad:{ERROR}}{slope}{'*' if rung.used else ' '}"


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
    return TextTable(_LADDER_COLUMNS, rows)


def convergence_image(result: ConvergenceResult, path: str | Path) -> bytes:
    """Return a plot of error against step, a line for each algorithm, with lines of the theoretical slope."""
    outcomes = result.outcomes
    figure, grid = figures.grid_of_axes(1, 1, (9.5, 5.6))
    axes = grid[0, 0]
    colours = figures.colours(len(outcomes), figures.LIGHTEST)
    for number, outcome in enumerate(outcomes):
        _draw_algorithm(axes, outcome, colours[number], "osD^v<>p"[number % 8])
    rungs = [rung for outcome in outcomes for rung in outcome.rungs]
    if any(rung.error_rad for rung in rungs):  # else all are exact: nothing to draw
        axes.set_yscale("log")
        axes.set_ylim(top=10)
    figures.step_ticks(axes, sorted({rung.step_s for rung in rungs}))
    axes.set_ylabel("largest error, rad")
    figures.style(axes)
    figures.labels_at_the_right(
        axes, [label for label in map(_label, outcomes, labels(outcomes), colours) if label is not None]
    )
    axes.set_title("slope of the filled points; dashed: theory", loc="left", fontsize=9, color="0.35")
    figures.title(figure, result.title)
    return figures.image(figure, path)


def _label(outcome: Convergence, name: str, colour: Any) -> tuple[float, str, Any] | None:
    """Return the label at the right end of a line: name, observed and theoretical order."""
    errors = [(rung.step_s, rung.error_rad) for rung in outcome.rungs if rung.error_rad]
    if not errors:
        return None
    slope = "order hidden" if outcome.observed is None else f"{outcome.observed:.2f}"
    theory = "" if outcome.predicted is None else f", theory {outcome.predicted}"
    return max(errors)[1], f"{name}: {slope}{theory}", colour


def _draw_algorithm(axes: Any, outcome: Convergence, colour: Any, marker: str) -> None:
    """Draw the errors of one algorithm, filled where the slope is fitted, and the predicted slope dashed."""
    rungs = [rung for rung in outcome.rungs if rung.error_rad]
    steps = [rung.step_s for rung in rungs]
    axes.plot(steps, [rung.error_rad for rung in rungs], color=colour, linewidth=1.2, alpha=0.6)
    for used in (True, False):
        points = [rung for rung in rungs if rung.used is used]
        axes.plot(
            [rung.step_s for rung in points],
            [rung.error_rad for rung in points],
            linestyle="none",
            marker=marker,
            markersize=5.5,
            color=colour,
            markerfacecolor=colour if used else "white",
        )
    fitted = [rung for rung in rungs if rung.used]
    if outcome.predicted is not None and fitted:
        anchor = fitted[-1]
        wide = np.array([anchor.step_s, max(steps)])
        line = (anchor.error_rad or 0.0) * (wide / anchor.step_s) ** outcome.predicted
        axes.plot(wide, line, color=colour, linewidth=0.9, linestyle="--")
