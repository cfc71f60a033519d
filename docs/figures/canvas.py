"""A drawing as SVG with text, in colours for light and for dark pages; points in space are seen from a direction."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

from strapgen.results.figures import DARK_INK, DARK_PAPER, FONTS, INK, PAPER, on_dark

Point = tuple[float, float]
Vector = tuple[float, float, float]

#: Lines and words: they read on paper, and the colour-blind tell them apart.
COLOURS = {"blue": "#0062a3", "orange": "#b84a00", "green": "#00775a", "grey": "#5d6e7d"}
#: Areas behind them.
GROUNDS = {"sky": "#eaf1f7", "sand": "#f8efe6", "leaf": "#e6f3ee"}
DARK_GROUNDS = {"sky": "#1b2a38", "sand": "#33271d", "leaf": "#17302a"}


@dataclass(frozen=True)
class View:
    """Where a drawing in space is seen from, without perspective.

    Parameters
    ----------
    azimuth_deg, elevation_deg : float
        Direction to the eye, from the x axis about z, and above the plane of x and y.
    centre : tuple of float
        Where the origin lies in the drawing, in pixels.
    scale : float
        Pixels of a unit.
    """

    azimuth_deg: float
    elevation_deg: float
    centre: Point
    scale: float

    def eye(self) -> Vector:
        """Return the unit vector to the eye."""
        a, e = math.radians(self.azimuth_deg), math.radians(self.elevation_deg)
        return math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)

    def at(self, v: Vector) -> Point:
        """Return the place of a point in the drawing, in pixels."""
        a, e = math.radians(self.azimuth_deg), math.radians(self.elevation_deg)
        right = -math.sin(a) * v[0] + math.cos(a) * v[1]
        up = -math.sin(e) * (math.cos(a) * v[0] + math.sin(a) * v[1]) + math.cos(e) * v[2]
        return self.centre[0] + self.scale * right, self.centre[1] - self.scale * up


class Drawing:
    """A drawing of so many pixels; words and lines are added in the order in which they cover each other.

    Parameters
    ----------
    width, height : int
        Size in pixels.
    title : str
        What it shows, for those who hear it read.
    """

    def __init__(self, width: int, height: int, title: str) -> None:
        self.width, self.height, self.title = width, height, title
        self.parts: list[str] = []
        self.words: list[tuple[float, float, float, str]] = []

    def line(self, points: Sequence[Point], kind: str, *, width: float = 2, dashed: bool = False) -> None:
        """Draw a line through points."""
        self._path(_run(points), kind, width, dashed)

    def arrow(self, points: Sequence[Point], kind: str, *, width: float = 2.2, dashed: bool = False) -> None:
        """Draw a line through points with a head at its end, which touches the last point."""
        (x, y), (u, v) = points[-1], points[-2]
        length = math.hypot(x - u, y - v)
        dx, dy = (x - u) / length, (y - v) / length
        head = 4.5 * width
        neck = (x - head * dx, y - head * dy)
        self.line([*points[:-1], neck], kind, width=width, dashed=dashed)
        wing = 0.42 * head
        corners = [
            (x, y),
            (neck[0] - wing * dy, neck[1] + wing * dx),
            (neck[0] + wing * dy, neck[1] - wing * dx),
        ]
        self.parts.append(f'<path class="{kind} full" d="{_run(corners)} z"/>')

    def area(self, points: Sequence[Point], ground: str, kind: str = "", *, width: float = 1.4) -> None:
        """Fill what lies inside points, with an edge if its kind is named."""
        edge = f' {kind}" stroke-width="{width:g}' if kind else ""
        self.parts.append(f'<path class="{ground}{edge}" d="{_run(points)} z"/>')

    def box(self, corner: Point, size: Point, ground: str, kind: str) -> None:
        """Draw a box with round corners."""
        (x, y), (w, h) = corner, size
        self.parts.append(
            f'<rect class="{ground} {kind}" stroke-width="1.4" x="{x:g}" y="{y:g}" width="{w:g}" height="{h:g}" '
            'rx="7"/>'
        )

    def dot(self, place: Point, kind: str, radius: float = 4) -> None:
        """Draw a dot."""
        self.parts.append(
            f'<circle class="{kind} full" cx="{place[0]:.1f}" cy="{place[1]:.1f}" r="{radius:g}"/>'
        )

    def text(
        self,
        place: Point,
        words: str,
        kind: str = "ink",
        *,
        size: float = 15,
        bold: bool = False,
        anchor: str = "start",
    ) -> None:
        """Write words; their baseline begins, has its middle or ends at a place."""
        weight = ' font-weight="600"' if bold else ""
        end = "" if anchor == "start" else f' text-anchor="{anchor}"'
        self.parts.append(
            f'<text class="{kind}-text" x="{place[0]:.1f}" y="{place[1]:.1f}" font-size="{size:g}"{weight}{end}>'
            f"{escape(words, quote=False)}</text>"
        )
        wide = 0.56 * size * len(words)
        left = place[0] - {"start": 0.0, "middle": wide / 2, "end": wide}[anchor]
        self.words.append((left, place[1] - size, left + wide, words))

    def svg(self) -> str:
        """Return the drawing as the text of a file."""
        lines = [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{self.width}" height="{self.height}" '
            f'viewBox="0 0 {self.width} {self.height}" role="img" font-family="{FONTS}">',
            f"<title>{escape(self.title, quote=False)}</title>",
            "<style>",
            *_rules(PAPER, INK, COLOURS, GROUNDS),
            "path, rect, circle { stroke-linejoin: round; stroke-linecap: round }",
            "@media (prefers-color-scheme: dark) {",
            *_rules(DARK_PAPER, DARK_INK, {name: on_dark(c) for name, c in COLOURS.items()}, DARK_GROUNDS),
            "}",
            "</style>",
            '<rect class="paper" width="100%" height="100%"/>',
            *self.parts,
            "</svg>",
        ]
        return "\n".join(lines) + "\n"

    def _path(self, data: str, kind: str, width: float, dashed: bool) -> None:
        dash = ' stroke-dasharray="5 4"' if dashed else ""
        self.parts.append(f'<path class="{kind} open" stroke-width="{width:g}"{dash} d="{data}"/>')


def _run(points: Iterable[Point]) -> str:
    return "M" + " L".join(f"{x:.1f} {y:.1f}" for x, y in points)


def _rules(paper: str, ink: str, colours: dict[str, str], grounds: dict[str, str]) -> list[str]:
    """Return the rules of a style sheet for one kind of page; those of open and full shapes stand last."""
    rules = [f".paper {{ fill: {paper} }}"]
    rules += [f".{name} {{ fill: {colour} }}" for name, colour in grounds.items()]
    for name, colour in {"ink": ink, **colours}.items():
        rules += [f".{name} {{ stroke: {colour} }}", f".{name}-text {{ fill: {colour} }}"]
        rules.append(f".{name}.full {{ fill: {colour}; stroke: none }}")
    return [*rules, ".open { fill: none }"]
