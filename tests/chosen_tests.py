"""Runs chosen tests in a chosen order and tells the first that fails: a plugin of pytest; STRAPGEN_CHOSEN is its file.

The file holds the names of the tests that come first and of those that are left out, and says whether all others
follow. What happens goes to files beside it, so that it is known of a process that is stopped too.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

_FILE = Path(os.environ.get("STRAPGEN_CHOSEN", "chosen.json"))


def ordered(names: list[str], choice: dict[str, Any]) -> list[str]:
    """Return the names that are run, in their order."""
    present, first = set(names), set(choice["first"])
    left_out = set(choice["without"])
    others = (
        [name for name in names if name not in first and name not in left_out] if choice["others"] else []
    )
    return [name for name in choice["first"] if name in present] + others


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep the chosen tests in their order."""
    by_name = {item.nodeid: item for item in items}
    items[:] = [by_name[name] for name in ordered(list(by_name), json.loads(_FILE.read_text()))]


def pytest_collectreport(report: pytest.CollectReport) -> None:
    """Tell a file that cannot be imported."""
    if report.failed:
        _FILE.with_suffix(".failed").write_text(f"import of {report.nodeid}")


def pytest_runtest_logstart(nodeid: str) -> None:
    """Tell the test that begins."""
    _FILE.with_suffix(".running").write_text(nodeid)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Tell a test that fails."""
    if report.failed:
        _FILE.with_suffix(".failed").write_text(report.nodeid)
