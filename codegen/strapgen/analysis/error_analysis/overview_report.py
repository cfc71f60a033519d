"""Reports the overview of the catalogue, with one row for each algorithm and method."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from strapgen.analysis.error_analysis.overview import CONING_DEG_S, STEP_S, WORK, OverviewRow
from strapgen.results.records import reader_table
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable

#: Most terms of a vector that are written out.
_MOST_TERMS = 3
_COLUMNS = (
    *("kernel", "order", "operations", "constant_term", "coning_drift_deg_h", "drift_per_operation_rad"),
    *("drift_at_equal_work_deg_h", "contractive"),
)
_NOTES = (
    "constant       angle in rad that a step loses at a constant rate, x = |w| h; - none",
    f"coning         leading secular drift rate for a = b = g = {CONING_DEG_S:g} deg/s, step {STEP_S:g} s",
    "per operation  that drift of a step in rad, over the operations of the step",
    f"equal work     the drift rate in deg/h where the step is so long that {WORK:g} operations a second do",
    "contractive    angles x of a step at which no state grows; kept: its length is kept exactly",
)


@dataclass(frozen=True)
class OverviewResult(Result):
    """Orders, leading errors and operations side by side: a row for each algorithm and method."""

    rows_in = "algorithms"
    row = OverviewRow

    algorithms: Sequence[OverviewRow]

    def reader(self) -> TextTable:
        """Return what fits side by side."""
        return reader_table(self.algorithms, OverviewRow, *_COLUMNS)

    def text(self) -> str:
        """Return the table, what its columns mean, and the drift of a step of each algorithm."""
        drifts = [(row.kernel, _general(row)) for row in self.algorithms]
        return "\n".join(
            [
                *self.reader().lines(),
                "",
                *_NOTES,
                "",
                "drift of a step, leading term for the rate w0 + w1 t + w2 t^2/2 + ...",
                *TextTable([Column(align="<")] * 2, drifts).lines("  "),
            ]
        )


def _general(row: OverviewRow) -> str:
    terms = len(row.general.replace(" - ", " + ").split(" + "))
    return row.general if terms <= _MOST_TERMS else f"{terms} terms: strapgen series, or --format json"
