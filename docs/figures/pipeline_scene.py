"""The drawing of the two storeys, from the stages, the applications and the page on the architecture."""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

from canvas import Drawing, Point

import strapgen
from strapgen.registration import built_in

_BOX: Point = (154, 92)
_GAP = 74
_EDGE = 22
_STEP = _BOX[0] + _GAP
_WIDTH = round(2 * _EDGE + 5 * _BOX[0] + 4 * _GAP)
#: Applications in a row, the height of their boxes, and the gap between them.
_COLUMNS, _ROOM, _SPACE = 5, 112, 14
#: Upper edges of the storeys, of the rows in them, and the lower edge of all.
_APPLICATIONS, _FIRST_ROOM = 8, 40
_COMPILER = _FIRST_ROOM + 2 * (_ROOM + _SPACE) + 36
_STAGES = _COMPILER + 34
_FIXED = _STAGES + _BOX[1] + 46
_HEIGHT = round(_FIXED + _BOX[1] + _EDGE + 8)
#: Where a stage's result stands, as column and upper edge.
_PLACES: dict[str, Point] = {
    "Choice": (0, _STAGES),
    "Kernel": (1, _STAGES),
    "Program": (2, _STAGES),
    "FixedProgram": (2, _FIXED),
    "Sources": (3, _STAGES),
    "Backend": (4, _STAGES),
}
#: What stands in a box that no stage of the page on the architecture describes.
_OTHERS = {"Choice": "algorithm, method, increments"}


def stages(root: Path) -> dict[str, tuple[str, str]]:
    """Return the result of every stage and the words about it, as the page on the architecture lists them."""
    page = (root / "docs" / "architecture.md").read_text()
    rows = re.findall(r"^    (\w+) +.*?  ->  (\w+): (.*)$", page, re.MULTILINE)
    return {name: (result, words) for name, result, words in rows}


def applications(root: Path) -> dict[str, str]:
    """Return the applications that the page on the architecture lists, with their own titles, the lowest first."""
    page, _, _ = (root / "docs" / "architecture.md").read_text().partition("| the compiler |")
    names = re.findall(r"^\| `(\w+)/` \|", page, re.MULTILINE)
    return {name: one.title for name, one in built_in().items() if name in names}


def result(stage: Callable[..., Any]) -> str:
    """Return the name of the class that a stage returns, from its annotation."""
    return str(inspect.signature(stage).return_annotation)


def pipeline(root: Path) -> Drawing:
    """Draw the applications above the compiler and its stages.

    Raises ValueError if a stage of the page does not return what the page says, or has no place in the drawing.
    """
    listed = stages(root)
    for name, (kind, _) in listed.items():
        returned = result(getattr(strapgen, name))
        if returned != kind or kind not in _PLACES:
            raise ValueError(f"{name} returns {returned}; the page or the drawing has {kind}")
    drawing = Drawing(_WIDTH, _HEIGHT, "The two storeys of strapgen: applications on a compiler")
    _storey(drawing, _APPLICATIONS, "applications: each a question that a user asks")
    _rooms(drawing, applications(root))
    _storey(drawing, _COMPILER, "the compiler: from a choice to code that runs")
    words = {kind: text for kind, text in listed.values()} | _OTHERS
    for kind in _PLACES:
        _box(drawing, _corner(kind), _BOX, kind, words[kind], ("sky", "blue"))
    _arrows(drawing)
    return drawing


def _storey(drawing: Drawing, top: float, words: str) -> None:
    drawing.line([(_EDGE, top), (_WIDTH - _EDGE, top)], "grey", width=1.2)
    drawing.text((_EDGE, top + 20), words, "grey", size=15, bold=True)


def _box(
    drawing: Drawing, corner: Point, size: Point, title: str, words: str, colours: tuple[str, str]
) -> None:
    drawing.box(corner, size, *colours)
    middle = corner[0] + size[0] / 2
    drawing.text((middle, corner[1] + 24), title, size=16, bold=True, anchor="middle")
    for k, line in enumerate(textwrap.wrap(words, int(size[0] / 7.3))):
        drawing.text((middle, corner[1] + 43 + 17 * k), line, size=13.5, anchor="middle")


def _rooms(drawing: Drawing, rooms: dict[str, str]) -> None:
    """Draw the applications, those above that need others."""
    width = (_WIDTH - 2 * _EDGE - (_COLUMNS - 1) * _SPACE) / _COLUMNS
    rows = -(-len(rooms) // _COLUMNS)
    for k, (name, title) in enumerate(rooms.items()):
        row = rows - 1 - k // _COLUMNS
        corner = (_EDGE + k % _COLUMNS * (width + _SPACE), _FIRST_ROOM + row * (_ROOM + _SPACE))
        _box(drawing, corner, (width, _ROOM), name, title, ("sand", "orange"))


def _corner(kind: str) -> Point:
    column, top = _PLACES[kind]
    return _EDGE + column * _STEP, top


def _arrows(drawing: Drawing) -> None:
    middle = _STAGES + _BOX[1] / 2
    for column, name in enumerate(("derive", "lower", "generate", "build")):
        right = _EDGE + column * _STEP + _BOX[0]
        drawing.arrow([(right, middle), (right + _GAP, middle)], "ink", width=1.8)
        drawing.text((right + _GAP / 2, middle - 9), name, "grey", size=13, bold=True, anchor="middle")
    x = _corner("Program")[0] + _BOX[0] / 2
    drawing.arrow([(x, _STAGES + _BOX[1]), (x, _FIXED)], "ink", width=1.8)
    drawing.text((x - 8, _FIXED - 18), "quantize", "grey", size=13, bold=True, anchor="end")
    x, y = _corner("Sources")[0] + _BOX[0] / 2, _FIXED + _BOX[1] / 2
    right = _corner("FixedProgram")[0] + _BOX[0]
    drawing.arrow([(right, y), (x, y), (x, _STAGES + _BOX[1])], "ink", width=1.8)
    drawing.text((x + 8, _FIXED - 18), "generate", "grey", size=13, bold=True)
