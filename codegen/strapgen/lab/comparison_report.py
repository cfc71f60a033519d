"""The comparison of back ends as a result."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from strapgen.lab.comparison import Comparison
from strapgen.results import figures
from strapgen.results.records import reader_table
from strapgen.results.result import Result
from strapgen.results.table import TextTable

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from strapgen.lab.comparison import Comparison

#: The fields of a back end in the order of a table.
_ORDER = (
    *("backend", "max_abs_rad", "rms_rad", "bound_rad", "max_ulp", "drift_deg", "ns_per_step", "bytes"),
    "operations",
)

#: Most points of a curve; of a longer run, each point is the largest angle of a part.
_MOST_POINTS = 720
#: Characters of a line over a panel.
_WIDTH = 78
#: The largest angle that is drawn, in rad; a bound above half a turn says nothing.
_LARGEST_RAD = 4.0


@dataclass(frozen=True)
class ComparedKernel:
    """The back ends of one kernel, compared."""

    kernel: str
    #: The kernel and its run in words
    title: str
    #: One for every back end
    rows: Sequence[Comparison]
    #: Length of a step in s, which a plot needs
    step_s: float = 1.0


@dataclass(frozen=True)
class ComparisonResult(Result):
    """Back ends beside a reference: a row for each back end and kernel."""

    row: ClassVar[type | None] = Comparison
    drawn_by: ClassVar[str] = "strapgen.lab.comparison_report:comparison_image"

    kernels: Sequence[ComparedKernel]
    #: Back end with which the others are compared
    reference: str
    #: What the drift is measured from, in words
    drift: str

    def rows(self) -> Sequence[Comparison]:
        """Return the back ends of all kernels."""
        return [row for one in self.kernels for row in one.rows]

    def text(self) -> str:
        """Return a table for each kernel."""
        return "\n\n".join(map(self._text_of, self.kernels))

    def _text_of(self, one: ComparedKernel) -> str:
        lines = [
            one.title,
            f"angle from {self.reference} in rad, difference of the state in units of the last place;",
            f"{self.drift} in deg; time of a run with all states kept",
            "",
        ]
        return "\n".join([*lines, *reader_table(one.rows, Comparison, *_ORDER).lines()])

    def reader(self) -> TextTable:
        """Return all back ends as a table whose headers have the units."""
        return reader_table(self.rows(), Comparison, "kernel", *_ORDER, units=True)


def comparison_table(rows: Sequence[Comparison]) -> TextTable:
    """Return the back ends of one kernel as a table for a reader, the units in its headers."""
    return reader_table(rows, Comparison, *_ORDER, units=True)


def comparison_image(result: ComparisonResult, path: str | Path) -> bytes:
    """Return the angle of back ends from a reference over time: a panel a kernel, a line a back end.

    Dotted, in the colour of its line, is the certified bound after as many steps.
    """
    kernels, reference = result.kernels, result.reference
    columns = min(2, len(kernels))
    rows = -(-len(kernels) // columns)
    figure, grid = figures.grid_of_axes(rows, columns, (1.4 + 6.6 * columns, 0.7 + 4.4 * rows), sharey=True)
    panels, unused = list(grid.flat)[: len(kernels)], list(grid.flat)[len(kernels) :]
    panels[0].set_xlim(0, max(one.step_s * _steps(row) for one in kernels for row in one.rows))  # of all
    for axes, one in zip(panels, kernels, strict=True):
        _draw_panel(axes, one)
    for axes in unused:
        axes.set_visible(False)
    for axes in panels[-columns:]:
        axes.xaxis.set_tick_params(labelbottom=True)
        axes.set_xlabel("time, s")
    for axes in grid[:, 0]:
        axes.set_ylabel(f"angle from {figures.printable(reference)}, rad")
    bounds = any(row.history and row.history.bounds_rad for one in kernels for row in one.rows)
    dotted = "; dotted: certified bound after as many steps" if bounds else ""
    figures.title(figure, f"angle of each back end from {reference}{dotted}")
    return figures.image(figure, path)


def _draw_panel(axes: Any, compared: ComparedKernel) -> None:
    """Draw the back ends of one kernel; their names stand at the ends of their lines."""
    labels = []
    for row, colour in zip(compared.rows, figures.several_colours(len(compared.rows)), strict=True):
        labels += _draw_row(axes, row, compared.step_s, colour)
    run = figures.printable(compared.title).removeprefix(f"{compared.kernel}: ")
    title = [compared.kernel, *textwrap.wrap(run, _WIDTH)]
    axes.set_title("\n".join(title), loc="left", fontsize=10)
    if any(row.max_abs_rad for row in compared.rows):
        axes.set_yscale("log")
        if axes.get_ylim()[1] > _LARGEST_RAD:
            axes.set_ylim(top=_LARGEST_RAD)
    figures.style(axes)
    figures.labels_at_the_right(axes, labels)


def _steps(row: Comparison) -> int:
    """Return the number of steps of a run; 1 where it is not known."""
    return 1 if row.history is None else max(1, len(row.history.angles_rad) - 1)


def _draw_row(axes: Any, row: Comparison, step_s: float, colour: Any) -> list[tuple[float, str, Any]]:
    """Draw angle and bound of one back end; return the labels of both with their places."""
    if row.history is None:
        return []
    times, angles = _largest(row.history.angles_rad[1:], step_s)
    if not angles.any():
        axes.plot([], [], color=colour)
        return [(0.0, f"{row.backend}: equal", colour)]
    shown = np.where(angles > 0, angles, np.nan)
    axes.plot(times, shown, color=colour, linewidth=1.2)
    labels = [(float(angles[-1]), row.backend, colour)]
    if row.history.bounds_rad:
        steps, bounds = np.array(row.history.bounds_rad).T
        axes.plot(steps * step_s, bounds, color=colour, linewidth=1.2, linestyle=":")
        if bounds[-1] <= _LARGEST_RAD:
            labels.append((float(bounds[-1]), f"{row.backend}, certified", colour))
    return labels


def _largest(angles: NDArray[np.float64], step_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times and angles of a curve: of every step, or the largest of each part of a long run."""
    parts = np.array_split(np.arange(len(angles)), min(_MOST_POINTS, max(1, len(angles))))
    ends = np.array([part[-1] + 1 for part in parts if part.size], np.float64) * step_s
    return ends, np.array([angles[part].max() for part in parts if part.size])
