"""Packages that are installed for a test: what pip leaves of one, on Python's path for as long as the test runs."""

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from strapgen import registration, registry
from strapgen.catalogue import names


def install(folder: Path, group: str, entries: dict[str, str], name: str = "toy") -> None:
    """Write what pip leaves of a package that has entry points, for Python to find it in a folder of its path."""
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir(exist_ok=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = [f"[{group}]", *(f"{entry} = {value}" for entry, value in entries.items())]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")


def as_in_a_new_process() -> None:
    """Forget what strapgen has loaded of packages."""
    registration.loaded.cache_clear()
    registry._code.cache_clear()
    names.reserved.cache_clear()


@contextlib.contextmanager
def importable(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Have a folder on Python's path; its modules are forgotten afterwards."""
    monkeypatch.syspath_prepend(folder)
    as_in_a_new_process()
    before = {*sys.modules}
    yield
    as_in_a_new_process()
    for module in {*sys.modules} - before:
        if str(getattr(sys.modules[module], "__file__", "")).startswith(str(folder)):
            del sys.modules[module]
