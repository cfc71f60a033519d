"""The wiring of a described system as SVG: lanes by rate, boxes for stages, wires with unit and frame."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator
from itertools import pairwise, permutations

from strapgen.ir.signals import Signal
from strapgen.navigation.systems.drawing_routing import (
    ABREAST,
    BETWEEN,
    CHARACTER,
    EDGE,
    GUTTER,
    HEAD,
    KINDS,
    MARGIN,
    TRACK,
    WIDEST,
    Box,
    Lane,
    Link,
    Placement,
    Port,
    Routing,
    WirePath,
)
from strapgen.navigation.systems.fitting import GeneratedStages
from strapgen.navigation.systems.system import Cell, DescribedSystem, Push, SystemStage
from strapgen.targets.rendering import render

#: Pixels of a character and of a line of the title, and of a line of the legend.
TITLE_CHARACTER, TITLE_LINE, LEGEND_LINE = 11.5, 26, 22


def drawing(fit: GeneratedStages) -> str:
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


def _nets(ways: Iterable[WirePath]) -> list[tuple[str, list[WirePath], list[tuple[float, float]]]]:
    """Return the wires that are one line together: their kind, their ways, and where they part."""
    nets: dict[tuple[str, str, str], list[WirePath]] = {}
    for way in ways:
        nets.setdefault(way.link.net, []).append(way)
    order = list(KINDS)
    return [
        (net[2], group, _partings(group))
        for net, group in sorted(nets.items(), key=lambda entry: order.index(entry[0][2]))
    ]


def _partings(ways: list[WirePath]) -> list[tuple[float, float]]:
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
    """Return the entries of the legend below the lanes: symbol, words and position."""
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


def plan(system: DescribedSystem) -> Placement:
    """Return a drawing of a system as places of its parts."""
    for abreast in range(ABREAST, 0, -1):
        placed = _plan(system, abreast)
        if placed.width <= WIDEST:
            break
    return placed


def _plan(system: DescribedSystem, abreast: int) -> Placement:
    """Return a drawing with at most so many boxes side by side."""
    boxes, links = Graph(system).run()
    rows = list(_rows(boxes, abreast))
    _choose_columns(rows, links, abreast)
    routing = Routing(rows, links)
    result = Placement(boxes, links)
    routing.choose_channels()
    lanes = _place_rows(rows, routing)
    result.lanes = [_lane(system, every, y, height) for every, y, height in lanes]
    result.strip = 24 + max(max(10 * len(lane.label), CHARACTER * len(lane.about)) for lane in result.lanes)
    result.height = result.lanes[-1].y + result.lanes[-1].height
    result.width = _place_columns(rows, routing, MARGIN + result.strip) + MARGIN
    for box in boxes:
        box.place()
    result.ways = routing.ways()
    return result


def _rows(boxes: list[Box], abreast: int) -> Iterator[list[Box]]:
    """Return the rows from the top, those of a rate of about one length."""
    for every in sorted({box.every for box in boxes}):
        group = [box for box in boxes if box.every == every]
        count = -(-len(group) // abreast)
        edges = [-(-len(group) * k // count) for k in range(count + 1)]
        yield from (group[a:b] for a, b in pairwise(edges))


def _choose_columns(rows: list[list[Box]], links: list[Link], abreast: int) -> None:
    """Give every box a column, so that wires go to the right and not far."""
    touching: dict[str, list[Link]] = {box.name: [] for row in rows for box in row}
    for number, row in enumerate(rows):
        for column, box in enumerate(row):
            box.row, box.column = number, column
    for link in links:
        for name in sorted({link.source[0].name, link.destination[0].name}):
            touching[name].append(link)
    for _ in range(3):
        for row in rows:
            near = {id(link): link for box in row for link in touching[box.name]}.values()
            choices = []
            for places in permutations(range(abreast), len(row)):
                _put(row, places)
                choices.append((sum(map(_detour, near)), places))
            _put(row, min(choices)[1])
    used = sorted({box.column for row in rows for box in row})
    for row in rows:
        _put(row, [used.index(box.column) for box in row])


def _put(row: list[Box], places: Iterable[int]) -> None:
    for box, column in zip(row, places, strict=False):
        box.column = column


def _detour(link: Link) -> float:
    """Return how far a wire goes, and how much it disturbs the flow to the right."""
    source, destination = link.source[0], link.destination[0]
    if not source.kind:
        return abs(source.column - destination.column + 0.5)
    far = abs(source.column + 1 - destination.column)
    if source.row == destination.row and link.kind == "forward":
        return 1.5 * far + (4 if destination.column <= source.column else 0)
    return far


def _place_rows(rows: list[list[Box]], routing: Routing) -> list[tuple[int, float, float]]:
    """Place rows below each other, and return rate, top and height of each lane."""
    y, lanes = float(MARGIN), []
    for number, row in enumerate(rows):
        is_first = number == 0 or rows[number - 1][0].every != row[0].every
        if is_first:
            y += BETWEEN if number else 0
            lanes.append([row[0].every, y, 0.0])
        routing.channel_tops[number] = y + EDGE
        count = routing.channel_tracks(number)
        y += 2 * EDGE + TRACK * max(0, count - 1) if count else EDGE
        for box in row:
            box.y = y
        y += max(box.height for box in row)
        is_last = number + 1 == len(rows)
        if is_last and routing.channel_tracks(number + 1):
            routing.channel_tops[number + 1] = y + EDGE
            y += EDGE + TRACK * (routing.channel_tracks(number + 1) - 1)
        y += EDGE if is_last or rows[number + 1][0].every != row[0].every else 0
        lanes[-1][2] = y - lanes[-1][1]
    return [(int(every), top, height) for every, top, height in lanes]


def _place_columns(rows: list[list[Box]], routing: Routing, x: float) -> float:
    """Place columns beside each other from a place on, and return where the last gutter ends."""
    for row in rows:
        for box in row:
            box.place()  # heights of the ports decide which wires cross
    routing.choose_gutters()
    columns = sorted({box.column for row in rows for box in row})
    for gutter in range(columns[-1] + 2):
        count = routing.gutter_tracks(gutter)
        is_outside = gutter in (0, columns[-1] + 1)
        least = 0 if is_outside and not count else EDGE + 4 if is_outside else GUTTER
        width = max(least, 2 * EDGE + TRACK * max(0, count - 1) if count else EDGE)
        routing.gutter_sides[gutter] = x + (width - TRACK * max(0, count - 1)) / 2
        x += width
        boxes = [box for row in rows for box in row if box.column == gutter]
        widest = max((box.least_width for box in boxes), default=0)
        for box in boxes:
            box.x, box.width = x, widest
        x += widest
    return x


def _lane(system: DescribedSystem, every: int, y: float, height: float) -> Lane:
    """Return the lane of a rate."""
    if not every:
        return Lane("inputs", f"{float(system.sample_hz):g} Hz", y, height)
    hz = f"{float(system.sample_hz / every):g} Hz"
    return Lane(hz, "every cycle" if every == 1 else f"every {every} cycles", y, height)


class Graph:
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
            is_state = cell is not None and push is None and source in results
            if is_state and source == f"{stage.name}_{wire.input}":
                continue  # a state of the stage alone
            kind = "forward"
            if is_state and owner != stage.name:
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
        if kind not in start.kinds:
            start.kinds.append(kind)
        self.links.append(Link((self.boxes[owner], start), (box, box.inputs[-1]), kind))
