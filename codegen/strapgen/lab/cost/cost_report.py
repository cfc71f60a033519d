"""What kernels cost on microcontrollers as a result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from strapgen.lab.cost.cost import Cost
from strapgen.results.records import reader_table
from strapgen.results.result import Result
from strapgen.results.table import TextTable

#: What stands above the table of the standard catalogue.
_HEAD = """# What the standard catalogue costs

Written by `strapgen cost --all --format markdown --out generated/COST.md`.

The kernels of `c_fixed/`, 32-bit fixed point for increments of up to 1/8 rad: all of them on a Cortex-M3, the steps of
fourth order on every processor. None of the processors is given a floating-point unit. `executed` are the instructions
of one call under QEMU, from the entry of the function to its return, for input inside its range; `stack` is that of the
function and of the deepest function of its file that it calls.
"""


@dataclass(frozen=True)
class CostResult(Result):
    """What kernels cost on microcontrollers: a row for each kernel and processor."""

    rows_in = "costs"
    row = Cost

    costs: Sequence[Cost]
    #: Whether they are all of the standard catalogue, which is a page in Markdown
    of_catalogue: bool = False

    def table(self) -> TextTable:
        """Return the numbers without the compiler."""
        return reader_table(self.costs, Cost)

    def text(self) -> str:
        """Return the table, and the compilers."""
        return (
            f"{self.table().as_text()}\n\n"
            "executed: instructions of one call, for input inside its range\n"
            f"{self._compilers()}"
        )

    def written(self, format: str) -> str:
        """Return the result in a format; the catalogue is a page in Markdown."""
        text = super().written(format)
        page = self.of_catalogue and format == "markdown"
        return f"{_HEAD}\n{text}\n\n{self._compilers()}" if page else text

    def _compilers(self) -> str:
        return "\n".join(dict.fromkeys(f"compiled by {cost.compiler} -O2" for cost in self.costs))
