"""Places the parts of a drawing: lanes by rate from the top, stages in rows, and wires in the gutters between them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise, permutations

from strapgen.navigation.systems.drawing.drawing_parts import (
    ABREAST,
    BETWEEN,
    CHARACTER,
    EDGE,
    GUTTER,
    MARGIN,
    TRACK,
    WIDEST,
    Box,
    Lane,
    Link,
    Placement,
)
from strapgen.navigation.systems.drawing.graph import Graph
from strapgen.navigation.systems.drawing.routing import Routing
from strapgen.navigation.systems.system import DescribedSystem


def plan(system: DescribedSystem) -> Placement:
    """Return a drawing of a system as places of its parts."""
    for abreast in range(ABREAST, 0, -1):
        placed = _planned(system, abreast)
        if placed.width <= WIDEST:
            break
    return placed


def _planned(system: DescribedSystem, abreast: int) -> Placement:
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
