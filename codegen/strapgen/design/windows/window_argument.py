"""Reads the window of an argument: one of the catalogue by its name, or one of a file."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Annotated

import typer

from strapgen.ir import checks

if TYPE_CHECKING:
    from strapgen.catalogue.methods.window import Window

#: The argument for a window.
WindowArgument = Annotated[
    str,
    typer.Argument(metavar="NAME|FILE", help="A window as window-7-7, or a TOML file with one."),
]


def window_of(argument: str) -> Window:
    """Return a window, its conditions verified; an argument that ends in .toml or holds a path separator is a file."""
    from strapgen.catalogue.methods import windows

    if argument.endswith(".toml") or any(part in argument for part in (os.sep, os.altsep) if part):
        return windows.read(argument)
    if argument not in windows.WINDOWS:
        checks.choice("window", argument, windows.WINDOW_TITLES, "their one-sided filters, as window-14-0")
    window = windows.WINDOWS[argument]
    windows.verify(window)
    return window
