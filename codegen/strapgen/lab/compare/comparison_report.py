"""The comparison of back ends as a result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from strapgen.lab.compare.comparison import Comparison
from strapgen.results.records import reader_table
from strapgen.results.result import Result
from strapgen.results.table import TextTable

#: The fields of a back end in the order of a table.
_ORDER = (
    *("backend", "max_abs_rad", "rms_rad", "bound_rad", "max_ulp", "drift_deg", "ns_per_step", "bytes"),
    "operations",
)


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

    row = Comparison
    drawn_by = "strapgen.lab.compare.comparison_plot:comparison_image"

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
