"""The page of HTML of ``strapgen check --report``."""

from __future__ import annotations

from strapgen.firmware.check_code.check_foreign import ForeignResult
from strapgen.ir.version import VERSION
from strapgen.report.page import PageCell, page_of

#: Part of a drift about an axis that is none.
_NO_PART = 1e-4
_WORDS = {True: ("holds", "good"), False: ("fails", "bad"), None: ("–", "note")}


def check_page(result: ForeignResult, command: str) -> str:
    """Return the findings on a user's function as HTML."""
    sections = {
        **({"cause": "Likely cause"} if result.cause else {}),
        "checks": "Checks",
        **({"coefficients": "Coefficients of coning"} if result.coefficients else {}),
        **({"replacement": "Generated code that corrects coning"} if result.replacement else {}),
    }
    rows = [
        [
            PageCell(_WORDS[finding.holds][0], mark=_WORDS[finding.holds][1]),
            PageCell(finding.name),
            PageCell(finding.text),
            *(
                PageCell("" if value is None else format(value, ".3g"))
                for value in (finding.measured, finding.allowed)
            ),
        ]
        for finding in result.findings
    ]
    return page_of(
        "check.html.j2",
        result=result,
        command=command,
        sections=sections,
        failed=sum(finding.holds is False for finding in result.findings),
        facts=[*_facts(result)],
        rows=rows,
        version=VERSION,
    )


def _facts(result: ForeignResult) -> list[tuple[str, str, str]]:
    """Return the figures at the head of the page: name, value, and what it is."""
    facts = []
    if result.order is not None:
        facts.append(("order", f"{result.order:.2f}", "observed on a ladder of steps"))
    if result.drift_deg_h is not None and result.drift_axes_deg_h is not None:
        least = _NO_PART * result.drift_deg_h
        axes = ", ".join(f"{part:.3g}" if abs(part) > least else "0" for part in result.drift_axes_deg_h)
        facts.append(("drift on the cone", f"{result.drift_deg_h:.4g} deg/h", f"{axes} about x, y, z"))
    if result.closed_form_deg_h is not None:
        of = "of a published correction on the same samples"
        facts.append(("closed form", f"{result.closed_form_deg_h:.4g} deg/h", of))
    return facts
