"""Places the parts of a drawing: inputs and stages in columns by rate, and the ways of wires between them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from strapgen.ir.signals import Signal
from strapgen.ir.system import Cell, DescribedSystem, Push, SystemStage
from strapgen.reports.systems.parts import (
    BETWEEN,
    CHARACTER,
    LANE_EDGE,
    LANE_HEAD,
    LEAST_BOX,
    LEAST_GAP,
    MARGIN,
    TRACK,
    Box,
    Lane,
    Link,
    Placement,
    Port,
)


def plan(system: DescribedSystem) -> Placement:
    """Return a drawing of a system as places of its parts.

    Parameters
    ----------
    system : DescribedSystem
    """
    boxes, links = _Graph(system).run()
    result = Placement(boxes, links)
    _choose_columns(result)
    _place(result, system)
    return result


class _Graph:
    """Boxes with ports, and the wires between them, before they are placed."""

    def __init__(self, system: DescribedSystem) -> None:
        self.system = system
        self.cells = {cell.name: cell for cell in system.cells}
        self.inputs = {signal.name: signal for signal in system.inputs}
        self.boxes = {signal.name: Box(signal.name, "", 0) for signal in system.inputs}
        self.boxes |= {stage.name: Box(stage.name, stage.kernel, stage.every) for stage in system.stages}
        self.owners = {cell: stage.name for stage in reversed(system.stages) for _, cell in stage.results}
        self.pushed = {
            step.cell: step for rate in system.rates for step in rate.steps if isinstance(step, Push)
        }
        self.cleared = {cell for rate in system.rates for cell in rate.cleared}
        self.places = {stage.name: place for place, stage in enumerate(system.stages)}
        self.links: list[Link] = []

    def run(self) -> tuple[list[Box], list[Link]]:
        """Return boxes and wires."""
        for stage in self.system.stages:
            self._wire(stage)
        for name in self.system.outputs:
            if name in self.owners:
                self._port(name).mark = "out"
        return list(self.boxes.values()), self.links

    def _port(self, source: str) -> Port:
        """Return the port of an input, or of a cell at its owner; it is added when it is first needed."""
        owner = source if source in self.inputs else self.owners[source]
        name = source if source in self.inputs else source.removeprefix(f"{owner}_")
        box = self.boxes[owner]
        for port in box.outputs:
            if port.name == name:
                return port
        signal: Signal = self.inputs[source] if source in self.inputs else self.cells[source].signal
        box.outputs.append(Port(name, signal.unit, signal.frame, "sum" if source in self.cleared else ""))
        return box.outputs[-1]

    def _wire(self, stage: SystemStage) -> None:
        """Add the wires that end at a stage."""
        results = dict(stage.results).values()
        for wire in stage.wires:
            cell: Cell | None = self.cells.get(wire.source)
            push = self.pushed.get(wire.source)
            source = wire.source if push is None else push.source
            owner = source if source in self.inputs else self.owners[source]
            if owner == stage.name and source in results and push is None:
                continue  # its own state
            kind = "forward"
            if cell is not None and push is None and source in results:
                kind = "shared"
            elif owner in self.places and self.places[owner] >= self.places[stage.name]:
                kind = "delayed"
            self._link(stage, wire.input, source, kind)
        read = {wire.source for wire in stage.wires}
        for output, cell_name in stage.results:
            if self.owners[cell_name] != stage.name and cell_name not in read:
                self._link(stage, output, cell_name, "shared")

    def _link(self, stage: SystemStage, name: str, source: str, kind: str) -> None:
        start = self._port(source)
        owner = source if source in self.inputs else self.owners[source]
        box = self.boxes[stage.name]
        box.inputs.append(Port(name, start.unit, start.frame))
        self.links.append(Link((self.boxes[owner], start), (box, box.inputs[-1]), kind))


def _choose_columns(result: Placement) -> None:
    """Give every box a column: inputs in the first, then the stages of each rate, behind those that they read."""
    before: dict[str, list[Box]] = {box.name: [] for box in result.boxes}
    for link in result.links:
        (source, _), (destination, _) = link.source, link.destination
        if link.kind != "delayed" and source.every == destination.every:
            before[destination.name].append(source)
    first = 1
    for every in sorted({box.every for box in result.boxes} - {0}):
        stages = [box for box in result.boxes if box.every == every]
        for box in stages:
            box.column = max([first, *(other.column + 1 for other in before[box.name])])
        first = max(box.column for box in stages) + 1


def _place(result: Placement, system: DescribedSystem) -> None:
    """Place boxes, lanes and wires."""
    columns = [
        [box for box in result.boxes if box.column == number]
        for number in range(max(box.column for box in result.boxes) + 1)
    ]
    above, below = _tracks(result)
    top = MARGIN + LANE_HEAD + TRACK * (len(above) + 2)
    heights = [sum(box.height for box in column) + BETWEEN * (len(column) - 1) for column in columns]
    gaps = _gaps(result, len(columns))
    x = float(MARGIN)
    for number, column in enumerate(columns):
        x += gaps[number] if number else LANE_EDGE
        width = max(_width(box) for box in column)
        y = top + (max(heights) - heights[number]) / 2
        for box in column:
            box.x, box.y, box.width = x, y, width
            box.place()
            y += box.height + BETWEEN
        x += width
    result.width = x + gaps[-1] + MARGIN
    bottom = top + max(heights)
    result.height = bottom + TRACK * (len(below) + 3) + MARGIN
    result.lanes = list(_lanes(columns, gaps, system))
    ways = _Ways(
        gaps,
        columns,
        {name: top - TRACK * (k + 2) for k, name in enumerate(above)},
        {name: bottom + TRACK * (k + 2) for k, name in enumerate(below)},
    )
    result.paths = [(link, ways.path(link)) for link in result.links]


def _width(box: Box) -> float:
    """Return the width that the text of a box needs."""
    ports = [
        (left.width if left else 0) + (right.width if right else 0)
        for left, right in _side_by_side(box.inputs, box.outputs)
    ]
    return max(
        LEAST_BOX, 24 + CHARACTER * 1.12 * max(len(box.name), len(box.kind)), 22 + max(ports, default=0)
    )


def _side_by_side(left: list[Port], right: list[Port]) -> Iterator[tuple[Port | None, Port | None]]:
    for k in range(max(len(left), len(right))):
        yield left[k] if k < len(left) else None, right[k] if k < len(right) else None


def _is_direct(link: Link) -> bool:
    """Return whether a wire goes from a column to the next one."""
    return link.destination[0].column - link.source[0].column == 1


def _net(link: Link) -> tuple[str, str]:
    """Return what wires share that begin at one port."""
    return link.source[0].name, link.source[1].name


def _tracks(result: Placement) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """Return the wires that pass above the boxes, and those that pass below, a track for each port."""
    far = [link for link in result.links if not _is_direct(link)]
    above = {_net(link): _span(link) for link in far if link.destination[0].column > link.source[0].column}
    below = {_net(link): _span(link) for link in far if link.destination[0].column <= link.source[0].column}
    return sorted(above, key=lambda net: above[net]), sorted(below, key=lambda net: below[net])


def _span(link: Link) -> int:
    return abs(link.destination[0].column - link.source[0].column)


def _gaps(result: Placement, count: int) -> list[float]:
    """Return the width before each column and behind the last, by the number of wires that turn up or down there."""
    turns = [0] * (count + 1)
    for starts, nets in ((True, _ends(result.links, True)), (False, _ends(result.links, False))):
        for column in nets:
            turns[column + 1 if starts else column] += 1
    between = [LEAST_GAP + TRACK * turns[k] + (LANE_EDGE if k else 0) for k in range(count)]
    return [*between, LANE_EDGE + TRACK * turns[count]]


def _ends(links: Iterable[Link], starts: bool) -> list[int]:
    """Return the columns in which far wires begin, one for each port, or in which they end, one for each wire."""
    far = [link for link in links if not _is_direct(link)]
    if starts:
        return [column for _, column in {(_net(link), link.source[0].column) for link in far}]
    return [link.destination[0].column for link in far]


def _lanes(columns: list[list[Box]], gaps: list[float], system: DescribedSystem) -> Iterator[Lane]:
    """Return the lanes, each from the first to the last column of a rate."""
    rates: dict[int, list[int]] = {}
    for number, column in enumerate(columns):
        for box in column:
            rates.setdefault(box.every, []).append(number)
    edges = []
    for numbers in rates.values():
        left, right = columns[min(numbers)][0], columns[max(numbers)][0]
        edges.append((left.x, right.x + right.width))
    for k, every in enumerate(rates):
        start = MARGIN if k == 0 else edges[k - 1][1] + 12
        end = edges[k][1] + (12 if k + 1 < len(edges) else gaps[-1])
        hz = f"{float(system.sample_hz / every):g} Hz" if every else "inputs"
        about = "" if not every else "every cycle" if every == 1 else f"every {every} cycles"
        yield Lane(hz, about, start + (0 if k == 0 else 4), end - start - (0 if k == 0 else 4))


@dataclass
class _Ways:
    """Finds the ways of wires; each that turns in a gap has a place of its own there."""

    gaps: list[float]
    columns: list[list[Box]]
    above: Mapping[tuple[str, str], float]
    below: Mapping[tuple[str, str], float]
    left: dict[tuple[int, tuple[str, str]], float] = field(default_factory=dict)
    used: dict[int, int] = field(default_factory=dict)

    def path(self, link: Link) -> str:
        """Return the way of a wire."""
        (source, start), (destination, end) = link.source, link.destination
        if _is_direct(link):
            bend = (end.x - start.x) / 2
            return (
                f"M{start.x:.1f} {start.y:.1f} C{start.x + bend:.1f} {start.y:.1f} "
                f"{end.x - bend:.1f} {end.y:.1f} {end.x:.1f} {end.y:.1f}"
            )
        forward = destination.column > source.column
        track = (self.above if forward else self.below)[_net(link)]
        out = self.left.get((source.column, _net(link)))
        if out is None:
            out = self._turn(source.column + 1, source.x + source.width)
            self.left[source.column, _net(link)] = out
        back = self._turn(destination.column, destination.x - self.gaps[destination.column])
        return _rounded(
            [(start.x, start.y), (out, start.y), (out, track), (back, track), (back, end.y), (end.x, end.y)]
        )

    def _turn(self, gap: int, left: float) -> float:
        """Return the next free place in the gap before a column."""
        self.used[gap] = self.used.get(gap, 0) + 1
        return left + 14 + TRACK * self.used[gap]


def _rounded(points: list[tuple[float, float]], radius: float = 5) -> str:
    """Return a path of straight lines with round corners."""
    x, y = points[0]
    parts = [f"M{x:.1f} {y:.1f}"]
    for (ax, ay), (bx, by), (cx, cy) in zip(points, points[1:], points[2:], strict=False):
        before, after = abs(bx - ax) + abs(by - ay), abs(cx - bx) + abs(cy - by)
        r = min(radius, before / 2, after / 2)
        px, py = bx - r * _sign(bx - ax), by - r * _sign(by - ay)
        qx, qy = bx + r * _sign(cx - bx), by + r * _sign(cy - by)
        parts.append(f"L{px:.1f} {py:.1f} Q{bx:.1f} {by:.1f} {qx:.1f} {qy:.1f}")
    x, y = points[-1]
    return " ".join([*parts, f"L{x:.1f} {y:.1f}"])


def _sign(value: float) -> int:
    return (value > 0) - (value < 0)
