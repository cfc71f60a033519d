"""The parts of a drawing of a system: boxes with ports, wires between them, lanes, and their sizes."""

from __future__ import annotations

from dataclasses import dataclass, field

#: Sizes in pixels: a line of a box, the head of a box, a character, and gaps.
LINE, HEAD, CHARACTER = 19, 46, 6.7
MARGIN, LANE_HEAD, BETWEEN, LANE_EDGE, TRACK = 28, 44, 26, 26, 9
#: Least width of a box, and of the gap between two columns.
LEAST_BOX, LEAST_GAP = 132, 64


@dataclass
class Port:
    """A line of a box where a wire begins or ends.

    Parameters
    ----------
    name : str
    unit, frame : str
    mark : str
        "sum" if a slower stage clears it, "out" if a run records it, "" for neither.
    x, y : float
        Where the wire meets the box.
    """

    name: str
    unit: str
    frame: str
    mark: str = ""
    x: float = 0
    y: float = 0

    @property
    def about(self) -> str:
        """Unit and frame in a few characters."""
        unit = "" if self.unit == "1" else self.unit
        return " ".join(part for part in (unit, self.frame.replace(" to ", "→")) if part)

    @property
    def width(self) -> float:
        """Width of its text."""
        return (len(self.name) + len(self.about) + 3) * CHARACTER


@dataclass
class Box:
    """An input or a stage.

    Parameters
    ----------
    name, kind : str
        A line above the ports, and one below it: the kernel, or nothing.
    every : int
        Cycles of the fastest rate from one call to the next; 0 for an input.
    inputs, outputs : list of Port
    column : int
    x, y, width : float
        Upper left corner, and width.
    """

    name: str
    kind: str
    every: int
    inputs: list[Port] = field(default_factory=list)
    outputs: list[Port] = field(default_factory=list)
    column: int = 0
    x: float = 0
    y: float = 0
    width: float = 0

    @property
    def height(self) -> float:
        """Height with all ports."""
        return (HEAD if self.kind else 12) + LINE * max(len(self.inputs), len(self.outputs)) + 8

    def place(self) -> None:
        """Place the ports at the edges of the box."""
        top = self.y + (HEAD if self.kind else 12)
        for ports, x in ((self.inputs, self.x), (self.outputs, self.x + self.width)):
            for number, port in enumerate(ports):
                port.x, port.y = x, top + LINE * (number + 0.5)


@dataclass(frozen=True)
class Link:
    """A wire between two ports.

    Parameters
    ----------
    source, destination : tuple of (Box, Port)
    kind : str
        "forward", "delayed" or "shared".
    """

    source: tuple[Box, Port]
    destination: tuple[Box, Port]
    kind: str

    @property
    def title(self) -> str:
        """What the wire connects, in words."""
        (here, start), (there, end) = self.source, self.destination
        text = f"{here.name}.{start.name}" if here.kind else here.name
        words = {"forward": "", "delayed": ", one cycle late", "shared": ", the same memory"}
        return f"{text} → {there.name}.{end.name}{words[self.kind]}"


@dataclass(frozen=True)
class Lane:
    """The columns of one rate.

    Parameters
    ----------
    label, about : str
    x, width : float
    """

    label: str
    about: str
    x: float
    width: float


@dataclass
class Placement:
    """Boxes and wires of a system, placed.

    Parameters
    ----------
    boxes : list of Box
    links : list of Link
    lanes : list of Lane
    paths : list of (Link, str)
        Each wire with its way as the commands of an SVG path.
    width, height : float
    """

    boxes: list[Box]
    links: list[Link]
    lanes: list[Lane] = field(default_factory=list)
    paths: list[tuple[Link, str]] = field(default_factory=list)
    width: float = 0
    height: float = 0
