"""The pictures of the pages: in step with what draws them, readable on both grounds, and right in what they show."""

from __future__ import annotations

import math
import re
import sys
from itertools import combinations
from pathlib import Path

import pytest

import strapgen
from strapgen.results.figures import DARK_PAPER, PAPER, contrast, on_dark

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "docs" / "figures"))

import canvas  # noqa: E402
import draw  # noqa: E402
import pipeline_scene  # noqa: E402
import scenes  # noqa: E402

#: The Web Content Accessibility Guidelines 2.1, 1.4.3, ask for this contrast of text.
TEXT = 4.5


def test_pictures_are_the_output_of_their_script():
    """If this fails, run python docs/figures/draw.py."""
    pictures = draw.pictures()
    assert len(pictures) == 4
    assert [path.name for path, text in pictures.items() if path.read_text() != text] == []


def test_the_pipeline_has_the_stages_of_the_page_on_the_architecture_in_their_order():
    listed = pipeline_scene.stages(ROOT)
    assert [*listed] == ["derive", "lower", "quantize", "generate", "build"]
    words = [entry[3] for entry in pipeline_scene.pipeline(ROOT).words]
    assert {*listed, *(result for result, _ in listed.values())} <= {*words}


def test_a_stage_that_returns_something_else_is_seen(monkeypatch):
    monkeypatch.setattr(strapgen, "lower", strapgen.derive)
    with pytest.raises(ValueError, match="lower returns Kernel; the page or the drawing has Program"):
        pipeline_scene.pipeline(ROOT)


def test_words_stay_inside_their_picture_and_apart_from_each_other():
    drawings = {name: scene() for name, scene in scenes.SCENES.items()}
    drawings["pipeline"] = pipeline_scene.pipeline(ROOT)
    wrong = []
    for name, drawing in drawings.items():
        for left, top, right, words in drawing.words:
            if left < 4 or top < 4 or right > drawing.width - 4 or top + 16 > drawing.height - 4:
                wrong.append((name, words))
        for one, other in combinations(drawing.words, 2):
            if one[0] < other[2] and other[0] < one[2] and abs(one[1] - other[1]) < 12:
                wrong.append((name, one[3], other[3]))
    assert wrong == []


def test_the_colours_of_words_read_on_both_grounds():
    for colour in canvas.COLOURS.values():
        for ground in (PAPER, *canvas.GROUNDS.values()):
            assert contrast(colour, ground) > TEXT
        for ground in (DARK_PAPER, *canvas.DARK_GROUNDS.values()):
            assert contrast(on_dark(colour), ground) > TEXT
    text = scenes.cone().svg()
    for kind in set(re.findall(r'class="([\w-]+)', text)):
        assert text.count(f"\n.{kind}") >= 2, kind  # a rule for each ground


def test_a_mark_on_the_body_turns_by_the_solid_angle_of_the_cone():
    marks = scenes.pointers()
    turned = math.acos(scenes.dot(marks[0], marks[-1]))
    solid = 2 * math.pi * (1 - math.cos(math.radians(scenes._HALF_ANGLE_DEG)))
    # The round is a polygon of 7200 sides: its area is off by the square of a side times their number.
    assert turned == pytest.approx(solid, abs=(2 * math.pi) ** 2 / 7200)
    assert all(abs(scenes.dot(mark, scenes.rim(k))) < 1e-3 for k, mark in enumerate(marks))


def test_axes_are_right_handed_in_a_view_and_the_far_side_is_hidden():
    view = canvas.View(30, 20, (0, 0), 1)
    x, y, z = (view.at(axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))
    # Seen from between the axes, x, y and z stand counterclockwise; pixels count downwards.
    turns = [a[0] * -b[1] + a[1] * b[0] for a, b in ((x, y), (y, z), (z, x))]
    assert min(turns) > 0 and min(view.eye()) > 0
