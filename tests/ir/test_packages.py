"""What installed packages bring: read once, and again when a package comes or goes."""

from __future__ import annotations

import shutil
import sys
import time
from importlib import metadata
from pathlib import Path

import pytest

from strapgen.ir import packages

GROUP = "strapgen.test_group"


def install(folder: Path, name: str) -> Path:
    """Write what pip leaves of a package with an entry point of its own name."""
    time.sleep(0.02)  # more than a file system's clock takes from one time to the next
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{GROUP}]\n{name} = {name}:thing\n")
    return info


def names() -> list[str]:
    return sorted(point.name for point in packages.entry_points(GROUP))


def test_a_package_that_comes_or_goes_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    assert names() == []
    monkeypatch.syspath_prepend(tmp_path)
    assert names() == []
    first = install(tmp_path, "first")
    assert names() == ["first"]
    install(tmp_path, "second")
    assert names() == ["first", "second"]
    time.sleep(0.02)
    shutil.rmtree(first)
    assert names() == ["second"]
    install(tmp_path / "other", "third")
    assert names() == ["second"]
    monkeypatch.syspath_prepend(tmp_path / "other")
    assert names() == ["second", "third"]
    monkeypatch.chdir(tmp_path / "other")
    monkeypatch.setattr("sys.path", [""])  # the folder that the program is in
    assert names() == ["third"]
    monkeypatch.chdir(tmp_path)
    assert names() == ["second"]


def test_another_finder_of_packages_is_asked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    class Finder(metadata.DistributionFinder):
        def find_spec(self, *_):
            return None

        def find_distributions(self, context):
            return [metadata.PathDistribution(install(tmp_path, "found"))] if context.name is None else []

    assert names() == []
    monkeypatch.setattr("sys.meta_path", [*sys.meta_path, Finder()])
    assert names() == ["found"]


def test_unchanged_files_are_read_once(monkeypatch: pytest.MonkeyPatch):
    before = packages.entry_points("console_scripts")
    assert {point.name for point in before} >= {"strapgen"}

    def never(**_):
        raise AssertionError("read again")

    monkeypatch.setattr(metadata, "entry_points", never)
    assert packages.entry_points("console_scripts") == before
    with pytest.raises(AssertionError, match="read again"):
        packages.entry_points("another group")
