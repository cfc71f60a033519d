"""Colours of a dark page in SVG text: each colour of a drawing gets a counterpart that reads on black."""

from __future__ import annotations

import re

#: Red, green and blue, each 0 to 1.
RGB = tuple[float, float, float]

#: Colour of paper, and of ink, on light and on dark pages.
PAPER, INK = "#ffffff", "#22303c"
DARK_PAPER, DARK_INK = "#0f151b", "#dbe5ed"
#: Families of fonts for text; the figures of matplotlib are laid out in DejaVu Sans, which is wider than the others.
FONTS = "Helvetica, Arial, 'DejaVu Sans', sans-serif"
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
