"""Reports the findings of `check` about a step."""

from __future__ import annotations

from collections.abc import Sequence

from strapgen.experiments.conformance import Finding
from strapgen.reports.report import Report, flat_table
from strapgen.reports.table import Column, TextTable

_COLUMNS = (Column(align="<", least=5), Column(align="<", least=18, gap=1), Column(align="<"))


def finding_text(finding: Finding) -> str:
    """Return a finding as a line of a report."""
    words = {True: "holds", False: "FAILS", None: "-"}
    return TextTable(_COLUMNS, [(words[finding.holds], finding.name, finding.text)]).as_text("  ")


def findings_report(kernel: str, title: str, findings: Sequence[Finding]) -> Report:
    """Return all findings about a kernel as a report."""

    def text() -> str:
        return "\n".join([f"{kernel}: {title}", "", *map(finding_text, findings)])

    rows = [finding.as_dict() for finding in findings]
    holds = all(finding.holds is not False for finding in findings)
    data = {"kernel": kernel, "holds": holds, "findings": rows}
    return Report(text, lambda: data, lambda: flat_table(rows))
