"""Finds the folders of templates and generated sources, in the wheel or in the checkout."""

from __future__ import annotations

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
    code = [
        path for kind in ("*.py", "*.toml") for path in PACKAGE.rglob(kind) if _INSTALLED not in path.parents
    ]
    templates = [path for path in folder("templates").rglob("*") if path.is_file()]
    return sorted(code) + sorted(templates)
