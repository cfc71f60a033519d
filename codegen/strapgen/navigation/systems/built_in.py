"""The systems that strapgen brings, as files of the form that it reads; a command takes their names."""

from __future__ import annotations

import os
from pathlib import Path

from strapgen.ir import checks
from strapgen.storage import streams

_FOLDER = Path(__file__).parent / "built_in_files"


def names() -> dict[str, str]:
    """Return the names of the built-in systems, with the titles of their files.

    >>> list(names())
    ['two-speed-dcm', 'two-speed-dcm-1', 'two-speed-euler', 'two-speed-euler-1']
    """
    return {
        name: _title(_FOLDER / f"{name}.toml")
        for name in sorted(path.stem for path in _FOLDER.glob("*.toml"))
    }


def _title(path: Path) -> str:
    """Return the title that a built-in file states."""
    return next(
        line.split('"')[1]
        for line in path.read_text(encoding="utf-8").splitlines()
        if line.startswith("title")
    )


def is_system(name: object) -> bool:
    """Return whether a name stands for a described system: a built-in one, a file that ends with .toml, or -."""
    text = os.fspath(name) if isinstance(name, os.PathLike) else name
    return isinstance(text, str) and (
        text == "-" or text.endswith(".toml") or (_FOLDER / f"{text}.toml").is_file()
    )


def file_of(name: str | Path) -> Path:
    """Return the file of a system: that of a built-in one, or the named file.

    >>> file_of("two-speed-dcm").name, str(file_of("mine.toml"))
    ('two-speed-dcm.toml', 'mine.toml')
    """
    path = checks.path("system", name)
    if path == streams.STANDARD or path.suffix or len(path.parts) != 1 or path.exists():
        return path
    checks.choice("system", str(name), names(), "a TOML file")
    return _FOLDER / f"{name}.toml"
