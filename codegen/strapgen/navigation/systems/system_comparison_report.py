"""The comparison of back ends that run a described system, as a result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from strapgen.navigation.systems.system_comparison import OutputComparison
from strapgen.results.records import reader_table
from strapgen.results.result import Result
from strapgen.results.table import TextTable


@dataclass(frozen=True)
class SystemComparisonResult(Result):
    """The outputs of a described system on several back ends: a row for each output and back end."""

    rows_in = "outputs"
    row = OutputComparison

    outputs: Sequence[OutputComparison]
    #: The system and its run in words
    title: str
    reference: str

    def reader(self) -> TextTable:
        """Return the outputs for a reader."""
        return reader_table(self.outputs, OutputComparison)

    def text(self) -> str:
        """Return the table, and why bounds are missing."""
        lines = [
            self.title,
            f"largest difference of an element from {self.reference}: over the run, where differences add up, and",
            "after one pass from equal memories, beside the certified bound of a pass",
            "",
            *self.reader().lines(),
        ]
        reasons = dict.fromkeys(
            f"no bound of {row.output}: {row.reason}"
            for row in self.outputs
            if row.one_pass is not None and row.reason
        )
        return "\n".join([*lines, *reasons])
