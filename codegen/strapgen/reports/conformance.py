"""Reports the findings of `check` about a step as text."""

from __future__ import annotations

from strapgen.experiments.conformance import Finding
from strapgen.reports.table import Column, TextTable

_COLUMNS = (Column(align="<", least=5), Column(align="<", least=18, gap=1), Column(align="<"))


def finding_text(finding: Finding) -> str:
    """Return a finding as a line of a report."""
    words = {True: "holds", False: "FAILS", None: "-"}
    return TextTable(_COLUMNS, [(words[finding.holds], finding.name, finding.text)]).as_text("  ")
