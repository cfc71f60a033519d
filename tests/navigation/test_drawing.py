"""Drawings of described systems: boxes stand apart, wires pass beside them, and all of it fits a page."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations, pairwise
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from navigation.described_files import ATTITUDE, description

from strapgen.ir.signals import Signal
from strapgen.navigation.systems.drawing_routing import Box, Link, Placement, Port, WirePath
from strapgen.navigation.systems.system import Cell, DescribedSystem, Rate, SystemStage, Wire
from strapgen.navigation.systems.system_drawing import drawing, plan
from strapgen.navigation.systems.wiring import read_system

ROOT = Path(__file__).parents[2]
BUILT_IN = ROOT / "codegen" / "strapgen" / "navigation" / "systems" / "built_in_files"
FILES = [*sorted((ROOT / "examples").glob("[as]t*.toml")), BUILT_IN / "two-speed-euler.toml"]

#: Least distance of wires side by side in px: six are seen as six lines.
APART = 6


def faults(placed: Placement) -> list[str]:
    """Return what is wrong with a drawing."""
    boxes, texts = placed.boxes, []
    for a, b in combinations(boxes, 2):
        if a.x < b.x + b.width and b.x < a.x + a.width and a.y < b.y + b.height and b.y < a.y + a.height:
            texts.append(f"{a.name} lies on {b.name}")
    for box in boxes:
        lane = next((one for one in placed.lanes if one.y <= box.y <= one.y + one.height), None)
        if lane is None or box.y + box.height > lane.y + lane.height:
            texts.append(f"{box.name} is in no lane")
        if not (box.x >= 0 and box.x + box.width <= placed.width and box.y + box.height <= placed.height):
            texts.append(f"{box.name} is outside")
    lines = []
    for way in placed.ways:
        (source, start), (destination, end) = way.link.source, way.link.destination
        x, y = way.points[0]
        at_source = start.x if source.kind else source.x + source.width / 2, y
        if (x, y) != at_source or not source.y < y <= source.y + source.height:
            texts.append(f"{way.link.title} does not begin at its box")
        if way.points[-1] != (end.x, end.y) or end.x != destination.x:
            texts.append(f"{way.link.title} does not end at its port")
        for (ax, ay), (bx, by) in pairwise(way.points):
            if ax != bx and ay != by:
                texts.append(f"{way.link.title} is slanting")
            lines.append((way.link, min(ax, bx), max(ax, bx), min(ay, by), max(ay, by)))
    for link, left, right, top, bottom in lines:
        if not (left >= 0 and right <= placed.width and top >= 0 and bottom <= placed.height):
            texts.append(f"{link.title} is outside")
        texts += [
            f"{link.title} passes through {box.name}"
            for box in boxes
            if left < box.x + box.width and right > box.x and top < box.y + box.height and bottom > box.y
        ]
    return texts + [f"{a} and {b} lie on each other" for a, b in sorted(_too_near(lines))]


def _too_near(lines: list[tuple[Link, float, float, float, float]]) -> set[tuple[str, str]]:
    """Return wires of two ports or kinds that go side by side with too little between them."""
    pairs = set()
    for is_level in (True, False):
        some = [
            (link, *(line[2:] + line[:2] if is_level else line))
            for link, *line in lines
            if (line[2] == line[3]) == is_level and line[0] + line[2] != line[1] + line[3]
        ]
        for (a, across, _, low, high), (b, across_b, _, low_b, high_b) in combinations(some, 2):
            if a.net != b.net and abs(across - across_b) < APART and low < high_b and low_b < high:
                pairs.add((a.title, b.title))
    return pairs


@pytest.mark.long
@pytest.mark.parametrize("path", FILES, ids=[path.stem for path in FILES])
def test_a_drawing_of_an_example_has_no_faults_and_fits_a_page(path):
    system = read_system(path)
    placed = plan(system.system)
    assert faults(placed) == []
    assert placed.width <= 1500
    assert max(np.bincount([box.row for box in placed.boxes])) <= 4
    stages = sorted(placed.boxes, key=lambda box: (box.row, box.every))
    assert [box.every for box in stages] == sorted(box.every for box in placed.boxes)
    tree = ElementTree.fromstring(drawing(SimpleNamespace(description=system)))
    _, _, width, height = map(float, tree.get("viewBox").split())
    for text in tree.iter("{http://www.w3.org/2000/svg}text"):
        assert 0 <= float(text.get("x")) <= width
        assert 0 <= float(text.get("y")) <= height


@st.composite
def systems(draw) -> DescribedSystem:
    """Stages of up to four rates, wired at random: forward, back, to themselves, and to shared states."""
    names = [f"s{number}" * draw(st.integers(1, 9)) for number in range(draw(st.integers(1, 11)))]
    vector = Signal.labelled("value", "v", "xyz", meaning="a value", unit="rad/s", frame="b")
    inputs = tuple(
        Signal.labelled(f"input{number}", "v", "xyz", meaning="an input", unit="m/s", frame="n")
        for number in range(draw(st.integers(1, 6)))
    )
    outputs = {name: [f"{name}_out{k}" for k in range(draw(st.integers(1, 3)))] for name in names}
    cells = [cell for some in outputs.values() for cell in some]
    rates: dict[int, list[SystemStage]] = {}
    every = 1
    for name in names:
        every *= draw(st.sampled_from([1, 1, 1, 2]))
        sources = draw(st.lists(st.sampled_from([*cells, *(one.name for one in inputs)]), max_size=4))
        wires = tuple(Wire(f"in{k}", source, source not in cells) for k, source in enumerate(sources))
        results = [(cell.removeprefix(f"{name}_"), cell) for cell in outputs[name]]
        if sources and sources[0] in cells and draw(st.booleans()):
            results.append(("next", sources[0]))  # a state of another stage, or a delayed wire to itself
        rates.setdefault(every, []).append(SystemStage(name, "kernel", every, wires, tuple(results)))
    return DescribedSystem(
        "random",
        "A system",
        Fraction(1000),
        inputs,
        tuple(Cell(cell, vector, (Fraction(0),) * 3) for cell in cells),
        tuple(Rate(every, tuple(stages)) for every, stages in rates.items()),
        tuple(draw(st.lists(st.sampled_from(cells), max_size=2))),
    )


@settings(max_examples=40, deadline=None)
@given(systems())
def test_a_drawing_of_a_random_system_has_no_faults(system):
    placed = plan(system)
    assert faults(placed) == []
    assert placed.width <= 1500
    assert {way.link.title for way in placed.ways} == {link.title for link in placed.links}


def test_a_wire_from_a_stage_to_itself_is_drawn_and_its_own_state_is_not(tmp_path):
    units = {"velocity": "m/s", "rate": "rad/s"}
    text = 'name = "loop"\nsample_hz = 10\n' + "".join(
        f'[inputs.{name}]\nunit = "{unit}"\nframe = "n"\nrange = 1\n' for name, unit in units.items()
    )
    text += """
