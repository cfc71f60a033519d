"""Tables whose columns say how cells are written: text, comma-separated values, Markdown, LaTeX and HTML."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from strapgen.ir.units import STANDARD_GRAVITY

#: Formats of angles in deg or rad, of errors, and of times and steps in s.
ANGLE, ERROR, SECONDS = ".3g", ".3e", ".6g"
#: For each unit of a mean rate the unit that a person reads, and the factor to it.
READABLE_UNITS = {"rad/s": ("deg/h", math.degrees(3600)), "m/s^2": ("micro-g", 1e6 / STANDARD_GRAVITY)}
#: The width of a page in characters of a table in LaTeX, and the space between two columns.
_PAGE, _BETWEEN = 64, 2
#: Lines of a table in LaTeX that a page holds.
_HEIGHT = 36
#: LaTeX for characters that it reads otherwise, or has not.
_LATEX = {
    **{character: f"\\{character}" for character in "&%$#_{}"},
    **{"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}"},
    **{"<": "$<$", ">": "$>$", "|": "$|$", "\u2212": "$-$", "\u00d7": r"$\times$", "\u00b7": r"$\cdot$"},
    **{"\u00b0": r"$^\circ$", "\u2032": r"$'$", "\u2033": r"$''$", "\u221a": r"$\surd$", "\u00b2": "$^2$"},
    **{
        "\u2264": r"$\le$",
        "\u2265": r"$\ge$",
        "\u03c9": r"$\omega$",
        "\u03c3": r"$\sigma$",
        "\u03b1": r"$\alpha$",
    },
}


@dataclass(frozen=True)
class Column:
    """A column of a table."""

    header: str = ""  # a table in which no column has one has no line of headers
    align: str = ">"  # "<", ">" or "^"
    spec: str = ""  # format of the cells that are no text
    least: int = 0  # width in characters
    gap: int = 2  # spaces before the column
    missing: str = "-"  # for None
    group: str = ""  # title above neighbouring columns of the same group; centred above several

    def cell(self, value: Any) -> str:
        """Return a value as text of the column."""
        if value is None:
            return self.missing
        return value if isinstance(value, str) else format(value, self.spec)


@dataclass(frozen=True)
class TextTable:
    """Rows of values under columns."""

    columns: Sequence[Column]
    rows: Sequence[Sequence[Any]]  # text as it is, a number in the format of its column, None if missing

    def lines(self, indent: str = "") -> list[str]:
        """Return the table as lines of text, each column as wide as its widest cell."""
        heads = [column.header for column in self.columns]
        cells = ([heads] if any(heads) else []) + self._cells()
        widths = [
            max([column.least, *(len(line[k]) for line in cells)]) for k, column in enumerate(self.columns)
        ]
        gaps = [" " * column.gap if k else indent for k, column in enumerate(self.columns)]
        titles = [self._titles(widths)] if any(column.group for column in self.columns) else []
        lines = [
            "".join(
                f"{gap}{cell:{column.align}{width}}"
                for gap, cell, column, width in zip(gaps, line, self.columns, widths, strict=True)
            )
            for line in cells
        ]
        return [line.rstrip() for line in [*(indent + title for title in titles), *lines]]

    def _cells(self) -> list[list[str]]:
        return [
            [column.cell(value) for column, value in zip(self.columns, row, strict=True)] for row in self.rows
        ]

    def _titles(self, widths: Sequence[int]) -> str:
        line = ""
        for group, members in groupby(range(len(widths)), key=lambda k: self.columns[k].group):
            first, *others = members
            width = widths[first] + sum(self.columns[k].gap + widths[k] for k in others)
            gap = " " * self.columns[first].gap if first else ""
            line += f"{gap}{group:{'^' if others else self.columns[first].align}{width}}"
        return line

    def as_text(self, indent: str = "") -> str:
        """Return the table as text for a reader, every line after an indent."""
        return "\n".join(self.lines(indent))

    def as_csv(self) -> str:
        """Return the table as comma-separated values under the headers: numbers in full, an empty cell for None."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(column.header for column in self.columns)
        writer.writerows(["" if value is None else value for value in row] for row in self.rows)
        return text.getvalue()

    def as_markdown(self) -> str:
        """Return the table in Markdown; a column's header has the title of its group before it."""
        rules = {"<": ":--", ">": "--:", "^": ":-:"}
        heads = [f"{column.group} {column.header}".strip() for column in self.columns]
        lines = [heads, [rules[column.align] for column in self.columns], *self._cells()]
        return "\n".join(
            "| " + " | ".join(cell.strip().replace("|", r"\|") for cell in line) + " |" for line in lines
        )

    def as_latex(self) -> str:
        """Return the table as tabular environments: several where a page is too small, the first column in each.

        A column's header has the title of its group before it; powers of ten are written as such.
        """
        heads = [_latex(f"{column.group} {column.header}".strip()) for column in self.columns]
        rows = [
            [
                _number(cell) if not isinstance(value, str) else _latex(cell)
                for value, cell in zip(row, cells, strict=True)
            ]
            for row, cells in zip(self.rows, self._cells(), strict=True)
        ]
        parts = [
            self._tabular(part, heads, some)
            for part in self._pages([heads, *rows])
            for some in self._sheets(part, heads, rows)
        ]
        return "\n\n\\medskip\n".join(parts)

    def _pages(self, lines: Sequence[Sequence[str]]) -> list[list[int]]:
        """Return the columns of each environment, the first one in all."""
        widths = [self._width(k, lines) for k in range(len(self.columns))]
        pages: list[list[int]] = [[0]]
        for k in range(1, len(widths)):
            if len(pages[-1]) > 1 and sum(widths[j] for j in pages[-1]) + widths[k] > _PAGE:
                pages.append([0])
            pages[-1].append(k)
        return pages

    def _width(self, k: int, lines: Sequence[Sequence[str]]) -> int:
        """Return the width of a column; text that leaves no room for another column is set in lines."""
        widest = max(len(_printed(line[k])) for line in lines) + _BETWEEN
        return _PAGE // 2 if self._in_lines(k, widest) else widest

    def _in_lines(self, k: int, widest: int) -> bool:
        return widest > _PAGE * 7 // 8 and self.columns[k].align == "<" and k < len(self.columns) - 1

    def _sheets(
        self, part: Sequence[int], heads: Sequence[str], rows: Sequence[Sequence[str]]
    ) -> list[list[Sequence[str]]]:
        """Return the rows of each environment of some columns, as many as a page holds."""
        before = sum(self._width(k, [heads, *rows]) for k in part[:-1])
        room = max(10, _PAGE - before - 8)
        sheets: list[list[Sequence[str]]] = [[]]
        height = 0
        for row in rows:
            lines = -(-max(1, len(_printed(row[part[-1]]))) // room)
            if sheets[-1] and height + lines > _HEIGHT:
                sheets.append([])
                height = 0
            sheets[-1].append(row)
            height += lines
        return sheets

    def _tabular(self, part: Sequence[int], heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
        widest = max(len(_printed(row[part[-1]])) for row in [heads, *rows])
        rules = {"<": "l", ">": "r", "^": "c"}
        letters = [rules[self.columns[k].align] for k in part]
        widths = [max(len(_printed(row[k])) for row in [heads, *rows]) + _BETWEEN for k in part[:-1]]
        for place, (k, width) in enumerate(zip(part[:-1], widths, strict=True)):
            if self._in_lines(k, width):
                letters[place] = r"p{0.5\linewidth}"
        before = sum(self._width(k, [heads, *rows]) for k in part[:-1])
        if before + widest > _PAGE and letters[-1] == "l":  # long text is set in lines
            letters[-1] = rf"p{{{max(0.15, 1 - before / _PAGE - 0.1):.2f}\linewidth}}"
        lines = [" & ".join(row[k] for k in part) + r" \\" for row in (heads, *rows)]
        body = [r"\hline", *([lines[0], r"\hline"] if any(heads) else []), *lines[1:], r"\hline"]
        return "\n".join([rf"\begin{{tabular}}{{{''.join(letters)}}}", *body, r"\end{tabular}"])

    def as_html(self, caption: str = "") -> str:
        """Return the table in HTML for a notebook; a column's header has the title of its group before it."""
        import html  # whose table of characters is long

        sides = {"<": "left", ">": "right", "^": "center"}
        styles = [f' style="text-align:{sides[column.align]}"' for column in self.columns]

        def line(tag: str, cells: Sequence[str]) -> str:
            shown = (
                f"<{tag}{style}>{html.escape(c)}</{tag}>" for c, style in zip(cells, styles, strict=True)
            )
            return f"<tr>{''.join(shown)}</tr>"

        heads = [f"{column.group} {column.header}".strip() for column in self.columns]
        above = f"<caption>{html.escape(caption)}</caption>" if caption else ""
        lines = [f"<thead>{line('th', heads)}</thead>"] if any(heads) else []
        body = "\n".join(line("td", cells) for cells in self._cells())
        return "\n".join([f"<table>{above}", *lines, f"<tbody>{body}</tbody>", "</table>"])


def _latex(text: str) -> str:
    """Return text as LaTeX prints it."""
    return "".join(_LATEX.get(character, character) for character in text)


def _number(cell: str) -> str:
    """Return the cell of a number in LaTeX, a power of ten as such."""
    match = re.fullmatch(r"(-?[0-9.]+)e([+-][0-9]+)", cell)
    if match:
        return rf"${match[1]} \cdot 10^{{{int(match[2])}}}$"
    return f"${cell}$" if re.fullmatch(r"-[0-9.]+", cell) else _latex(cell)


def _printed(cell: str) -> str:
    """Return a cell roughly as LaTeX prints it, for its width."""
    return re.sub(r"\\[a-z]+(\{\})?|[\\${}^]", "", cell)
