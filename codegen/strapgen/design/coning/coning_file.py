"""Writes coning coefficients as the file that `catalogue.methods.shaped_coning` reads."""

from __future__ import annotations

import json
from collections.abc import Sequence

from strapgen.catalogue.methods.shaped_coning import ShapedConing
from strapgen.design.windows.family_file import number


def written(shape: ShapedConing, command: str, figures: Sequence[str] = ()) -> str:
    """Return coefficients as a TOML file that says which command designed them.

    >>> from strapgen.catalogue.methods.shaped_coning import SHAPES
    >>> print(*written(SHAPES["coning-shaped-8"], "strapgen coning ...").splitlines()[:4], sep=chr(10))
    # Designed by: strapgen coning ...
    name = "Coning 1+8 to 1.3 rad"
    source = "strapgen coning; least largest drift over the band, by exchange"
    samples = 1
    """
    head: dict[str, str | int] = {
        "name": shape.title,
        "source": shape.source,
        "samples": shape.samples,
        "previous": shape.previous,
        "objective": shape.objective,
        "powers": shape.powers,
    }
    if shape.products:
        head["products"] = shape.products
    if shape.band is not None:
        head["band"] = number(shape.band)
    if shape.level is not None:
        head["level"] = str(shape.level)
    lines = [f"# Designed by: {command}", *(f"# {line}" for line in figures)]
    lines += [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in head.items()]
    lines += ["coefficients = [", *(f'  "{value}",' for value in shape.coefficients), "]"]
    if shape.gyro is not None:
        lines += ["", "[gyro]"]
        lines += [f'{key} = "{number(value)}"' for key, value in vars(shape.gyro).items()]
    return "\n".join(lines) + "\n"