[[stage]]
name = "again"
kernel = "coriolis-gravity"
every = 1
delay = { gravity = 1 }
ranges = { gravity = 20 }
[stage.wires]
velocity = "velocity"
earth_rate = "rate"
transport_rate = "rate"
gravity = "again.acceleration"
"""
    placed = plan(description(tmp_path, text).system)
    assert faults(placed) == []
    delayed = [way.link.title for way in placed.ways if way.link.kind == "delayed"]
    assert delayed == ["again.acceleration → again.gravity, one cycle late"]
    attitude = plan(description(tmp_path, ATTITUDE).system)
    assert not [link for link in attitude.links if link.source[0] is link.destination[0]]


def test_faults_of_a_drawing_are_noticed():
    first, second = (Box(name, "kernel", 1, x=0, y=0, width=100) for name in ("first", "second"))
    link = Link(
        (first, Port("out", "1", "", x=100, y=10)), (second, Port("in", "1", "", x=0, y=20)), "forward"
    )
    other = Link((first, Port("more", "1", "", x=100, y=10)), (second, Port("in", "1", "")), "forward")
    ways = [WirePath(one, ((100, 10), (-20, 14), (-20, 30), (5, 30))) for one in (link, other)]
    texts = " ".join(faults(Placement([first, second], [link, other], ways=ways, width=50, height=50)))
    for words in ("lies on", "in no lane", "outside", "end at its port", "slanting", "passes through"):
        assert words in texts
    assert "first.out → second.in and first.more → second.in lie on each other" in texts
