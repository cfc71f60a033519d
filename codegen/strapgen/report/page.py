"""Writes a page of HTML that holds all it shows: styles, scripts and data, and nothing from elsewhere."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

from strapgen.report.content import Content
from strapgen.storage import resources
from strapgen.thesis.thesis_tables import ORDERS

if TYPE_CHECKING:
    import jinja2


@cache
def _environment() -> jinja2.Environment:
    """Return the environment of the templates, which writes all text so that none of it is markup."""
    import jinja2

    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(resources.folder("templates") / "html_report"),
        undefined=jinja2.StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def report_page(content: Content, versions: Mapping[str, str], digest: str) -> str:
    """Return a page as HTML."""
    sections = {
        **({"steps": "Attitude steps", "drift": "Drift over time"} if content.steps else {}),
        **({"convergence": "Convergence", "backends": "Back ends compared"} if content.steps else {}),
        **({"frontier": "Accuracy against cost"} if content.standings else {}),
        **({"thesis": "Tables of the thesis"} if content.tables else {}),
        "evidence": "Evidence",
        "algorithms": "Formulas, formats, code",
        "versions": "Versions",
    }
    parts = {name: _text(name) for name in ("page.css", "charts.js", "page.js")}
    text = (
        _environment()
        .get_template("page.html.j2")
        .render(
            content=content,
            sections=sections,
            versions=versions,
            digest=digest,
            orders=ORDERS,
            css=parts["page.css"],
            javascript=parts["charts.js"] + parts["page.js"],
            data=embedded(content.data()),
        )
    )
    return text.lstrip()


def _text(name: str) -> str:
    return (resources.folder("templates") / "html_report" / name).read_text(encoding="utf-8")


def embedded(data: Any) -> str:
    r"""Return data as JSON that can stand in an element of a page.

    A number that JSON does not have becomes null; no tag can begin in it.

    >>> print(embedded({"a": "</script>", "b": float("nan")}))
    {"a":"\u003c/script>","b":null}
    """
    return json.dumps(_finite(data), allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _finite(data: Any) -> Any:
    """Return data with None in place of numbers that are not finite."""
    if isinstance(data, Mapping):
        return {key: _finite(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_finite(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data
