"""Reports verdicts of external tools on generated code: a list, or a page with a table for each claim."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from strapgen.evidence.collection import Verdict
from strapgen.results.records import reader_table
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable

_HEAD = """# Evidence for the standard catalogue

`make evidence-page` writes this page; `make evidence` runs all tools and compares it with what they say.

The kernels of `c_fixed/`: 32-bit fixed point for increments of up to 1/8 rad. "proved" holds for all inputs in their
ranges; "agrees" holds for the inputs that were run; "fails" says that a tool has no proof, where another has one; "not
examined" that it has no theorem for something in the code. [docs/evidence.md](../docs/evidence.md) says what each claim
means and how you repeat a proof by hand. The digest is that of the kernel's source and header without
the version of strapgen, so that a changed file shows.
"""


_VERSIONS = "## Versions"
#: From the strongest to the weakest.
_RESULTS = ("proved", "agrees", "fails", "not examined", "not installed")


@dataclass(frozen=True)
class EvidenceResult(Result):
    """Verdicts of external tools on generated code: a row for each claim, kernel and tool."""

    row: ClassVar[type | None] = Verdict

    verdicts: Sequence[Verdict]

    def rows(self) -> list[Verdict]:
        """Return the verdicts on claims that tools can examine; the text and the page name the others too."""
        return [verdict for verdict in self.verdicts if verdict.result != "not examined"]

    def reader(self) -> TextTable:
        """Return all verdicts."""
        return reader_table(self.rows(), Verdict)

    def text(self) -> str:
        """Return a table, and the remarks on it."""
        notes = [
            f"{verdict.kernel}, {verdict.claim}, {verdict.tool} {verdict.version}: {verdict.detail}"
            for verdict in self.verdicts
            if verdict.detail
        ]
        table = reader_table(self.verdicts, Verdict, "kernel", "claim", "tool", "result", "seconds")
        return "\n".join([table.as_text(), *([""] if notes else []), *notes])


def evidence_page(verdicts: Sequence[Verdict], digests: Mapping[str, str]) -> str:
    """Return the page of the standard catalogue in Markdown.

    `digests`: digest of each kernel's files.
    """
    parts = [_HEAD, "## Summary", summary(verdicts).as_markdown()]
    for promise in dict.fromkeys(_promise(verdict)[0] for verdict in verdicts):
        members = [verdict for verdict in verdicts if _promise(verdict)[0] == promise]
        parts += [f"## {promise[0].upper()}{promise[1:]}", _matrix(members).as_markdown(), *_reasons(members)]
    files = TextTable([Column("kernel", "<"), Column("digest", "<")], [[*row] for row in digests.items()])
    parts += ["## What was examined", files.as_markdown()]
    versions = dict.fromkeys(f"{verdict.tool} {verdict.version}".strip() for verdict in verdicts)
    parts += [_VERSIONS, "\n".join(f"- {version}" for version in sorted(versions))]
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


@dataclass(frozen=True)
class EvidencePage:
    """The verdicts of a page of evidence."""

    #: By the name of the function, then by the claim: a result and its tools, as in "proved, Gappa"
    results: dict[str, dict[str, str]]
    #: Digest of each kernel's files
    digests: dict[str, str]
    #: The tools, with their versions
    versions: tuple[str, ...]


def read_page(page: str) -> EvidencePage:
    """Return the content of a text from `evidence_page`.

    >>> proof = Verdict("a_w32", "no overflow: AVR", "z3", "4.16", "proved", 0.1)
    >>> read_page(evidence_page([proof], {"a_w32": "0123"})).results
    {'a_w32': {'no overflow: AVR': 'proved, z3'}}
    """
    results: dict[str, dict[str, str]] = {}
    digests: dict[str, str] = {}
    for section in page.split("\n## ")[1:]:
        title, _, text = section.partition("\n")
        rows = [re.split(r" *\| *", line.strip("| ")) for line in text.splitlines() if line.startswith("| ")]
        if not rows or rows[0][0] != "kernel":
            continue
        if rows[0][1] == "digest":
            digests |= dict(rows[2:])
            continue
        promise = f"{title[0].lower()}{title[1:]}"
        for name, *cells in rows[2:]:
            for case, cell in zip(rows[0][1:], cells, strict=True):
                if cell != "-":
                    results.setdefault(name, {})[f"{promise}: {case}"] = cell
    tools = page.partition(f"\n{_VERSIONS}")[2]
    versions = tuple(line.removeprefix("- ") for line in tools.splitlines() if line.startswith("- "))
    return EvidencePage(results, digests, versions)


def without_versions(page: str) -> str:
    """Return a page without the versions of the tools, which differ between machines where the results do not."""
    return page.partition(_VERSIONS)[0]


def summary(verdicts: Sequence[Verdict]) -> TextTable:
    """Return how many verdicts of each kind there are, by claim and tool."""
    counts: dict[tuple[str, str], Counter[str]] = {}
    for verdict in verdicts:
        counts.setdefault((verdict.claim, verdict.tool), Counter())[verdict.result] += 1
    columns = [Column("claim", "<"), Column("tool", "<"), *map(Column, _RESULTS)]
    return TextTable(
        columns,
        [[*place, *(count[result] for result in _RESULTS)] for place, count in sorted(counts.items())],
    )


def _promise(verdict: Verdict) -> tuple[str, str]:
    promise, _, case = verdict.claim.partition(": ")
    return promise, case


def _strongest(verdicts: Sequence[Verdict]) -> str:
    """Return the strongest result with its tools; a proof makes up for a failure."""
    for result in _RESULTS:
        tools = [verdict.tool for verdict in verdicts if verdict.result == result]
        if tools:
            return f"{result}, {' and '.join(dict.fromkeys(tools))}"
    return "-"


def _matrix(verdicts: Sequence[Verdict]) -> TextTable:
    cases = list(dict.fromkeys(_promise(verdict)[1] for verdict in verdicts))
    kernels = dict.fromkeys(verdict.kernel for verdict in verdicts)
    rows = [
        [
            kernel,
            *(
                _strongest([v for v in verdicts if (v.kernel, _promise(v)[1]) == (kernel, case)])
                for case in cases
            ),
        ]
        for kernel in kernels
    ]
    return TextTable([Column("kernel", "<"), *(Column(case, "<") for case in cases)], rows)


def _reasons(verdicts: Sequence[Verdict]) -> list[str]:
    """Return the remarks on the results, a line for each with its kernels."""
    said: dict[str, dict[str, None]] = {}
    for verdict in verdicts:
        if verdict.detail:
            said.setdefault(f"{_promise(verdict)[1]}, {verdict.tool}: {verdict.detail}", {})[
                verdict.kernel
            ] = None
    every = {verdict.kernel for verdict in verdicts}

    def named(kernels: Collection[str]) -> str:
        return "all" if every == {*kernels} and len(every) > 1 else ", ".join(kernels)

    return ["\n".join(f"- {text} ({named(kernels)})" for text, kernels in said.items())] if said else []
