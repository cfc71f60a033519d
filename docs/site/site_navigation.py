"""The sections of the site, each for a reader with a purpose, and the pages in them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Section:
    """A section of the site.

    Parameters
    ----------
    title : str
        What the navigation calls it.
    landing : str
        Its first page, a path in the repository.
    invitation : str
        One sentence that says to whom the section is useful; the home page shows it.
    pages : tuple of str
        Paths of its other pages in the repository, in reading order.
    """

    title: str
    landing: str
    invitation: str
    pages: tuple[str, ...]


def _docs(*names: str) -> tuple[str, ...]:
    return tuple(f"docs/{name}.md" for name in names)


SECTIONS = (
    Section(
        "Try it",
        "docs/try.md",
        "You want to see the formula, the code and the errors of an algorithm now, without an installation.",
        (),
    ),
    Section(
        "Firmware",
        "docs/paths/firmware.md",
        "You need C for a processor, with bounds that you can sign and tests that come with it.",
        _docs(
            *(
                "rate-gyro",
                "variants",
                "fixed-point",
                "design",
                "generated-code",
                "delivery",
                "microcontrollers",
                "evidence",
            ),
            *("check-foreign-code", "redundancy", "fmu"),
        ),
    ),
    Section(
        "Recordings",
        "docs/recorded-data.md",
        "You have a log, and want its attitude and the error of it.",
        _docs("stamped-samples", "sensor-data", "certificate"),
    ),
    Section(
        "Paper",
        "docs/paths/paper.md",
        "You compare algorithms, and print their formulas, errors and orders.",
        _docs(
            *("series", "coning", "windows", "vibration", "velocity-position"),
            *("unknowns", "canonical-form", "comparison"),
        ),
    ),
    Section(
        "Extend",
        "docs/own-algorithms.md",
        "You bring a method, an algorithm, a motion or a language of your own.",
        (
            "docs/languages.md",
            "docs/frameworks.md",
            "examples/toy_target/README.md",
            "docs/architecture.md",
            "CONTRIBUTING.md",
        ),
    ),
    Section(
        "Conventions",
        "docs/conventions.md",
        "You want to know which frames, signs, units and measures of error apply.",
        (),
    ),
    Section(
        "The thesis",
        "docs/thesis.md",
        "You compare the MIT thesis that began this project, its tables and statements, with runs of today.",
        (),
    ),
    Section(
        "Navigation",
        "docs/two-speed.md",
        "You follow NATO's lectures on strapdown systems, AGARD 133 of 1984, up to a whole navigator in C.",
        _docs(
            "navigation", "filters", "preintegration", "compensation", "ahrs", "systems", "kalman", "flights"
        ),
    ),
    Section(
        "Reference",
        "docs/reference/index.md",
        "You look up a command, a Python name or an option.",
        (
            *_docs(
                "README", "command-line", "reference/commands/index", "python-api", "reference/python/index"
            ),
            *_docs("user-files"),
            *("generated/COST.md", "generated/EVIDENCE.md"),
            *("benchmarks/RESULTS.md", "benchmarks/FIXED_POINT.md", "examples"),
        ),
    ),
    Section("Glossary", "docs/glossary.md", "You met a word that you do not know.", ()),
    Section("Changelog", "CHANGELOG.md", "You want to know what a release brings.", ()),
)

#: What the first page of the reference says: where each kind of fact is.
MAP = """# Reference

| you look up | it is in |
|---|---|
| a command with its options | [Commands](commands/index.md); at work in [the command line](../command-line.md) |
| a Python name with its arguments | [Python](python/index.md); at work in [the Python API](../python-api.md) |
| a key of a TOML file that you write | [Files that you write](../user-files.md) |
| a key of JSON that a command prints | [the schemas](../schemas), or `strapgen schema NAME` |
| an error code, a macro or a comment of generated C | [Review generated C](../generated-code.md) |
| a frame, a unit, a sign, an order of elements | [Conventions](../conventions.md) |
| a term | [Glossary](../glossary.md) |
| what a kernel of the catalogue costs | [COST.md](../../generated/COST.md) |
| what independent tools say of its C | [EVIDENCE.md](../../generated/EVIDENCE.md) |
| the page that answers a question | [Documentation by question](../README.md) |
"""

#: Pages that a step of the build writes; all others are files of the repository.
GENERATED = ("docs/reference/index.md", "docs/reference/commands/index.md", "docs/reference/python/index.md")


def document(path: str) -> str:
    """Return the name that a page, a file or a folder of the repository has on the site, without its suffix.

    Parameters
    ----------
    path : str
        Path from the root of the repository, with forward slashes.
    """
    names = {"README.md": "index", "docs/README.md": "questions"}
    if path in names:
        return names[path]
    if path in ("CHANGELOG.md", "CONTRIBUTING.md"):
        return path.removesuffix(".md").lower()
    if path.startswith("docs/") and path.endswith(".md"):
        return path.removeprefix("docs/").removesuffix(".md")
    return f"repository/{path.removesuffix('.md')}"


def site_file(path: str) -> str:
    """Return the file that Sphinx reads for a page, a file or a folder of the repository.

    Parameters
    ----------
    path : str
        Path from the root of the repository, with forward slashes.
    """
    return f"{document(path)}.{'rst' if path.startswith('docs/reference/python/') else 'md'}"


def pages_present(root: Path, section: Section) -> tuple[str, ...]:
    """Return the pages of a section that the repository has or the build writes.

    Parameters
    ----------
    root : Path
        The root of the repository.
    section : Section
        The section.
    """
    return tuple(page for page in section.pages if page in GENERATED or (root / page).exists())


def questions(root: Path) -> dict[str, str]:
    """Return the question that a page answers, by its path, as docs/README.md asks it.

    Parameters
    ----------
    root : Path
        The root of the repository.
    """
    rows = re.findall(
        r"^\| (.*?) \| \[[^]]*\]\(([^)#]+)\)", (root / "docs/README.md").read_text(), re.MULTILINE
    )
    found: dict[str, str] = {}
    for question, target in rows:
        path = (root / "docs" / target).resolve().relative_to(root.resolve()).as_posix()
        found.setdefault(path, question)
    return found
