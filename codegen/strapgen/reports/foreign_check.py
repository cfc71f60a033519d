"""Reports what `check` has shown of a user's function in C or C++."""

from __future__ import annotations

from typing import Any

from strapgen.experiments.foreign_check import ForeignOutcome
from strapgen.reports.conformance import finding_text
from strapgen.reports.report import Report, flat_table


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
        }

    return Report(text, data, lambda: flat_table(checks))
