"""Reports what `check` has shown of a step, and of a user's function in C or C++."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from strapgen.firmware.check_code.check_foreign import ForeignOutcome
from strapgen.firmware.check_code.conformance import Finding
from strapgen.results.report import Report, flat_table
from strapgen.results.table import Column, TextTable

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


def outcome_report(outcome: ForeignOutcome, function: str) -> Report:
    """Return what the check of a function has shown as a report."""
    checks = [
        {"name": finding.name, "holds": finding.holds, "value": finding.measured}
        for finding in outcome.findings
    ]

    def text() -> str:
        lines = [f"{outcome.file}: {function}", "", *map(finding_text, outcome.findings)]
        return "\n".join([*lines, *(["", f"likely cause: {outcome.cause}"] if outcome.cause else [])])

    def data() -> dict[str, Any]:
        return {
            "file": outcome.file,
            "holds": outcome.holds,
            "order": outcome.order,
            "drift_deg_h": outcome.drift_deg_h,
            "closed_form_deg_h": outcome.closed_form_deg_h,
            "cause": outcome.cause,
            "checks": checks,
            "drift_by_axis_deg_h": outcome.drift_by_axis_deg_h,
            "coefficients": [asdict(coefficient) for coefficient in outcome.coefficients],
            "coefficient_ratio": outcome.coefficient_ratio,
        }

    return Report(text, data, lambda: flat_table(checks))
