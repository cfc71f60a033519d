"""The parts of a drawing of a system: boxes with ports, wires between them, lanes, and their sizes."""

from __future__ import annotations

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
        """What wires share that begin at one port and have one kind."""
        return self.source[0].name, self.source[1].name, self.kind


@dataclass(frozen=True)
class Lane:
    """The rows of one rate."""

    label: str
    about: str
    y: float
    height: float


@dataclass(frozen=True)
class Way:
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
    ways: list[Way] = field(default_factory=list)
    #: Width of the strip with the rates of the lanes, and of everything
    strip: float = 0
    width: float = 0
    height: float = 0

    def kind(self, port: Port) -> str:
        """Return the kind of the wire that ends at a port."""
        return next(link.kind for link in self.links if link.destination[1] is port)


def _sign(value: float) -> int:
    return (value > 0) - (value < 0)
