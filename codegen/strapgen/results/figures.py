"""Common parts of all plots: matplotlib without a display, kinds of image files, axes, legends, and colours.

In SVG each colour has a counterpart for dark pages.
"""

from __future__ import annotations

import io
import math
import os
import re
import textwrap
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from strapgen.ir.exceptions import InputError, MissingExtraError

#: Resolution of images of pixels, in dots per inch.
RESOLUTION_DPI = 150
#: Colours that the colour-blind tell apart too; the first three are those of M. Okabe and K. Ito, 2008.
COLOURS = ("#0072b2", "#d55e00", "#009e73")
_SEVERAL = (*COLOURS, "#332288", "#cc79a7", "#8c5a00", "#88001b", "#6b6b6b")
#: End of the colours from dark to light, the last of which still shows on white.
LIGHTEST = 0.62
#: Characters of a title on an inch.
_CHARACTERS = 11.5
#: Where a label can stand beside its point, in points of 1/72 inch: left and below, and so on.
_PLACES = [(x, y) for x in (-7, 7) for y in (-11, -2, -21, -31, -41, 5, 15, 25)]
#: Colour of paper, and of ink, on light and on dark pages.
PAPER, INK = "#ffffff", "#22303c"
DARK_PAPER, DARK_INK = "#0f151b", "#dbe5ed"
#: Families of fonts for text; the figures of matplotlib are laid out in DejaVu Sans, which is wider than the others.
FONTS = "Helvetica, Arial, 'DejaVu Sans', sans-serif"


def pyplot() -> Any:
    """Return matplotlib's pyplot, drawing to files alone."""
    before = os.environ.get("MPLBACKEND")
    os.environ["MPLBACKEND"] = "agg"  # a backend of the user's that is not installed would stop the import
    try:
        import matplotlib
    except ImportError:
        raise MissingExtraError("plots need matplotlib: pip install 'strapgen[plot]'") from None
    finally:
        if before is None:
            del os.environ["MPLBACKEND"]
        else:
            os.environ["MPLBACKEND"] = before
    matplotlib.use("Agg")
    import matplotlib.pyplot

    return matplotlib.pyplot


def require_kind(path: str | Path) -> str:
    """Return the kind of image of a file's ending."""
    pyplot()
    from matplotlib.backend_bases import FigureCanvasBase

    kind = Path(path).suffix.lstrip(".").lower()
    allowed = sorted({*FigureCanvasBase.get_supported_filetypes()} - {"pgf"})  # pgf takes a TeX system
    if kind not in allowed:
        raise InputError(f"plot {path}: file type {kind!r} is not known; allowed: {', '.join(allowed)}")
    return kind


