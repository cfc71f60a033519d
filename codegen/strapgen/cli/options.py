"""Options and arguments that several commands share, and how data is printed."""

from __future__ import annotations

import json
import sys
from typing import Annotated, Any

import typer

from strapgen import checks
from strapgen.exceptions import InputError

Algorithm = Annotated[
    str, typer.Argument(help="dcm, euler, cayley-klein, or another kernel; see strapgen list.")
]
Method = Annotated[
    str | None,
    typer.Option(
        "--method", help="Integration method; see strapgen list.  [default: rk4]", show_default=False
    ),
]
Increments = Annotated[
    str | None,
    typer.Option(
        "--increments", metavar="N", help="Angle increments a step, 1 to 8.  [default: 2]", show_default=False
    ),
]
Rates = Annotated[
    bool,
    typer.Option("--rates", help="The step takes the rate at the method's nodes, times the step length."),
]
Format = Annotated[str, typer.Option("--format", help="text or json.")]


def check_format(value: str, *more: str) -> str:
    """Check the value of --format: text, json, or one of `more`."""
    return checks.choice("format", value, ["text", "json", *more])


def print_json(data: Any) -> None:
    """Print data as JSON: a list on one line, an object indented."""
    sys.stdout.write(json.dumps(data, indent=None if isinstance(data, list) else 1) + "\n")


def whole(what: str, value: str | None) -> int | None:
    """Read an option that takes a whole number."""
    if value is None:
        return None
    try:
        return int(value)
    except ValueError:
        raise InputError(f"{what} is {value!r}; a whole number is needed") from None
