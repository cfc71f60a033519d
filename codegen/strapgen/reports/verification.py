"""Lays out what `strapgen verify` found."""

from __future__ import annotations

from typing import Any

from strapgen.experiments.verification import Verification
from strapgen.reports.report import Report


def verification_report(result: Verification) -> Report:
    """Return a verification as a report."""
    return Report(lambda: _text(result), lambda: _data(result))


def _data(result: Verification) -> dict[str, Any]:
    return {
        "file": str(result.file),
        "in_step": result.in_step,
        "differences": list(result.differences),
        "max_ulp": result.max_ulp,
        "bound_ulp": result.bound_ulp,
        "holds": result.holds,
        "calls": result.calls,
        "wrong_calls": result.wrong,
    }


def _text(result: Verification) -> str:
    lines = [*result.differences]
    lines.append(f"{result.file}: {'in step' if result.in_step else 'out of step'} with its command")
    if result.max_ulp is None:
        return "\n".join(lines)
    right = f"{result.calls - result.wrong} of {result.calls} calls return what they must"
    bound = "" if result.bound_ulp is None else f", certified {result.bound_ulp:.4f}"
    lines.append(f"{right}; error {result.max_ulp:.4f} of the last place{bound}")
    return "\n".join(lines)