def image(figure: Any, path: str | Path) -> bytes:
    """Return a figure as the content of an image file, of the kind of the file's ending; it is closed.

    SVG has its text as text, and colours for light and for dark pages.
    """
    pyplot().close(figure)  # pyplot lets go of it, it can still be drawn
    kind = require_kind(path)
    content = io.BytesIO()
    if kind != "svg":
        figure.savefig(content, format=kind, dpi=RESOLUTION_DPI)
        return content.getvalue()
    # The same figure has the same text: without the date, the version and random names.
    with pyplot().rc_context({"svg.hashsalt": "strapgen", "svg.fonttype": "none"}):
        figure.savefig(content, format=kind, metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    return for_both_pages(content.getvalue().decode()).encode()


def grid_of_axes(rows: int, columns: int, size: tuple[float, float], **options: Any) -> tuple[Any, Any]:
    """Return a figure of a size in inches, and its axes as an array (rows, columns), with the axis of x shared."""
    figure, grid = pyplot().subplots(
        rows, columns, figsize=size, sharex=True, layout="constrained", squeeze=False, **options
    )
    return figure, grid


def colours(count: int, last: float) -> Any:
    """Return so many colours from dark to light, which end at `last` from 0 to 1."""
    import numpy as np

    return pyplot().get_cmap("viridis")(np.linspace(0.0, last, count))


def several_colours(count: int) -> list[str]:
    """Return so many colours that are told apart without an order."""
    return [_SEVERAL[number % len(_SEVERAL)] for number in range(count)]


def title(figure: Any, text: str) -> None:
    """Write a title at the left of a figure, each of its lines on as many as the width needs."""
    width = int(figure.get_figwidth() * _CHARACTERS)
    lines = [line for one in printable(text).splitlines() for line in textwrap.wrap(one, width)]
    figure.suptitle("\n".join(lines), fontsize=11, x=0.01, ha="left")


def printable(text: str) -> str:
    """Return text without characters that cannot be encoded, as names of files may have them."""
    return text.encode(errors="replace").decode()


def style(axes: Any, grid: str = "both") -> None:
    """Give axes an open frame and a light grid."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25, linewidth=0.6, axis=grid)


def style_over_time(axes: Any) -> None:
    """Give axes of a quantity over time their look, with a line at zero."""
    style(axes)
    axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 3), useMathText=True)
    axes.margins(x=0)
    axes.axhline(0, color="0.6", linewidth=0.8, zorder=0)


def step_ticks(axes: Any, steps: Iterable[float]) -> None:
    """Show steps in s on a logarithmic axis of x, as fractions where they are."""
    steps = list(steps)
    axes.set_xscale("log", base=2)
    axes.set_xticks(steps, [fraction(step) for step in steps])
    axes.minorticks_off()
    axes.set_xlabel("step, s")


def labels_at_the_right(axes: Any, labels: Iterable[tuple[float, str, Any]]) -> None:
    """Write labels beside the right end of axes, at a height in data or a little off, so that none covers another."""
    height = axes.get_position().height * axes.figure.get_size_inches()[1]
    apart = 11.5 / 72 / height  # a line of text, as a part of the height
    upwards = sorted(labels, key=lambda label: label[0])
    places = [_height(axes, value) for value, _, _ in upwards]
    for number in range(1, len(places)):
        places[number] = max(places[number], places[number - 1] + apart)
    for number in reversed(range(len(places))):
        limit = 1.0 if number == len(places) - 1 else places[number + 1] - apart
        places[number] = min(places[number], limit)
    for place, (_, text, colour) in zip(places, upwards, strict=True):
        axes.text(
            1.01, place, printable(text), transform=axes.transAxes, fontsize=9, color=colour, va="center"
        )


def labels_beside_points(
    axes: Any, points: Mapping[str, tuple[float, float]], colours: Mapping[str, Any]
) -> None:
    """Write labels beside points in data, each where it covers no other label and stays inside the axes."""
    boxes: list[Any] = []
    frame = axes.get_window_extent()
    for text, point in points.items():
        best: tuple[float, Any, Any] | None = None
        for place in _PLACES:
            label = axes.annotate(
                printable(text),
                point,
                xytext=place,
                textcoords="offset points",
                ha="left" if place[0] > 0 else "right",
                fontsize=8,
                color=colours[text],
            )
            box = label.get_window_extent()
            outside = max(0.0, box.x1 - frame.x1) + max(0.0, frame.x0 - box.x0)
            cost = outside + 1000 * sum(box.overlaps(other) for other in boxes)
            if best is None or cost < best[0]:
                if best is not None:
                    best[1].remove()
                best = cost, label, box
            else:
                label.remove()
            if not best[0]:
                break
        assert best is not None, "there are places"
        boxes.append(best[2])


def _height(axes: Any, value: float) -> float:
    """Return the place of a number between the lower and the upper end of axes, 0 to 1."""
    low, high = map(float, axes.get_ylim())
    if axes.get_yscale() == "log":
        low, high, value = math.log(low), math.log(high), math.log(value) if value > 0 else -math.inf
    return min(1.0, max(0.0, (value - low) / (high - low)))


def common_legend(figure: Any, panels: Iterable[Any], **options: Any) -> None:
    """Give panels one legend outside of them, each label once."""
    handles: dict[str, Any] = {}
    for axes in panels:
        handles |= {label: handle for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), frameon=False, fontsize=9, **options)


def fraction(number: float) -> str:
    """Return a number as text, as 1/n where it is one."""
    parts = round(1 / number)
    return f"1/{parts}" if parts > 1 and abs(parts * number - 1) < 1e-9 else f"{number:g}"


#: Red, green and blue, each 0 to 1.
RGB = tuple[float, float, float]
#: Chroma in OKLab below which a colour is a grey.
_GREY = 0.02
# B. Ottosson, "A perceptual color space for image processing", 2020: linear RGB to cones, and these to OKLab.
_TO_CONES = (
    (0.4122214708, 0.5363325363, 0.0514459929),
    (0.2119034982, 0.6806995451, 0.1073969566),
    (0.0883024619, 0.2817188376, 0.6299787005),
)
_TO_LAB = (
    (0.2104542553, 0.7936177850, -0.0040720468),
    (1.9779984951, -2.4285922050, 0.4505937099),
    (0.0259040371, 0.7827717662, -0.8086757660),
)
_TO_RGB = (
    (4.0767416621, -3.3077115913, 0.2309699292),
    (-1.2684380046, 2.6097574011, -0.3413193965),
    (-0.0041960863, -0.7034186147, 1.7076147010),
)
_FROM_LAB = (
    (1.0, 0.3963377774, 0.2158037573),
    (1.0, -0.1055613458, -0.0638541728),
    (1.0, -0.0894841775, -1.2914855480),
)


def for_both_pages(svg: str) -> str:
    """Return an SVG of matplotlib's that can be read on light and on dark pages; black ink becomes a soft one.

    Colours stay as they are for programs that know no style sheets of dark pages.

    >>> svg = for_both_pages('<svg><style type="text/css"></style><path style="stroke: #0072b2"/></svg>')
    >>> "[style*='stroke: #0072b2'] { stroke: #55aff3 !important }" in svg
    True
    """
    svg = svg.replace("#000000", INK)
    svg = re.sub(r"'DejaVu Sans', .*?sans-serif", FONTS, svg)
    used = sorted(set(re.findall(r"\b(fill|stroke): (#[0-9a-f]{6})", svg)))
    rules = [
        f"[style*='{kind}: {colour}'] {{ {kind}: {on_dark(colour)} !important }}" for kind, colour in used
    ]
    sheet = "\n".join(
        [
            f"text {{ fill: {INK} }}",
            "@media (prefers-color-scheme: dark) {",
            f"text {{ fill: {DARK_INK} }}",
            *rules,
            "}",
        ]
    )
    return svg.replace("</style>", f"\n{sheet}\n</style>", 1)


def on_dark(colour: str) -> str:
    """Return the counterpart of a colour ``#rrggbb`` on dark paper: the same hue, light where the colour is dark.

    >>> on_dark(PAPER) == DARK_PAPER, on_dark(INK) == DARK_INK
    (True, True)
    """
    fixed = {PAPER: DARK_PAPER, INK: DARK_INK}
    if colour in fixed:
        return fixed[colour]
    lightness, a, b = to_oklab(linear(colour))
    if a * a + b * b < _GREY**2:
        return _written(_from_oklab((0.95 - 0.66 * lightness, a, b)))
    return _written(_from_oklab((0.95 - 0.42 * lightness, a, b)))


def contrast(one: str, other: str) -> float:
    """Return the contrast of two colours as the Web Content Accessibility Guidelines define it, 1 to 21.

    >>> round(contrast("#000000", "#ffffff"), 9)
    21.0
    """
    low, high = sorted(
        sum(w * c for w, c in zip((0.2126, 0.7152, 0.0722), linear(x), strict=True)) for x in (one, other)
    )
    return (high + 0.05) / (low + 0.05)


def linear(colour: str) -> RGB:
    """Return red, green and blue in proportion to light, from ``#rrggbb`` as sRGB encodes it."""
    red, green, blue = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return _decoded(red), _decoded(green), _decoded(blue)


def to_oklab(light: RGB) -> RGB:
    """Return lightness and the two axes of colour in OKLab, from linear red, green and blue."""
    long, medium, short = (max(0.0, cone) ** (1 / 3) for cone in _times(_TO_CONES, light))
    return _times(_TO_LAB, (long, medium, short))


def _from_oklab(lab: RGB) -> RGB:
    long, medium, short = _times(_FROM_LAB, lab)
    return _times(_TO_RGB, (long**3, medium**3, short**3))


def _times(matrix: tuple[RGB, RGB, RGB], vector: RGB) -> RGB:
    x, y, z = (sum(m * v for m, v in zip(row, vector, strict=True)) for row in matrix)
    return x, y, z


def _decoded(value: float) -> float:
    return value / 12.92 if value <= 0.04045 else float(((value + 0.055) / 1.055) ** 2.4)


def _written(light: RGB) -> str:
    """Return linear red, green and blue as ``#rrggbb``; what a screen cannot show is cut off."""
    parts = []
    for value in light:
        value = min(1.0, max(0.0, value))
        encoded = 12.92 * value if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055
        parts.append(f"{round(255 * encoded):02x}")
    return "#" + "".join(parts)
