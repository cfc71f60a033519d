"""The stability of steps as a result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from strapgen.analysis.growth.growth import Stability
from strapgen.results.display.expressions import expression_latex
from strapgen.results.display.latex import equations
from strapgen.results.records import reader_table
from strapgen.results.result import Result
from strapgen.results.table import TextTable


@dataclass(frozen=True)
class StabilityResult(Result):
    """The growth of states in steps at a constant rate: a row for each step."""

    rows_in = "steps"
    row = Stability
    drawn_by = "strapgen.analysis.growth.growth_plot:stability_image"

    steps: Sequence[Stability]

    def table(self) -> TextTable:
        """Return the steps as a table."""
        return reader_table(self.steps, Stability, "kernel", "contractive", "stretch_squared")

    def latex(self) -> str:
        """Return the squares of the stretches."""
        return stability_latex(self.steps)


def stability_latex(stabilities: Sequence[Stability]) -> str:
    r"""Return the squares of the stretches \rho of steps as functions of the angle x of a step in rad."""
    return equations(
        (rf"\rho_{{\mathrm{{{one.kernel}}}}}^{{2}}", expression_latex(one.stretch_squared))
        for one in stabilities
    )
