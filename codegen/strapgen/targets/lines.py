"""Breaks the lines of generated text."""

from __future__ import annotations

import re
import textwrap


def fill(text: str, indent: str, width: int = 99) -> str:
    """Wrap text at spaces, every line after the first with `indent`."""
    if len(text) <= width and not re.search(r"[^\S ]", text):
        return text.rstrip()
    return "\n".join(
        textwrap.wrap(text, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    )


def fill_expression(text: str, indent: str, width: int = 99) -> str:
    """Wrap an expression before the signs of sums and choices, every line after the first with `indent`.

    What is still too long is wrapped at products and comparisons, then between arguments, then behind a parenthesis,
    and at last before shifts, values and comments, and inside of casts.
    """
    pieces = [text]
    for place in (
        *(r" (?=[+?:-] )", r" (?=(?:\.?[*/]|>=|[|]{1,2}) )", r"(?<=[,;]) ", r"(?<=[\w)]\()(?=\S)"),
        *(r" (?=(?:<<|>>|=|/[*]) )", r"(?<=>\()(?=\S)"),
    ):
        pieces = [
            part
            for piece in pieces
            for part in (
                re.split(place, piece) if len(indent) + len(piece) > width or piece is text else [piece]
            )
        ]
    return _filled(pieces, indent, width)


def fill_arguments(text: str, indent: str, width: int = 99) -> str:
    """Wrap a declaration or a call after its commas, every line after the first with `indent`."""
    return _filled(re.split(r"(?<=,) ", text), indent, width)


def fill_lines(text: str, width: int = 99) -> str:
    """Wrap the lines of a text that are too long, each as an expression."""
    return "\n".join(
        line
        if len(line) <= width
        else fill_expression(line, " " * (len(line) - len(line.lstrip()) + 4), width)
        for line in text.split("\n")
    )


def fill_definition(name: str, value: str, meaning: str, width: int = 99) -> str:
    """Return the definition of a macro with a comment, over several lines if it is too long for one."""
    line = f"#define {name} {value} /* {meaning} */"
    if len(line) <= width:
        return line
    wrapped = fill_arguments(value, "    ", width - 6)
    return f"/* {meaning} */\n#define {name} \\\n    " + wrapped.replace("\n", " \\\n")


def _filled(pieces: list[str], indent: str, width: int) -> str:
    lines: list[str] = []
    for piece in pieces:
        between = "" if lines and lines[-1].endswith("(") else " "
        if lines and len(lines[-1]) + len(between) + len(piece) <= width:
            lines[-1] += f"{between}{piece}"
        else:
            lines.append(f"{indent if lines else ''}{piece}")
    return "\n".join(lines)
