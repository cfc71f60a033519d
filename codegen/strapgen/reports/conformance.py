"""Findings about a step, as text."""

from __future__ import annotations

from strapgen.experiments.conformance import Finding


def finding_text(finding: Finding) -> str:
    """Return a finding as a line of a report."""
    words = {True: "holds", False: "FAILS", None: "-"}
    return f"  {words[finding.holds]:<6}{finding.name:<18}  {finding.text}"
