"""The drawings of the page on frames, signs and coning."""

from __future__ import annotations

import math
from collections.abc import Callable

from canvas import Drawing, Point, Vector, View


def add(a: Vector, b: Vector, times: float = 1.0) -> Vector:
    """Return a and so many times b."""
    return a[0] + times * b[0], a[1] + times * b[1], a[2] + times * b[2]


def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """Return the cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def scaled(a: Vector, length: float) -> Vector:
    """Return a vector of another length."""
    size = math.sqrt(dot(a, a))
    return a[0] * length / size, a[1] * length / size, a[2] * length / size


def arc(u: Vector, v: Vector, first_deg: float, last_deg: float, centre: Vector = (0, 0, 0)) -> list[Vector]:
    """Return points of an arc from u towards v, which have its radius and a right angle between them."""
    steps = max(2, round(abs(last_deg - first_deg) / 4))
    angles = [math.radians(first_deg + (last_deg - first_deg) * k / steps) for k in range(steps + 1)]
    return [add(add(centre, u, math.cos(a)), v, math.sin(a)) for a in angles]


def _seen(view: View, points: list[Vector]) -> list[Point]:
    return [view.at(point) for point in points]


# The vehicle

#: An aircraft with its nose at x, its right wing at y and its belly at z, as flat pieces from the far to the near.
_FLAT = (
    ("sky", [(0.28, 0, 0), (-0.1, -1.05, 0), (-0.3, -1.05, 0), (-0.22, 0, 0)]),
    ("sky", [(-0.72, 0, 0), (-0.9, -0.36, 0), (-1.02, -0.36, 0), (-0.98, 0, 0)]),
    (
        "leaf",
        [(1.05, 0, 0), (0.72, 0.13, 0), (-0.6, 0.12, 0), (-1.05, 0, 0), (-0.6, -0.12, 0), (0.72, -0.13, 0)],
    ),
    ("sky", [(0.28, 0, 0), (-0.1, 1.05, 0), (-0.3, 1.05, 0), (-0.22, 0, 0)]),
    ("sky", [(-0.72, 0, 0), (-0.9, 0.36, 0), (-1.02, 0.36, 0), (-0.98, 0, 0)]),
    ("sand", [(-0.62, 0, 0), (-0.95, 0, -0.4), (-1.08, 0, -0.4), (-1.0, 0, 0)]),
)


def vehicle() -> Drawing:
    """Draw a vehicle with its axes and positive turns."""
    drawing = Drawing(
        640, 370, "A vehicle with body axes x ahead, y right and z down, and positive turns about them"
    )
    view = View(212, 28, (240, 176), 155)

    def at(v: Vector) -> Point:  # z points down, so that the eye is above at negative z
        return view.at((v[0], -v[1], -v[2]))

    for ground, corners in _FLAT:
        drawing.area([at(corner) for corner in corners], ground, "ink", width=1.3)
    axes: tuple[tuple[str, str, Vector, Vector, Vector], ...] = (
        ("x", "blue", (1, 0, 0), (0, 1, 0), (0, 0, 1)),
        ("y", "orange", (0, 1, 0), (0, 0, 1), (1, 0, 0)),
        ("z", "green", (0, 0, 1), (1, 0, 0), (0, 1, 0)),
    )
    words = {
        "x": ("x, ahead", "roll: right wing down"),
        "y": ("y, right", "pitch: nose up"),
        "z": ("z, down", "heading: nose right"),
    }
    places: dict[str, Point] = {"x": (12, -14), "y": (12, 4), "z": (18, 0)}
    for name, colour, axis, u, v in axes:
        length = 1.75 if name != "z" else 1.15
        drawing.arrow([at((0, 0, 0)), at(scaled(axis, length))], colour, width=2.6)
        turn = arc(scaled(u, 0.2), scaled(v, 0.2), -70, 200, scaled(axis, length * 0.8))
        drawing.arrow([at(point) for point in turn], colour, width=1.8)
        dx, dy = places[name]
        x, y = at(scaled(axis, length))
        drawing.text((x + dx, y + dy), words[name][0], colour, size=17, bold=True)
        drawing.text((x + dx, y + dy + 20), words[name][1])
    drawing.dot(at((0, 0, 0)), "ink", 5)
    return drawing


# The frames


def frames() -> Drawing:
    """Draw the earth with its frames, and the navigation frame from above."""
    drawing = Drawing(
        640, 430, "The inertial and the earth-fixed frame, and the navigation and the geographic frame"
    )
    view = View(30, 22, (165, 226), 112)
    _globe(drawing, view)
    _tangent(drawing, (462, 214))
    return drawing


def _globe(drawing: Drawing, view: View) -> None:
    drawing.text((24, 34), "Seen from space", size=17, bold=True)
    x, y = view.centre
    rim = [
        (x + view.scale * math.cos(t / 30 * math.pi), y + view.scale * math.sin(t / 30 * math.pi))
        for t in range(60)
    ]
    drawing.area(rim, "sky", "grey")
    turned = math.radians(38)
    e_x: Vector = (math.cos(turned), math.sin(turned), 0)
    e_y: Vector = (-math.sin(turned), math.cos(turned), 0)
    _hidden(drawing, view, arc((1, 0, 0), (0, 1, 0), 0, 360))
    _hidden(drawing, view, arc(e_x, (0, 0, 1), -90, 90))
    pole: Vector = (0, 0, 1)
    for axis, colour, name, shift in (
        ((1, 0, 0), "grey", "x of i", (-58, 22)),
        (e_x, "blue", "x of e", (4, 20)),
    ):
        drawing.arrow([view.at((0, 0, 0)), view.at(scaled(axis, 1.5))], colour)
        px, py = view.at(scaled(axis, 1.5))
        drawing.text((px + shift[0], py + shift[1]), name, colour, bold=True)
    drawing.arrow([view.at((0, 0, 0)), view.at(scaled(pole, 1.45))], "blue")
    px, py = view.at(scaled(pole, 1.45))
    drawing.text((px + 10, py + 8), "z of i and of e", "blue", bold=True)
    drawing.arrow(_seen(view, arc((1.16, 0, 0), (0, 1.16, 0), 0, 36)), "ink", width=1.8)
    drawing.text((24, 386), "From i to e the earth turns about z.")
    drawing.text((24, 408), "x of e lies at longitude 0.")
    latitude, longitude = math.radians(42), math.radians(42)
    place = add(
        add(
            scaled(e_x, math.cos(latitude) * math.cos(longitude)),
            e_y,
            math.cos(latitude) * math.sin(longitude),
        ),
        pole,
        math.sin(latitude),
    )
    drawing.arrow([view.at(place), view.at(scaled(place, 1.5))], "orange", width=2.6)
    drawing.dot(view.at(place), "ink", 5)
    px, py = view.at(scaled(place, 1.5))
    drawing.text((px - 18, py - 10), "z of n, up", "orange", bold=True)


def _hidden(drawing: Drawing, view: View, points: list[Vector]) -> None:
    """Draw a curve on the globe: a line where it is seen, dashes where it is behind."""
    eye, run, front = view.eye(), [points[0]], dot(points[0], view.eye()) >= 0
    for point in points[1:]:
        run.append(point)
        if (dot(point, eye) >= 0) != front:
            drawing.line(_seen(view, run), "grey", width=1.3, dashed=not front)
            run, front = [point], not front
    if len(run) > 1:
        drawing.line(_seen(view, run), "grey", width=1.3, dashed=not front)


def _tangent(drawing: Drawing, centre: Point) -> None:
    """Draw the frames n and g from above, with a wander angle of 25 degrees."""
    x, y = centre
    drawing.text((x - 132, 34), "Seen from above the vehicle", size=17, bold=True)

    def at(angle_deg: float, radius: float) -> Point:
        return x + radius * math.cos(math.radians(angle_deg)), y - radius * math.sin(math.radians(angle_deg))

    wander = 25
    for angle, name, shift, anchor in ((0, "east", (4, 20), "end"), (90, "north", (8, 4), "start")):
        drawing.arrow([centre, at(angle, 140)], "green")
        px, py = at(angle, 140)
        drawing.text((px + shift[0], py + shift[1]), f"{name}, of g", "green", bold=True, anchor=anchor)
    for angle, name, shift, anchor in (
        (wander, "x of n", (6, 6), "start"),
        (90 + wander, "y of n", (-8, 4), "end"),
    ):
        drawing.arrow([centre, at(angle, 128)], "orange", width=2.6)
        px, py = at(angle, 128)
        drawing.text((px + shift[0], py + shift[1]), name, "orange", bold=True, anchor=anchor)
    drawing.arrow([at(k * wander / 8, 88) for k in range(9)], "ink", width=1.8)
    drawing.text((x + 40, y + 44), "wander angle,", size=14)
    drawing.text((x + 40, y + 62), "positive about up", size=14)
    heading = 58
    nose, tail = at(heading, 108), at(heading + 180, 26)
    drawing.arrow([tail, nose], "blue", width=2.6)
    drawing.text((nose[0] + 4, nose[1] - 8), "x of b", "blue", bold=True)
    drawing.dot(centre, "ink", 5)
    drawing.text((x - 132, 364), "Up, z of n, comes out of the paper;")
    drawing.text((x - 132, 386), "down, the third axis of g, goes in.")
    drawing.text((x - 132, 408), "An attitude takes b to n, or b to g.")


# Coning

_HALF_ANGLE_DEG = 38
_ROUND = 360


def rim(angle_deg: float) -> Vector:
    """Return the unit vector along the axis of the body, so far round the cone."""
    half, around = math.radians(_HALF_ANGLE_DEG), math.radians(angle_deg)
    return math.sin(half) * math.cos(around), math.sin(half) * math.sin(around), math.cos(half)


def pointers() -> list[Vector]:
    """Return a mark across the axis of a body that has no rate about it, at each degree of a round."""
    marks: list[Vector] = [
        (math.cos(math.radians(_HALF_ANGLE_DEG)), 0.0, -math.sin(math.radians(_HALF_ANGLE_DEG)))
    ]
    for degree in range(_ROUND):
        steps = 20
        mark = marks[-1]
        for k in range(steps):
            old, new = rim(degree + k / steps), rim(degree + (k + 1) / steps)
            axis = cross(old, new)
            # The rotation that takes old to new by the shortest way has no part about either.
            mark = add(add(mark, cross(axis, mark)), cross(axis, cross(axis, mark)), 1 / (1 + dot(old, new)))
        marks.append(scaled(mark, 1))
    return marks


def cone() -> Drawing:
    """Draw a body on a cone, and the increments of its gyro."""
    drawing = Drawing(
        640, 400, "Coning: what a round on a cone does to the body, and what the sum of increments lacks"
    )
    drawing.text((24, 34), "A round on a cone", size=17, bold=True)
    view = View(20, 24, (165, 296), 200)
    circle = _seen(view, [rim(k) for k in range(0, 361, 5)])
    drawing.area(circle, "sky", "grey")
    apex = view.at((0, 0, 0))
    slopes = {math.atan2(x - apex[0], apex[1] - y): (x, y) for x, y in circle}
    for slope in (min(slopes), max(slopes)):
        drawing.line([apex, slopes[slope]], "grey", width=1.4)
    marks = pointers()
    for degree in range(80, 320, 40):
        tip = add(rim(degree), marks[degree], 0.17)
        drawing.arrow([view.at(rim(degree)), view.at(tip)], "grey", width=1.6)
    drawing.arrow([apex, view.at(rim(0))], "blue", width=2.8)
    first, last = marks[0], marks[_ROUND]
    between = [scaled(add(scaled(first, 1 - k / 12), last, k / 12), 0.22) for k in range(13)]
    drawing.area([view.at(rim(0)), *(view.at(add(rim(0), v)) for v in between)], "sand", "orange", width=1.4)
    drawing.arrow([view.at(rim(0)), view.at(add(rim(0), first, 0.34))], "green", width=2.4)
    drawing.arrow([view.at(rim(0)), view.at(add(rim(0), last, 0.34))], "orange", width=2.4)
    drawing.dot(view.at(rim(0)), "ink", 4)
    drawing.text((apex[0] + 24, apex[1] - 2), "axis of the body", "blue", bold=True)
    x, y = view.at(add(rim(0), first, 0.34))
    drawing.text((x - 8, y + 18), "before", "green", bold=True, anchor="middle")
    x, y = view.at(add(rim(0), last, 0.34))
    drawing.text((x + 8, y + 5), "after", "orange", bold=True)
    drawing.text((24, 338), "No gyro rate about the blue axis,")
    drawing.text((24, 359), "and yet the mark on the body")
    drawing.text((24, 380), "has turned about it.")
    _increments(drawing, (350, 270))
    return drawing


def _increments(drawing: Drawing, corner: Point) -> None:
    """Draw a sum of four increments: the area that it cuts off is the coning correction."""
    x, y = corner
    drawing.text((x - 6, 34), "What the gyro delivers", size=17, bold=True)
    centre, radius = (x + 128, y - 62), 132

    def at(angle_deg: float) -> Point:
        a = math.radians(angle_deg)
        return centre[0] + radius * math.cos(a), centre[1] - radius * math.sin(a)

    first, last = 205, -25
    path = [at(first + (last - first) * k / 40) for k in range(41)]
    drawing.area(path, "sand", "orange", width=1.4)
    places = [at(first + (last - first) * k / 4) for k in range(5)]
    for k in range(4):
        drawing.arrow([places[k], places[k + 1]], "green", width=2.4)
        mid = ((places[k][0] + places[k + 1][0]) / 2, (places[k][1] + places[k + 1][1]) / 2)
        out = math.hypot(mid[0] - centre[0], mid[1] - centre[1])
        px = centre[0] + (mid[0] - centre[0]) * (out - 20) / out
        py = centre[1] + (mid[1] - centre[1]) * (out - 20) / out
        drawing.text((px, py + 5), f"d{k + 1}", "green", bold=True, anchor="middle")
    drawing.arrow([places[0], places[4]], "blue", width=2.8)
    drawing.text((centre[0], places[0][1] + 24), "sum of the increments", "blue", bold=True, anchor="middle")
    drawing.text((centre[0], centre[1] + 8), "coning correction", "orange", bold=True, anchor="middle")
    drawing.text((x - 6, 338), "The area that the sum cuts off")
    drawing.text((x - 6, 359), "is the turn that it lacks, about")
    drawing.text((x - 6, 380), "the axis upright on the paper.")


SCENES: dict[str, Callable[[], Drawing]] = {"vehicle": vehicle, "frames": frames, "cone": cone}
