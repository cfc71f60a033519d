"""Reads TOML files of users, and says in one line what is wrong with one."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError


def content(
    path: str | Path, what: str, most_bytes: int, parse_float: Callable[[str], Any] = float
) -> dict[str, Any]:
    """Return the content of a TOML file.

    Parameters
    ----------
    path : path
    what : str
        What the file holds, for an error message: "a tableau".
    most_bytes : int
        A longer file is refused.
    parse_float : callable, optional
        Returns the number that a text with a decimal point or an exponent stands for.

    Raises
    ------
    InputError
        If the file cannot be read, is too long, not UTF-8 or not TOML.
    """
    place = checks.path("path", path)
    try:
        with place.open("rb") as file:
            data = file.read(most_bytes + 1)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from None
    if len(data) > most_bytes:
        raise InputError(f"{path} is over {most_bytes} bytes long; {what} is shorter")
    try:
        return tomllib.loads(data.decode("utf-8-sig").replace("\r\n", "\n"), parse_float=parse_float)
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 (byte {error.start})") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is not TOML ({error})") from None
