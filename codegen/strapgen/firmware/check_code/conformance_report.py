"""What `check` has shown of a step, and of a user's function in C or C++, as results."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from strapgen.firmware.check_code.check_foreign import ForeignOutcome, MeasuredCheck, measured
from strapgen.firmware.check_code.conformance import Finding
from strapgen.results.records import INTERNAL, entry, properties
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable

_COLUMNS = (Column(align="<", least=5), Column(align="<", least=18, gap=1), Column(align="<"))


def finding_text(finding: Finding) -> str:
    """Return a finding as a line of a report."""
    words = {True: "holds", False: "FAILS", None: "-"}
    return TextTable(_COLUMNS, [(words[finding.holds], finding.name, finding.text)]).as_text("  ")


@dataclass(frozen=True)
class FindingsResult(Result):
    """What was found of an attitude step."""

    rows_in = "findings"
    computed = properties(holds=entry())

    kernel: str
    title: str = field(metadata=INTERNAL)
    findings: Sequence[Finding]

    @property
    def holds(self) -> bool:
        """Whether the step does all that is required."""
        return all(finding.holds is not False for finding in self.findings)

    def text(self) -> str:
        """Return the findings, a line each."""
        return "\n".join([f"{self.kernel}: {self.title}", "", *map(finding_text, self.findings)])


@dataclass(frozen=True)
class ForeignResult(Result):
    """What was found of a user's function."""

    outcome: ForeignOutcome = field(metadata=entry(spread=True))
    function: str = field(metadata=INTERNAL)

    def rows(self) -> Sequence[MeasuredCheck]:
        """Return the checks."""
        return measured(self.outcome.findings)

    def text(self) -> str:
        """Return the findings, a line each, and the likely cause of what fails."""
        outcome = self.outcome
        lines = [f"{outcome.file}: {self.function}", "", *map(finding_text, outcome.findings)]
        return "\n".join([*lines, *(["", f"likely cause: {outcome.cause}"] if outcome.cause else [])])
