"""Copies the pages of the repository to where Sphinx reads them, with links that lead somewhere on the site."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Callable
from pathlib import Path

from site_navigation import SECTIONS, Section, document, pages_present, questions, site_file

#: A link or a picture in Markdown, up to its target; and the target of a picture in HTML.
_LINK = re.compile(r"(\]\()([^)\s#]+)(#[^)\s]*)?(\))")
_PICTURE = re.compile(r"(<(?:img|source)\b[^>]*?\b(?:src|srcset)=\")([^\"#]+)()(\")")
_FENCE = re.compile(r"^(```|~~~).*?^\1", re.MULTILINE | re.DOTALL)
#: Files that a page shows or hands out as they are.
IMAGES = (".png", ".svg", ".jpg", ".gif", ".webp")


def rewritten(text: str, page: str, target: Callable[[str, str], str]) -> str:
    """Return a page whose links to files of the repository lead to what stands for them on the site.

    Parameters
    ----------
    text : str
        The page in Markdown.
    page : str
        Its path in the repository.
    target : callable
        Takes the path of a file in the repository and the page, and returns the target on the site; "" leaves the
        link alone.
    """

    def replaced(match: re.Match[str]) -> str:
        before, name, anchor, after = match.groups()
        if "://" in name or name.startswith(("mailto:", "/")):
            return match[0]
        path = posixpath.normpath(posixpath.join(posixpath.dirname(page), name))
        new = target(path, page)
        return f"{before}{new}{anchor or ''}{after}" if new else match[0]

    pieces, position = [], 0
    for fence in _FENCE.finditer(text):
        pieces += [_PICTURE.sub(replaced, _LINK.sub(replaced, text[position : fence.start()])), fence[0]]
        position = fence.end()
    return "".join([*pieces, _PICTURE.sub(replaced, _LINK.sub(replaced, text[position:]))])


def home(text: str) -> str:
    """Return the home page: the readme with a card for each section where it says where to start.

    Parameters
    ----------
    text : str
        The readme of the repository.
    """
    cards = [":::::{container} cards"]
    for section in SECTIONS:
        link = f"[{section.title}]({section.landing})"
        cards += ["::::{container} card", f"**{link}**", "", section.invitation, "::::"]
    cards += [":::::", ""]
    start = re.search(r"^## Where to start\n\n", text, re.MULTILINE)
    place = start.end() if start else len(text)
    return (
        text[:place]
        + "\n".join(cards)
        + "\n"
        + text[place:]
        + "\n"
        + _toctree([(section.title, section.landing) for section in SECTIONS], hidden=True)
    )


def landing(root: Path, section: Section, text: str) -> str:
    """Return the first page of a section, with its other pages and the questions that they answer at its end.

    Parameters
    ----------
    root : Path
        The root of the repository.
    section : Section
        The section.
    text : str
        The page as the repository has it; "" if it has none.
    """
    pages = pages_present(root, section)
    text = text or f"# {section.title}\n\n{section.invitation}\n"
    if not pages:
        return text
    asked = questions(root)
    rows = [f"| [](/{site_file(page)}) | {asked[page]} |" for page in pages if page in asked]
    table = ["| page | the question that it answers |", "|---|---|", *rows, ""] if rows else []
    return "\n".join(
        [text, "## The pages of this section", "", *table, _toctree([("", p) for p in pages], bool(rows))]
    )


def with_program(text: str, program: str) -> str:
    """Return the page that runs strapgen: its first section, the program, and the other sections.

    Parameters
    ----------
    text : str
        The page in Markdown.
    program : str
        The program in HTML.
    """
    first, heading, others = text.partition("\n## ")
    return f"---\nhide-toc: true\n---\n{first}\n```{{raw}} html\n{program}```\n{heading}{others}"


def _toctree(entries: list[tuple[str, str]], hidden: bool) -> str:
    lines = [f"{title} </{document(path)}>" if title else f"/{document(path)}" for title, path in entries]
    options = [":hidden:"] if hidden else [":maxdepth: 1"]
    return "\n".join(["```{toctree}", *options, "", *lines, "```", ""])


class Stage:
    """The folder from which Sphinx reads; it keeps what has not changed, so that a second build is quick."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.names: set[str] = set()

    def write(self, name: str, content: str | bytes) -> None:
        """Write a file unless it has this content already.

        Parameters
        ----------
        name : str
            Path inside the folder.
        content : str or bytes
            What the file holds.
        """
        data = content.encode() if isinstance(content, str) else content
        path = self.folder / name
        self.names.add(name)
        if not path.is_file() or path.read_bytes() != data:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)

    def drop_others(self) -> None:
        """Remove files that were not written this time."""
        for path in sorted(self.folder.rglob("*"), reverse=True):
            if path.is_file() and path.relative_to(self.folder).as_posix() not in self.names:
                path.unlink()
            elif path.is_dir() and not any(path.iterdir()):
                path.rmdir()
