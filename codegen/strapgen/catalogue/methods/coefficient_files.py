"""Reads files of exact coefficients, which are TOML: their bytes, their keys and the name that their title gives."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from strapgen.support import checks
from strapgen.support.exceptions import InputError


def content(path: str | Path, what: str, most_bytes: int) -> dict[str, Any]:
    """Return the content of a TOML file.

    Parameters
    ----------
    path : path
    what : str
        What the file holds, for an error message: "a tableau".
    most_bytes : int
        A longer file is refused.

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
        return tomllib.loads(data.decode("utf-8-sig").replace("\r\n", "\n"))
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is not UTF-8 (byte {error.start})") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is not TOML ({error})") from None


def check_keys(data: Mapping[str, Any], keys: Collection[str], optional: Collection[str]) -> None:
    """Check that a table has all keys that it needs, no other, and that its name and source are texts.

    Raises
    ------
    InputError
        If it does not; the message names the first key.
    """
    for key in data:
        if key not in keys:
            raise InputError(f"key {key!r} is not known; allowed: {', '.join(keys)}")
    for key in keys:
        if key not in data and key not in optional:
            raise InputError(
                f"key {key} is missing; needed: {', '.join(k for k in keys if k not in optional)}"
            )
    for key in ("name", "source"):
        if key in keys and not checks.text(key, data[key]).strip():
            raise InputError(f"{key} is empty; a text is needed")


def entries(what: str, value: Any) -> list[Any]:
    """Return a value that must be a list.

    Raises
    ------
    InputError
        If it is none.
    """
    if not isinstance(value, list):
        raise InputError(f"{what} is of type {type(value).__name__}; a list is needed")
    return value


def slug(title: str) -> str:
    """Return a title as a name on the command line.

    Raises
    ------
    InputError
        If it does not begin with a letter.

    Examples
    --------
    >>> slug("Bogacki & Shampine 3(2)")
    'bogacki-shampine-3-2'
    """
    name = re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")
    if not name[:1].isalpha():
        raise InputError(f"name {title!r} must begin with a letter from a to z, for its name in code")
    return name
