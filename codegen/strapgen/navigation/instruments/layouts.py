"""Derives the kernels of a layout that a file describes: the separation of rate and acceleration, and its inverse."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import sympy as sp

from strapgen.ir.exceptions import InputError
from strapgen.kernel.algebra import exact
from strapgen.kernel.kernel import Kernel
from strapgen.navigation.instruments.layout import GyroDescription, Layout
from strapgen.navigation.instruments.separation import (
    UNBALANCE,
    TwoAxisGyro,
    determinant,
    measuring_kernel,
    noise_gains,
    separating_kernel,
)

#: Most characters of an exact number in a note; a longer one without a symbol is shown with six digits.
_MOST_CHARACTERS = 30


def gyros(layout: Layout) -> tuple[TwoAxisGyro, ...]:
    """Return the gyros of a layout.

    >>> from fractions import Fraction
    >>> from strapgen.navigation.instruments.layout import Unbalance
    >>> one = GyroDescription((1, 0, 0), (0, 1, 0), Fraction(30), Unbalance(-1, "B"))
    >>> gyros(Layout("mine", "Mine", "our drawing", 1, (one,)))[0].x.T
    Matrix([[sqrt(3)/2, 1/2, 0]])
    """
    return tuple(_gyro(one) for one in layout.gyros)


def separate(layout: Layout) -> Kernel:
    """Return the separation of rate and acceleration for a layout."""
    kernel = _named(separating_kernel, "separate", "Separation of rate and acceleration", layout)
    described = gyros(layout)
    gains = [_text(gain) for gain in noise_gains(described, layout.sign)]
    return replace(
        kernel,
        notes=(
            *kernel.notes,
            f"The determinant of the six torques is {_text(determinant(described, layout.sign))} in magnitude.",
            "Equal, independent noise of 1 rad on all torques becomes "
            f"{_list(gains[:3])} in the rates x, y and z, and {_list(gains[3:])} m/s in the accelerations.",
        ),
    )


def measure(layout: Layout) -> Kernel:
    """Return the torques of a layout, which `separate` takes apart; parameters and errors are its."""
    return _named(measuring_kernel, "torques", "Torques of mass-unbalanced gyros", layout)


def _named(build: Any, name: str, title: str, layout: Layout) -> Kernel:
    """Return a kernel of a layout with its name, its options on the command line and its sign."""
    try:
        kernel: Kernel = build(
            f"{name}-{layout.name}", f"{title}: {layout.title}", layout.source, gyros(layout), layout.sign
        )
    except InputError as error:
        raise InputError(f"{layout.file or layout.title}: {error}") from None
    sign = "+" if layout.sign > 0 else "-"
    note = f"About each torquer axis a gyro measures M = W {sign} B A of rate W and acceleration A."
    return replace(kernel, arguments=f"{name} {layout.option}", notes=(*kernel.notes, note))


def _gyro(one: GyroDescription) -> TwoAxisGyro:
    """Return a gyro in expressions."""
    name = one.unbalance.symbol
    symbol = UNBALANCE if name == UNBALANCE.name else sp.Symbol(name, real=True, nonzero=True)
    x, y = (sp.Matrix([exact(element) for element in axis]) for axis in (one.x, one.y))
    gyro = TwoAxisGyro(x, y, exact(one.unbalance.factor) * (symbol if name else 1))
    return gyro.turned(exact(one.turn_deg) * sp.pi / 180) if one.turn_deg else gyro


def _text(value: sp.Expr) -> str:
    """Return an exact number or formula as text; a long number with six digits."""
    text = re.sub(r"Abs\(([^()]*)\)", r"|\1|", str(value).replace("**", "^"))
    return f"{float(value):.6g}" if len(text) > _MOST_CHARACTERS and not value.free_symbols else text


def _list(words: Iterable[str]) -> str:
    """Return words with commas and an "and" between them."""
    *first, last = words
    return f"{', '.join(first)} and {last}"
