"""Writes a family of filters as the file that `catalogue.methods.windows` reads."""

from __future__ import annotations

import json
from collections.abc import Iterator
from decimal import Decimal
from fractions import Fraction

from strapgen.catalogue.methods.window import Taps, Window
from strapgen.catalogue.methods.windows import stored_sizes
from strapgen.design.filters import responses


def written(family: Window, command: str) -> str:
    """Return a family as a TOML file that says which command designed it."""
    levels = ", ".join(
        f"{responses.level(family, m):.6e}" for m in range(0 if family.gyro else 1, family.degree + 1)
    )
    lines = [
        f"# Designed by: {command}",
        f"# Levels of F_{0 if family.gyro else 1} to F_{family.degree}: {levels}",
        *(f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in _head(family).items()),
    ]
    lines += _filters(family.filters)
    if family.gyro is not None:
        lines += ["", "[gyro]"]
        lines += [f'{key} = "{number(value)}"' for key, value in vars(family.gyro).items()]
    sizes = stored_sizes(family.previous, family.ahead, family.gyro is None)
    tables = [("one_sided", family.one_sided_with(ahead)) for _, ahead in sizes]
    for key, one in tables + [("start", one) for one in family.start]:
        lines += ["", f"[[{key}]]", f"previous = {one.previous}", f"ahead = {one.ahead}"]
        lines += [f'objective = "{one.objective}"', f'noise = "{number(one.noise)}"']
        lines += [f'band = "{number(one.band)}"'] if one.band != family.band else []
        lines += _filters(one.filters)
    return "\n".join(lines) + "\n"


def _head(family: Window) -> dict[str, str | int]:
    head: dict[str, str | int] = {
        "name": family.title,
        "source": family.source,
        "previous": family.previous,
        "ahead": family.ahead,
        "increments": family.increments,
        "conditions": family.conditions,
        "band": number(family.band),
        "objective": family.objective,
        "noise": number(family.noise),
        "rotation": family.rotation,
    }
    return head | ({"terms": family.terms} if family.rotation == "exact" else {})


def _filters(rows: tuple[Taps, ...]) -> Iterator[str]:
    yield "filters = ["
    for row in rows:
        yield f"  [{', '.join(chr(34) + str(tap) + chr(34) for tap in row)}],"
    yield "]"


def number(value: Fraction) -> str:
    """Return a number as a decimal if it is one, otherwise as a fraction.

    >>> number(Fraction(13, 10)), number(Fraction(3, 10000)), number(Fraction(1, 3)), number(Fraction(-40))
    ('1.3', '0.0003', '1/3', '-40')
    """
    digits = next((n for n in range(13) if (value * 10**n).denominator == 1), None)
    if digits is None:
        return str(value)
    return format(Decimal((value * 10**digits).numerator).scaleb(-digits), "f")
