"""Predicted beside simulated drift, as text."""

from __future__ import annotations

from strapgen.analysis.agreement import Agreement


def agreement_text(found: Agreement) -> str:
    """Return the agreement as a table."""
    lines = [
        f"{found.kernel}, {found.motion} motion: drift in rad, simulated and predicted by {found.terms} terms",
        f"{'step, s':>12}  {'simulated':>12}  {'difference':>12}  {'relative':>9}  slope",
    ]
    slopes = ["", *(f"{slope:.2f}" for slope in found.slopes)]
    slopes += [""] * (len(found.rungs) - len(slopes))
    for rung, slope in zip(found.rungs, slopes, strict=True):
        relative = f"{rung.difference / rung.drift:.1e}" if rung.drift else "-"
        lines.append(
            f"{rung.step_s:>12.6g}  {rung.drift:>12.4e}  {rung.difference:>12.4e}  {relative:>9}  {slope}".rstrip()
        )
    return "\n".join(lines)
