"""Finds the folders of templates and generated sources, in the wheel or in the checkout."""

from __future__ import annotations

import os
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
_INSTALLED = PACKAGE / "_data"
_CHECKOUT = PACKAGE.parent.parent


def checkout() -> Path | None:
    """Return the root of the source checkout that this package runs from, None for an installed wheel."""
    return _CHECKOUT if (_CHECKOUT / "templates").is_dir() and not _INSTALLED.is_dir() else None


def folder(name: str) -> Path:
    """Return the folder of shipped files called `name`: "templates" or "generated"."""
    root = checkout()
    return (_INSTALLED if root is None else root) / name


def package_files() -> list[Path]:
    """Return every file whose content decides what is generated, in a fixed order."""
    shipped = f"{_INSTALLED}{os.sep}"
    code = [
        path for path in _files(PACKAGE) if path.endswith((".py", ".toml")) and not path.startswith(shipped)
    ]
    return [Path(path) for path in (*sorted(code), *sorted(_files(folder("templates"))))]


def _files(top: Path) -> list[str]:
    """Return the files below a folder: every command looks, and pathlib would take ten times as long."""
    return [os.path.join(place, name) for place, _, names in os.walk(top) for name in names]  # noqa: PTH118
