"""Draws the wiring of a described system as SVG: lanes by rate, boxes for stages, wires with unit and frame."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator
from itertools import pairwise

from strapgen.navigation.systems.drawing.drawing_layout import plan
from strapgen.navigation.systems.drawing.drawing_parts import CHARACTER, HEAD, KINDS, MARGIN, Placement, Way
from strapgen.navigation.systems.fitting import Fitted
from strapgen.targets.rendering import render

#: Pixels of a character and of a line of the title, and of a line of the legend.
TITLE_CHARACTER, TITLE_LINE, LEGEND_LINE = 11.5, 26, 22


def drawing(fit: Fitted) -> str:
    """Return a drawing of the wiring of a system."""
    system = fit.description.system
    placed = plan(system)
    title = textwrap.wrap(system.title, int((placed.width - 2 * MARGIN) / TITLE_CHARACTER)) or [""]
    legend = list(_legend(placed))
    top = MARGIN + TITLE_LINE * len(title) - 14
    bottom = top + placed.height
    return render(
        "system_svg/drawing.svg.j2",
        system=system,
        plan=placed,
        nets=_nets(placed.ways),
        title=title,
        legend=legend,
        top=top,
        bottom=bottom,
        height=bottom + max(y for _, _, _, y in legend) + MARGIN,
        sizes={"head": HEAD, "margin": MARGIN, "title": TITLE_LINE},
    )


def _nets(ways: Iterable[Way]) -> list[tuple[str, list[Way], list[tuple[float, float]]]]:
    """Return the wires that are one line together: their kind, their ways, and where they part."""
    nets: dict[tuple[str, str, str], list[Way]] = {}
    for way in ways:
        nets.setdefault(way.link.net, []).append(way)
    order = list(KINDS)
    return [
        (net[2], group, _partings(group))
        for net, group in sorted(nets.items(), key=lambda entry: order.index(entry[0][2]))
    ]


def _partings(ways: list[Way]) -> list[tuple[float, float]]:
    """Return the places from which lines go in three directions or four."""
    lines = {line for way in ways for line in pairwise(way.points)}
    partings = []
    for x, y in sorted({point for way in ways for point in way.points}):
        directions = set()
        for (ax, ay), (bx, by) in lines:
            if min(ax, bx) <= x <= max(ax, bx) and min(ay, by) <= y <= max(ay, by):
                for cx, cy in ((ax, ay), (bx, by)):
                    directions.add(((cx > x) - (cx < x), (cy > y) - (cy < y)))
        if len(directions - {(0, 0)}) > 2:
            partings.append((x, y))
    return partings


def _legend(placed: Placement) -> Iterator[tuple[str, str, float, float]]:
    """Return the entries of the legend: what is drawn, its words and its place, below the lanes."""
    used = {link.kind for link in placed.links}
    marks = {port.mark for box in placed.boxes for port in box.outputs}
    entries = [(kind, words) for kind, words in KINDS.items() if kind in used]
    entries += [("sum", "cleared when taken")] if "sum" in marks else []
    entries += [("out", "output of a run")] if "out" in marks else []
    x, y = float(MARGIN), 28.0
    for kind, words in entries:
        width = {"sum": 18, "out": 20}.get(kind, 44) + CHARACTER * len(words)
        if x + width > placed.width - MARGIN and x > MARGIN:
            x, y = float(MARGIN), y + LEGEND_LINE
        yield kind, words, x, y
        x += width + 28
