"""Colours of pictures: they read on white and on black, and the colour-blind tell them apart."""

from __future__ import annotations

import math
import re
from itertools import combinations

import pytest

from strapgen.results import figures
from strapgen.results.figures import DARK_PAPER, PAPER, contrast, linear, on_dark, to_oklab

#: The Web Content Accessibility Guidelines 2.1, 1.4.11, ask for this contrast of graphical objects, and 1.4.3 for that
#: of text.
GRAPHICS, TEXT = 3.0, 4.5
#: G. M. Machado et al., "A physiologically-based model for simulation of color vision deficiency", 2009, severity 1:
#: linear red, green and blue as they look without the long, the medium and the short cones.
VISION = {
    "all cones": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "no long cones": (
        (0.152286, 1.052583, -0.204868),
        (0.114503, 0.786281, 0.099216),
        (-0.003882, -0.048116, 1.051998),
    ),
    "no medium cones": (
        (0.367322, 0.860646, -0.227968),
        (0.280085, 0.672501, 0.047413),
        (-0.011820, 0.042940, 0.968881),
    ),
    "no short cones": (
        (1.255528, -0.076749, -0.178779),
        (-0.078411, 0.930809, 0.147602),
        (0.004733, 0.691367, 0.303900),
    ),
}
#: A just noticeable difference is about 0.02 in OKLab; lines are thin and far apart, and need three of them.
TOLD_APART = 0.06


def seen(colour: str, eyes: str) -> tuple[float, float, float]:
    """Return a colour in OKLab as eyes see it."""
    light = linear(colour)
    red, green, blue = (
        min(1.0, max(0.0, sum(m * c for m, c in zip(row, light, strict=True)))) for row in VISION[eyes]
    )
    return to_oklab((red, green, blue))


def nearest(colours: list[str], eyes: str) -> float:
    return min(math.dist(seen(one, eyes), seen(other, eyes)) for one, other in combinations(colours, 2))


@pytest.mark.parametrize("eyes", VISION)
def test_the_colours_of_lines_are_told_apart_by_all_eyes(eyes):
    assert nearest(figures.several_colours(8), eyes) > TOLD_APART


def test_colours_that_some_eyes_do_not_tell_apart_are_seen():
    red_and_green = ["#aa4433", "#5a6e00"]
    assert nearest(red_and_green, "all cones") > 2 * TOLD_APART
    assert nearest(red_and_green, "no medium cones") < TOLD_APART


def test_the_colours_of_lines_show_on_white_and_on_black():
    for colour in figures.several_colours(8):
        assert contrast(colour, PAPER) > GRAPHICS
        assert contrast(on_dark(colour), DARK_PAPER) > TEXT


def test_colours_from_dark_to_light_show_on_white_and_on_black():
    pytest.importorskip("matplotlib")
    from matplotlib.colors import to_hex

    for colour in map(to_hex, figures.colours(10, figures.LIGHTEST)):
        assert contrast(colour, PAPER) > 2.5  # the last of them; most are darker
        assert contrast(on_dark(colour), DARK_PAPER) > TEXT


def test_a_picture_says_what_each_of_its_colours_is_on_black():
    pytest.importorskip("matplotlib")
    figure, grid = figures.grid_of_axes(1, 1, (2, 2))
    grid[0, 0].plot([0, 1], [1, 2], color=figures.COLOURS[1])
    text = figures.image(figure, "a.svg").decode()
    sheet = text[text.index("<style") : text.index("</style>")]
    body = text[text.index("</style>") :]
    used = set(re.findall(r"\b(fill|stroke): (#[0-9a-f]{6})", body))
    assert ("stroke", figures.COLOURS[1]) in used and ("fill", PAPER) in used
    for kind, colour in used:
        assert f"[style*='{kind}: {colour}'] {{ {kind}: {on_dark(colour)} !important }}" in sheet
    assert "#000000" not in text


def test_the_same_picture_is_the_same_text():
    pytest.importorskip("matplotlib")
    texts = []
    for _ in range(2):
        figure, grid = figures.grid_of_axes(1, 1, (2, 2))
        grid[0, 0].plot([0, 1], [1, 2])
        figures.title(figure, "A title")
        texts.append(figures.image(figure, "a.svg").decode())
    assert texts[0] == texts[1] and ">A title</text>" in texts[0]
    assert "matplotlib" not in texts[0].lower().replace("matplotlib.axis", "")


def test_paper_and_ink_change_places():
    assert contrast(figures.INK, PAPER) > 7 and contrast(figures.DARK_INK, DARK_PAPER) > 7
    greys = [on_dark(f"#{level:02x}{level:02x}{level:02x}") for level in range(0, 250, 10)]
    lights = [to_oklab(linear(grey))[0] for grey in greys]
    assert lights == sorted(lights, reverse=True)
