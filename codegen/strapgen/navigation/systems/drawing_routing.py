"""The parts of a drawing of a system, and the ways of its wires through gutters and channels."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field

#: Sizes in pixels: a line of a box, its head, a character of its text, and an input.
LINE, HEAD, CHARACTER, INPUT = 20, 48, 6.7, 44
#: The edge of the drawing, and the space from a lane to the next one.
MARGIN, BETWEEN = 24, 8
#: From a wire to the next one beside it, from a box to the first wire, and the least width of a gutter.
TRACK, EDGE, GUTTER = 8, 20, 46
#: Least and greatest width of a box; what does not fit is shortened.
LEAST_BOX, GREATEST_BOX = 168, 288
#: Most boxes side by side, and the greatest width of a drawing.
ABREAST, WIDEST = 4, 1500
#: What the colours of wires mean, in the order in which they are drawn.
KINDS = {
    "forward": "wire",
    "shared": "shared state: the same memory",
    "delayed": "goes back: one cycle late",
}


def shortened(text: str, characters: int) -> str:
    """Return a text of at most so many characters, with an ellipsis where something is left out."""
    return text if len(text) <= characters else text[: max(characters - 1, 0)] + "…"


@dataclass
class Port:
    """A line of a box where a wire begins or ends."""

    name: str
    unit: str
    frame: str
    #: "sum" if a slower stage clears it, "out" if a run records it, "" for neither
    mark: str = ""
    #: Kinds of the wires that begin here; each kind begins on a line of its own
    kinds: list[str] = field(default_factory=list)
    #: Where the wire meets the box; for wires that begin here, the middle of their lines
    x: float = 0
    y: float = 0

    @property
    def about(self) -> str:
        """Unit and frame in a few characters."""
        unit = "" if self.unit == "1" else self.unit
        return " ".join(part for part in (unit, self.frame.replace(" to ", "→")) if part)

    @property
    def lines(self) -> int:
        """Lines that wires which begin here need."""
        return max(1, len(self.kinds))

    @property
    def label(self) -> str:
        """Its name, shortened so that unit and frame fit beside it."""
        return shortened(self.name, int((GREATEST_BOX - 26) / CHARACTER) - len(self.about) - 3)

    @property
    def width(self) -> float:
        """Width of its text."""
        return (len(self.label) + len(self.about) + 3) * CHARACTER

    def start(self, kind: str) -> float:
        """Return the height at which wires of a kind begin."""
        return self.y + LINE * (self.kinds.index(kind) - (self.lines - 1) / 2)


@dataclass
class Box:
    """An input or a stage."""

    #: A line above the ports, and one below it: the kernel, or nothing
    name: str
    kind: str
    #: Cycles of the fastest rate from one call to the next; 0 for an input
    every: int
    inputs: list[Port] = field(default_factory=list)
    outputs: list[Port] = field(default_factory=list)
    row: int = 0
    column: int = 0
    #: Upper left corner, and width
    x: float = 0
    y: float = 0
    width: float = 0

    @property
    def height(self) -> float:
        """Height with all ports; outputs stand below the inputs, half a line off those of its neighbours."""
        if not self.kind:
            return INPUT
        return HEAD + LINE * (len(self.inputs) + sum(port.lines for port in self.outputs) + 0.5) + 4

    @property
    def heading(self) -> str:
        """Its name, as far as it fits."""
        return shortened(self.name, 30)

    @property
    def kernel(self) -> str:
        """Its kernel, as far as it fits."""
        return shortened(self.kind, 37)

    @property
    def least_width(self) -> float:
        """Width that its text needs."""
        texts = [8 * len(self.heading), CHARACTER * len(self.kernel), *(p.width for p in self._ports)]
        return min(GREATEST_BOX, max(LEAST_BOX, 26 + max(texts)))

    @property
    def _ports(self) -> list[Port]:
        return [*self.inputs, *self.outputs]

    def place(self) -> None:
        """Place the ports at the edges of the box: those of a stage left and right, that of an input below."""
        if not self.kind:
            for port in self.outputs:
                port.x, port.y = self.x + self.width / 2, self.y + self.height
            return
        top = self.y + HEAD
        for number, port in enumerate(self.inputs):
            port.x, port.y = self.x, top + LINE * (number + 0.5)
        top += LINE * (len(self.inputs) + 0.5)
        for port in self.outputs:
            port.x, port.y = self.x + self.width, top + LINE * port.lines / 2
            top += LINE * port.lines


@dataclass(frozen=True)
class Link:
    """A wire between two ports."""

    source: tuple[Box, Port]
    destination: tuple[Box, Port]
    #: "forward", "delayed" or "shared"
    kind: str

    @property
    def title(self) -> str:
        """What the wire connects, in words."""
        (here, start), (there, end) = self.source, self.destination
        text = f"{here.name}.{start.name}" if here.kind else here.name
        words = {"forward": "", "delayed": ", one cycle late", "shared": ", the same memory"}
        return f"{text} → {there.name}.{end.name}{words[self.kind]}"

    @property
    def net(self) -> tuple[str, str, str]:
        """The port and the kind of a wire; wires that share both form a net."""
        return self.source[0].name, self.source[1].name, self.kind


@dataclass(frozen=True)
class Lane:
    """The rows of one rate."""

    label: str
    about: str
    y: float
    height: float


@dataclass(frozen=True)
class WirePath:
    """The way of a wire, of level and upright lines."""

    link: Link
    #: From its source to its destination
    points: tuple[tuple[float, float], ...]

    def path(self, radius: float = 5) -> str:
        """Return the commands of an SVG path with round corners."""
        (x, y), parts = self.points[0], []
        parts.append(f"M{x:.1f} {y:.1f}")
        for (ax, ay), (bx, by), (cx, cy) in zip(self.points, self.points[1:], self.points[2:], strict=False):
            before, after = abs(bx - ax) + abs(by - ay), abs(cx - bx) + abs(cy - by)
            r = min(radius, before / 2, after / 2)
            px, py = bx - r * _sign(bx - ax), by - r * _sign(by - ay)
            qx, qy = bx + r * _sign(cx - bx), by + r * _sign(cy - by)
            parts.append(f"L{px:.1f} {py:.1f} Q{bx:.1f} {by:.1f} {qx:.1f} {qy:.1f}")
        x, y = self.points[-1]
        return " ".join([*parts, f"L{x - (6 if self.link.kind == 'delayed' else 0):.1f} {y:.1f}"])


@dataclass
class Placement:
    """Boxes and wires of a system, placed."""

    boxes: list[Box]
    links: list[Link]
    lanes: list[Lane] = field(default_factory=list)
    ways: list[WirePath] = field(default_factory=list)
    #: Width of the strip with the rates of the lanes, and of everything
    strip: float = 0
    width: float = 0
    height: float = 0

    def kind(self, port: Port) -> str:
        """Return the kind of the wire that ends at a port."""
        return next(link.kind for link in self.links if link.destination[1] is port)


def _sign(value: float) -> int:
    return (value > 0) - (value < 0)


_Net = tuple[str, str, str]


class Routing:
    """Finds the ways of wires. Gutter k is left of column k, channel k above row k.

    All wires of one kind from one port go along one channel, so that they are one line as far as they can be.
    """

    def __init__(self, rows: list[list[Box]], links: list[Link]) -> None:
        self.rows = rows
        self.nets: dict[_Net, list[Link]] = {}
        for link in links:
            self.nets.setdefault(link.net, []).append(link)
        self.channel_tops: dict[int, float] = {}
        self.gutter_sides: dict[int, float] = {}
        self._channel: dict[_Net, int] = {}
        self._level: dict[int, dict[Hashable, int]] = {}
        self._upright: dict[int, dict[Hashable, int]] = {}

    def choose_channels(self) -> None:
        """Choose a channel for each net, where few others are, and a track in it."""
        self._choose_least_crowded()
        runs: dict[int, dict[Hashable, Straight]] = {}
        for net in sorted(self._channel, key=self._nesting):
            channel = self._channel[net]
            source = self.nets[net][0].source[0]
            run = runs.setdefault(channel, {}).setdefault(net, Straight())
            if source.kind:
                run.reach(source.column + 1, source.row >= channel)
            else:
                run.reach(source.column + 0.5, False)
            for link in self.nets[net]:
                destination = link.destination[0]
                if not source.kind or destination.column != source.column + 1:
                    run.reach(destination.column, destination.row >= channel)
        self._level = {channel: tracks(some, 0.2) for channel, some in runs.items()}

    def _nesting(self, net: _Net) -> tuple[int, int]:
        """Return the sort key of wires that leave a box side by side: to the left, the first is the lowest."""
        links = self.nets[net]
        source, port = links[0].source
        is_left = source.kind and min(link.destination[0].column for link in links) <= source.column
        sign = -1 if is_left else 1
        place = source.outputs.index(port) * len(KINDS) + port.kinds.index(net[2])
        return sign * source.row, sign * place

    def channel_tracks(self, channel: int) -> int:
        """Return how many tracks a channel has."""
        return max(self._level.get(channel, {}).values(), default=-1) + 1

    def choose_gutters(self) -> None:
        """Choose a track for each wire in each gutter; rows and channels have their places now."""
        runs: dict[int, dict[Hashable, Straight]] = {}
        for net, links in self.nets.items():
            source, port = links[0].source
            leave = source.column + 1
            for link in links:
                destination, end = link.destination
                run = runs.setdefault(destination.column, {}).setdefault(net, Straight())
                run.reach(end.y, True)
                if net in self._channel and (destination.column != leave or not source.kind):
                    place = source.column + 0.5 if not source.kind else leave
                    run.reach(self._height(net), place > destination.column)
            if source.kind:
                run = runs.setdefault(leave, {}).setdefault(net, Straight())
                run.reach(port.start(net[2]), False)
                for link in links:
                    if link.destination[0].column != leave:
                        run.reach(self._height(net), link.destination[0].column > leave)
        self._upright = {gutter: tracks(some, TRACK) for gutter, some in runs.items()}

    def gutter_tracks(self, gutter: int) -> int:
        """Return how many tracks a gutter has."""
        return max(self._upright.get(gutter, {}).values(), default=-1) + 1

    def ways(self) -> list[WirePath]:
        """Return the ways of all wires, once everything has its place."""
        return [WirePath(link, tuple(self._points(link))) for links in self.nets.values() for link in links]

    def _points(self, link: Link) -> list[tuple[float, float]]:
        """Return the corners of a wire."""
        (source, start), (destination, end) = link.source, link.destination
        x = self._side(destination.column, link.net)
        if not source.kind:
            y = self._height(link.net)
            return [(start.x, start.y), (start.x, y), (x, y), (x, end.y), (end.x, end.y)]
        first = (start.x, start.start(link.kind))
        if destination.column == source.column + 1:
            return [first, (x, first[1]), (x, end.y), (end.x, end.y)]
        turn, y = self._side(source.column + 1, link.net), self._height(link.net)
        return [first, (turn, first[1]), (turn, y), (x, y), (x, end.y), (end.x, end.y)]

    def _height(self, net: _Net) -> float:
        channel = self._channel[net]
        return self.channel_tops[channel] + TRACK * self._level[channel][net]

    def _side(self, gutter: int, net: _Net) -> float:
        return self.gutter_sides[gutter] + TRACK * self._upright[gutter][net]

    def _choose_least_crowded(self) -> None:
        """Choose the channel of each net in turn, twice, by how many wires are on the way already."""
        passing: Counter[tuple[int, int, int]] = Counter()
        for _ in range(2):
            for net, links in self.nets.items():
                source = links[0].source[0]
                if net in self._channel:
                    passing.subtract(self._cells(net, self._channel[net]))
                if not source.kind:
                    self._channel[net] = source.row + 1
                elif any(link.destination[0].column != source.column + 1 for link in links):
                    self._channel[net] = self._best_channel(net, passing)
                else:
                    continue
                passing.update(self._cells(net, self._channel[net]))

    def _best_channel(self, net: _Net, passing: Counter[tuple[int, int, int]]) -> int:
        """Return the channel whose way is the shortest, where each wire beside it counts as more way."""
        links = self.nets[net]
        rows = [links[0].source[0].row, *(link.destination[0].row for link in links)]
        first = min((box.row for row in self.rows for box in row if box.kind), default=0)
        costs = []
        for channel in range(max(first, min(rows)), max(rows) + 2):
            cells = self._cells(net, channel)
            back = 1 if (net[2] == "delayed") == (channel == min(rows)) and len(set(rows)) == 1 else 0
            costs.append((sum(12 + passing[cell] for cell in cells) + 6 * back, channel))
        return min(costs)[1]

    def _cells(self, net: _Net, channel: int) -> set[tuple[int, int, int]]:
        """Return the parts of gutters (0, column, row) and channels (1, channel, column) that a net passes."""
        links = self.nets[net]
        source = links[0].source[0]
        uprights = {(link.destination[0].column, link.destination[0].row) for link in links}
        if source.kind:
            uprights.add((source.column + 1, source.row))
        cells = {
            (0, column, between)
            for column, row in uprights
            for between in (range(channel, row + 1) if row >= channel else range(row, channel))
        }
        places = [column for column, _ in uprights] + ([] if source.kind else [source.column])
        return cells | {(1, channel, column) for column in range(min(places), max(places))}


@dataclass
class Straight:
    """A straight part of wires along a gutter."""

    #: Where it begins and ends, along the gutter
    low: float = float("inf")
    high: float = float("-inf")
    #: Where wires leave it towards lower tracks, and towards higher ones
    before: set[float] = field(default_factory=set)
    after: set[float] = field(default_factory=set)

    def reach(self, place: float, is_after: bool) -> None:
        """Extend it to a place where a wire leaves it."""
        self.low, self.high = min(self.low, place), max(self.high, place)
        (self.after if is_after else self.before).add(place)

    def crossings(self, other: Straight) -> int:
        """Return how often wires cross if another stretch has a higher track."""
        here = sum(other.low <= place <= other.high for place in self.after)
        return here + sum(self.low <= place <= self.high for place in other.before)


def tracks(runs: Mapping[Hashable, Straight], apart: float) -> dict[Hashable, int]:
    """Return a track for each stretch: 0 for the first, and so on; the order stays where no other is better."""
    order = _order(list(runs), runs)
    numbers: dict[Hashable, int] = {}
    for key in order:
        run = runs[key]
        beside = [
            number
            for other, number in numbers.items()
            if run.low < runs[other].high + apart and runs[other].low < run.high + apart
        ]
        numbers[key] = max(beside, default=-1) + 1
    return numbers


def _order(order: list[Hashable], runs: Mapping[Hashable, Straight]) -> list[Hashable]:
    """Return stretches in an order with few crossings: each moves to its best place until nothing gets better."""
    excess = {  # crossings of a before b less those of b before a
        (a, b): runs[a].crossings(runs[b]) - runs[b].crossings(runs[a]) for a in order for b in order
    }
    for _ in range(len(order)):
        earlier = list(order)
        for key in earlier:
            place = order.index(key)
            order.remove(key)
            costs = [sum(excess[key, other] for other in order)]
            for other in order:
                costs.append(costs[-1] + excess[other, key] - excess[key, other])
            order.insert(place if costs[place] == min(costs) else costs.index(min(costs)), key)
        if order == earlier:
            break
    return order
