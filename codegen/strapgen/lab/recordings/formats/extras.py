"""Packages of the extra `logs`, which are imported when a file needs them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from strapgen.ir.exceptions import InputError, MissingExtraError, StrapgenError


def package(name: str, files: str) -> Any:
    """Return a module of the extra."""
    try:
        return import_module(name)
    except ImportError:
        of = name.partition(".")[0]
        raise MissingExtraError(f"{files} need {of}: pip install 'strapgen[logs]'") from None


@contextmanager
def refusing(path: Path, what: str) -> Iterator[None]:
    """Refuse a file in one line, whatever a package has to say of it."""
    try:
        yield
    except StrapgenError:
        raise
    except MemoryError:
        raise InputError(f"{path} states sizes beyond the memory of this computer") from None
    except Exception as error:
        said = str(error).strip().splitlines()
        reason = getattr(error, "strerror", None) or (said[0] if said else type(error).__name__)
        raise InputError(f"{path} cannot be read as {what} ({reason})") from None
