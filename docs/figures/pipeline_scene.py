"""The drawing of the pipeline, from the stages themselves and from what the page on the architecture says of them."""

from __future__ import annotations

import inspect
import re
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any

from canvas import Drawing, Point

import strapgen

#: Where a stage's result stands, as column and row; and which results are its input, from a box to a box.
_PLACES: dict[str, Point] = {
    "Choice": (0, 0),
    "Kernel": (1, 0),
    "Program": (2, 0),
    "FixedProgram": (2, 1),
    "Sources": (1, 1),
    "Backend": (0, 1),
    "Run": (1, 2),
    "Motion": (2, 2),
}
_KINDS = {"Backend": ("sand", "orange"), "Motion": ("leaf", "green"), "Run": ("sand", "orange")}
_BOX: Point = (174, 96)
_GAP: Point = (60, 48)
_EDGE = 12
#: What stands in a box that no stage of the page on the architecture describes.
_OTHERS = {
    "Choice": "algorithm, method, increments",
    "Motion": "exact increments and the true attitude",
    "Run": "scale, skew and drift against the truth",
}


def stages(root: Path) -> dict[str, tuple[str, str]]:
    """Return the result of every stage and the words about it, as the page on the architecture lists them.

    Parameters
    ----------
    root : Path
        The root of the repository.
    """
    page = (root / "docs" / "architecture.md").read_text()
    rows = re.findall(r"^    (\w+) +.*?  ->  (\w+): (.*)$", page, re.MULTILINE)
    return {name: (result, words) for name, result, words in rows}


def result(stage: Callable[..., Any]) -> str:
    """Return the name of the class that a stage returns, from its annotation."""
    return str(inspect.signature(stage).return_annotation)


def pipeline(root: Path) -> Drawing:
    """Draw the stages.

    Parameters
    ----------
    root : Path
        The root of the repository.

    Raises
    ------
    ValueError
        If a stage of the page does not return what the page says, or has no place in the drawing.
    """
    listed = stages(root)
    for name, kind in {**{name: kind for name, (kind, _) in listed.items()}, "simulate": "Run"}.items():
        returned = result(getattr(strapgen, name))
        if returned != kind or kind not in _PLACES:
            raise ValueError(f"{name} returns {returned}; the page or the drawing has {kind}")
    words = {kind: text for kind, text in listed.values()} | _OTHERS
    width = round(2 * _EDGE + 3 * _BOX[0] + 2 * _GAP[0])
    drawing = Drawing(width, round(2 * _EDGE + 3 * _BOX[1] + 2 * _GAP[1]), "The pipeline of strapgen")
    for kind, (column, row) in _PLACES.items():
        corner = (_EDGE + column * (_BOX[0] + _GAP[0]), _EDGE + row * (_BOX[1] + _GAP[1]))
        drawing.box(corner, _BOX, *_KINDS.get(kind, ("sky", "blue")))
        middle = corner[0] + _BOX[0] / 2
        drawing.text((middle, corner[1] + 26), kind, size=17, bold=True, anchor="middle")
        for k, line in enumerate(textwrap.wrap(words[kind], 23)):
            drawing.text((middle, corner[1] + 47 + 18 * k), line, size=14, anchor="middle")
    _arrows(drawing)
    return drawing


def _side(kind: str, right: float, down: float) -> Point:
    """Return a place on a box: 0 and 0 are its left and its upper edge, 1 and 1 its right and its lower edge."""
    column, row = _PLACES[kind]
    return (
        _EDGE + column * (_BOX[0] + _GAP[0]) + right * _BOX[0],
        _EDGE + row * (_BOX[1] + _GAP[1]) + down * _BOX[1],
    )


def _arrows(drawing: Drawing) -> None:
    across = (
        ("Choice", "Kernel"),
        ("Kernel", "Program"),
        ("FixedProgram", "Sources"),
        ("Sources", "Backend"),
    )
    for start, end in across:
        leftwards = _PLACES[start][0] > _PLACES[end][0]
        drawing.arrow(
            [_side(start, 0 if leftwards else 1, 0.5), _side(end, 1 if leftwards else 0, 0.5)],
            "ink",
            width=1.8,
        )
    for name, start, lift in (("derive", "Choice", 0.5), ("lower", "Kernel", 0.5), ("build", "Backend", 0.5)):
        x, y = _side(start, 1, lift)
        drawing.text((x + _GAP[0] / 2, y - 9), name, "grey", size=13, bold=True, anchor="middle")
    drawing.arrow([_side("Program", 0.7, 1), _side("FixedProgram", 0.7, 0)], "ink", width=1.8)
    x, y = _side("Program", 0.7, 1)
    drawing.text((x - 8, y + 28), "quantize", "grey", size=13, bold=True, anchor="end")
    x, y = _side("Program", 0.1, 1)
    turn = y + _GAP[1] / 2
    drawing.arrow(
        [(x, y), (x, turn), (_side("Sources", 0.8, 0)[0], turn), _side("Sources", 0.8, 0)], "ink", width=1.8
    )
    x, y = _side("Sources", 0.8, 0)
    drawing.text((x - 8, y - 18), "generate", "grey", size=13, bold=True, anchor="end")
    x, y = _side("Backend", 0.5, 1)
    drawing.arrow([(x, y), (x, _side("Run", 0, 0.5)[1]), _side("Run", 0, 0.5)], "ink", width=1.8)
    drawing.arrow([_side("Motion", 0, 0.5), _side("Run", 1, 0.5)], "ink", width=1.8)
    drawing.text((x + 12, _side("Run", 0, 0.5)[1] - 9), "simulate", "grey", size=13, bold=True)
