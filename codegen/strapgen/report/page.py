"""Writes a page of HTML that holds all it shows: styles, scripts and data, and nothing from elsewhere."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from strapgen.design.frontier import DriftAndCost, pareto
from strapgen.evidence.evidence_report import EvidencePage
from strapgen.lab.certificate.certificate_report import rounded_up
from strapgen.lab.certificate.largest_rounding import LargestRounding
from strapgen.report.algorithm_view import (
    AlgorithmView,
    CommandResult,
    of_algorithm,
    of_frontier,
    of_tables,
    view,
)
from strapgen.report.dossier import AlgorithmDossier, Conditions, candidate
from strapgen.storage import resources
from strapgen.thesis.tables_report import NAMES, repair_notes
from strapgen.thesis.thesis_tables import ALGORITHMS, ORDERS, TABLES, Table, TableEntry

if TYPE_CHECKING:
    import jinja2

#: Digits of figures in the tables of the page.
_FIGURE = ".3g"
#: Names of commands whose results compare algorithms, which stand beside those of single algorithms.
_TABLES, _FRONTIER = "tables", "frontier"
#: What stands between the sources of an algorithm.
_SOURCES = "; "


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
        **({"frontier": "Accuracy against cost"} if content.drifts_and_costs else {}),
        **({"thesis": "Tables of the thesis"} if content.tables else {}),
        "evidence": "Evidence",
        "algorithms": "Formulas, formats, code",
        "versions": "Versions",
    }
    return page_of(
        "page.html.j2",
        content=content,
        sections=sections,
        versions=versions,
        digest=digest,
        orders=ORDERS,
        javascript=_text("charts.js") + _text("page.js"),
        data=embedded(content.data()),
    )


def page_of(template: str, **what: Any) -> str:
    """Return the page of a template, in the style of all pages."""
    return _environment().get_template(template).render(css=_text("page.css"), **what).lstrip()


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


@dataclass(frozen=True)
class PageCell:
    """A cell of a table."""

    text: str
    #: What the table is sorted by; None sorts last
    value: float | str | None = None
    #: Place on the page that the text leads to
    link: str = ""
    #: "good", "bad" or "note" where the cell stands out
    mark: str = ""
    #: Text in a smaller type below
    small: str = ""


@dataclass(frozen=True)
class Content:
    """The content of a page."""

    #: Heading of the page, and the command that writes it
    title: str
    command: str
    #: Those of the runs
    conditions: Conditions
    backends: tuple[str, ...]
    algorithms: tuple[AlgorithmDossier, ...]
    #: The tables of the thesis; empty where no algorithm stands in them
    tables: tuple[TableEntry, ...]
    #: What algorithms cost and how they drift; empty where the page has no attitude step
    drifts_and_costs: tuple[DriftAndCost, ...]
    #: The methods of `drifts_and_costs`, as `frontier` takes them
    methods: tuple[str, ...]
    #: What tools said of generated code
    evidence: EvidencePage | None

    @cached_property
    def views(self) -> tuple[AlgorithmView, ...]:
        """The content of the page on each algorithm."""
        return tuple(view(known, self.evidence) for known in self.algorithms)

    @cached_property
    def results(self) -> dict[str, dict[str, CommandResult]]:
        """The results of commands: by the name of the kernel and of the command; "" for those that compare."""
        results = {known.choice.kernel: of_algorithm(known, self.conditions) for known in self.algorithms}
        compared: dict[str, CommandResult] = {}
        if self.tables:
            compared[_TABLES] = of_tables(self.tables, self.backends)
        if self.drifts_and_costs:
            compared[_FRONTIER] = of_frontier(self.drifts_and_costs, self.methods, self.conditions)
        return {"": compared, **results}

    def data(self) -> dict[str, Any]:
        """Return the embedded data: results as plain JSON data, and the data of charts."""
        return {
            "results": self.results,
            "motion": self.conditions.motion,
            "front": self.front,
            "chosen": self.chosen,
        }

    @cached_property
    def front(self) -> list[str]:
        """The algorithms that drift less than all that take fewer multiplications a sample, by these."""
        points = {
            one.name: (one.multiply / one.increments, drift)
            for one in self.drifts_and_costs
            if (drift := one.drifts[self.conditions.motion]) is not None
        }
        return pareto(points)

    @cached_property
    def chosen(self) -> dict[str, list[str]]:
        """The kernels of the page by their names among the algorithms that are compared."""
        names: dict[str, list[str]] = {}
        for known in self.algorithms:
            if (one := candidate(known.choice)) is not None:
                names.setdefault(one.name, []).append(known.choice.kernel)
        return names

    @property
    def steps(self) -> list[AlgorithmDossier]:
        """The algorithms that ran."""
        return [known for known in self.algorithms if known.runs is not None]

    def step_rows(self) -> list[list[PageCell]]:
        """Return the overview of the steps: a row for each."""
        return [self._step_row(known) for known in self.steps]

    def _step_row(self, known: AlgorithmDossier) -> list[PageCell]:
        assert known.runs is not None, "a step ran"
        data = self.results[known.choice.kernel]
        run, ladder = data["simulate"]["data"], data["converge"]["data"][0]
        drift = float(np.linalg.norm(run["drift_deg"], axis=1).max())
        rows = {row["backend"]: row for row in data["compare"]["data"]} if "compare" in data else {}
        return [
            *_costs(known),
            _figure(ladder["predicted_order"]),
            _figure(ladder["observed_order"], ".3f"),
            _figure(drift),
            *(_rounding(known.runs.certified.get(name), rows.get(name, {})) for name in self.backends),
        ]

    def kernel_rows(self) -> list[list[PageCell]]:
        """Return the overview of all kernels: a row for each."""
        return [
            [
                *_costs(known),
                self._bound(known),
                _evidence_cell(shown.evidence),
                PageCell(known.kernel.title, known.kernel.title),
            ]
            for known, shown in zip(self.algorithms, self.views, strict=True)
        ]

    def _bound(self, known: AlgorithmDossier) -> PageCell:
        """Return the error bound of the worst output in fixed point."""
        if "generate" not in (results := self.results[known.choice.kernel]):
            return PageCell("no fixed point", None, mark="note")
        return _figure(max(results["generate"]["data"]["error_bound"].values()))

    def frontier_rows(self) -> list[list[PageCell]]:
        """Return the algorithms that are compared by cost and drift: a row for each."""
        if not self.drifts_and_costs:
            return []
        rows = []
        algorithms = self.results[""][_FRONTIER]["data"]["algorithms"]
        for one in sorted(algorithms, key=lambda one: one["multiply_per_sample"]):
            name, kernels = one["algorithm"], self.chosen.get(one["algorithm"], [])
            front = name in self.front
            rows.append(
                [
                    PageCell(name, name, f"#{kernels[0]}" if kernels else "", "good" if front else ""),
                    PageCell("●" if front else "", 0 if front else 1),
                    *(_figure(one[f"{kind}_per_sample"], ".4g") for kind in ("multiply", "add", "other")),
                    _figure(one["drift_deg_h"][self.conditions.motion]),
                    PageCell(one["title"], one["title"], small=self._rest(one["source"])),
                ]
            )
        return rows

    def _rest(self, source: str) -> str:
        """Return a source without what all algorithms share."""
        return _SOURCES.join(part for part in source.split(_SOURCES) if part not in self.shared_sources)

    @cached_property
    def shared_sources(self) -> list[str]:
        """The common source of all compared algorithms."""
        first, *others = [one.source.split(_SOURCES) for one in self.drifts_and_costs] or [[]]
        return [part for part in first if all(part in parts for parts in others)] if others else []

    def thesis_tables(self) -> list[dict[str, Any]]:
        """Return the tables of the thesis with their captions and notes."""
        by_number: dict[int, list[TableEntry]] = {}
        for entry in self.tables:
            by_number.setdefault(entry.table, []).append(entry)
        return [
            _thesis_table(table, by_number[table.number]) for table in TABLES if table.number in by_number
        ]

    def facts(self) -> list[tuple[str, str, str]]:
        """Return the facts at the head of the page: a name, a value, and a remark."""
        facts = []
        if self.tables:
            first = self.tables[0].backend
            of_first = [entry.agrees for entry in self.tables if entry.backend == first]
            rest = (
                f"agree on {first}, {sum(entry.agrees for entry in self.tables)} of {len(self.tables)} on all"
            )
            facts.append(("figures of the thesis", f"{sum(of_first)} of {len(of_first)}", rest))
        results = [result.partition(",")[0] for shown in self.views for result in shown.evidence.values()]
        if results:
            others = len(results) - results.count("proved") - results.count("agrees")
            text = f"{results.count('agrees')} agree, {others} open"
            facts.append(("claims of the C proved", str(results.count("proved")), text))
        if self.front:
            facts.append(
                ("algorithms compared", str(len(self.drifts_and_costs)), f"{len(self.front)} on the front")
            )
        return facts

    def claim_rows(self) -> list[list[PageCell]]:
        """Return the verdicts of tools by claim: the number of kernels for each kind of result."""
        kinds = ("proved", "agrees", "fails", "not examined", "not installed")
        claims = dict.fromkeys(claim for shown in self.views for claim in shown.evidence)
        rows = []
        for claim in sorted(claims):
            results = [
                shown.evidence[claim].partition(",")[0] for shown in self.views if claim in shown.evidence
            ]
            counts = [results.count(kind) for kind in kinds]
            rows.append([PageCell(claim, claim), *(PageCell(str(count or "–"), count) for count in counts)])
        return rows


def _costs(known: AlgorithmDossier) -> list[PageCell]:
    """Return the name of a kernel and the operations of its program."""
    count = known.program.operations
    others = sum(n for kind, n in count.items() if kind not in ("multiply", "add", "negate"))
    name = known.choice.kernel
    return [
        PageCell(name, name, f"#{name}"),
        *(PageCell(str(number), number) for number in (count["multiply"], count["add"], others)),
    ]


def _figure(value: float | None, spec: str = _FIGURE) -> PageCell:
    """Return a number as a cell; a dash for none."""
    return PageCell("–") if value is None else PageCell(format(value, spec), value)


def _rounding(certified: LargestRounding | None, row: Mapping[str, Any]) -> PageCell:
    """Return what rounding has made of an attitude, with its radius; else the angle from the run in many digits."""
    if certified is None:
        return _figure(row.get("max_abs_rad"))
    small = f"\u00b1 {rounded_up(certified.radius)}"
    return PageCell(format(certified.angle, _FIGURE), certified.angle, small=small)


def _evidence_cell(evidence: Mapping[str, str]) -> PageCell:
    """Return the number of proved claims, and of those that agree with runs."""
    if not evidence:
        return PageCell("none on this code", None, mark="note")
    proved, agrees = (
        sum(result.startswith(kind) for result in evidence.values()) for kind in ("proved", "agrees")
    )
    rest = len(evidence) - proved - agrees
    text = f"{proved} proved, {agrees} agree" + (f", {rest} open" if rest else "")
    return PageCell(text, proved + agrees)


def _thesis_table(table: Table, entries: Iterable[TableEntry]) -> dict[str, Any]:
    """Return a table with the figures of the thesis above those of every back end.

    A row has the algorithm, what it ran on, and a cell for each order.
    """
    by_place = {(entry.algorithm, entry.backend, entry.order): entry for entry in entries}
    backends = dict.fromkeys(entry.backend for entry in by_place.values())
    rows = []
    for algorithm in ALGORITHMS:
        printed = tuple(PageCell(text, mark="note") for text in table.printed[algorithm])
        rows.append((NAMES[algorithm], "thesis", printed))
        for name in backends:
            cells = tuple(_entry_cell(by_place[algorithm, name, order]) for order in ORDERS)
            rows.append((NAMES[algorithm], name, cells))
    of = "of the same order" if table.by_order else "of first order"
    caption = f"Drift as a ratio to that of direction cosines {of}; beside it, the drift."
    notes = dict.fromkeys(entry.note for entry in by_place.values() if entry.note)
    first = [note for note in notes if note is not None][:1]
    repairs = " ".join(line.strip() for line in repair_notes(table))
    return {
        "number": table.number,
        "title": table.title,
        "caption": caption,
        "rows": rows,
        "notes": [*filter(None, [*first, repairs])],
    }


def _entry_cell(entry: TableEntry) -> PageCell:
    """Return a simulated figure, marked by whether it is that of the thesis."""
    mark = "note" if entry.roundoff_dominates else "good" if entry.agrees else "bad"
    return PageCell(f"{entry.normalised:.4g}", entry.normalised, mark=mark, small=f"{entry.drift_deg:.4g}°")
