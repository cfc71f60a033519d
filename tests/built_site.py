"""The documentation as Sphinx builds it: built once for all processes of a session, or built before."""

from __future__ import annotations

import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
import session_library

ROOT = Path(__file__).resolve().parents[1]
MODULES = ("sphinx", "furo", "myst_parser", "numpydoc", "sphinx_copybutton")
#: How the build says that Python for the browser cannot be had; it then leaves one page out.
LEFT_OUT = "docs: strapgen does not run on its page"
#: Builds the site with the bounds of steps on two samples, which the tests of the page derive; `make docs` proves all.
BUILD = f"""
import sys
sys.path[:0] = [{str(ROOT / "docs" / "site")!r}, {str(ROOT / "docs" / "site" / "try")!r}]
import build, vendor
vendor.PROVED_INCREMENTS = range(2, 3)
sys.exit(build.main(sys.argv[1:]))
"""


def folder(factory: pytest.TempPathFactory, before: Path | None) -> Path:
    """Return the folder of the site's pages, built without a warning; skip where a tool for it is missing.

    Parameters
    ----------
    factory : pytest.TempPathFactory
    before : Path or None
        The folder of a site that was built before.
    """
    if before is not None:
        assert (before / "index.html").is_file(), f"{before} holds no site; make docs builds one"
        return before.resolve()
    for module in MODULES:
        if find_spec(module) is None:
            pytest.skip(f"{module} is not in this environment; make docs brings it")
    if shutil.which("npm") is None and not (ROOT / "docs" / "_build" / "vendor" / "mathjax").is_dir():
        pytest.skip("npm is not on this machine")
    return session_library.place(factory, "site", _build) / "html"


def _build(place: Path) -> None:
    done = subprocess.run([sys.executable, "-c", BUILD, str(place)], capture_output=True, text=True)
    lines = [line for line in done.stderr.splitlines() if not line.startswith(LEFT_OUT)]
    assert done.returncode == 0 and not lines, done.stderr
