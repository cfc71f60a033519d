"""Users' TOML files, with errors in one line."""

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
    """Return the content of a TOML file of at most `most_bytes`; error messages say `what` it holds."""
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
