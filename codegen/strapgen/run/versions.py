"""Tells the versions of strapgen and of what its output depends on."""

from __future__ import annotations

import platform
import subprocess
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version

from strapgen.ir.exceptions import CompilerError
from strapgen.ir.version import VERSION
from strapgen.run import compiler

_MISSING = "is not installed"
_SHAPES_OUTPUT = ("sympy", "numpy", "jinja2", "cffi", "typer", "rich")


def versions() -> dict[str, str]:
    """Return the versions of strapgen, Python, the packages that shape the output, and the C compiler, by name."""
    known = {"strapgen": VERSION, "python": platform.python_version()}
    for name in _SHAPES_OUTPUT:
        known[name] = _MISSING
        with suppress(PackageNotFoundError):
            known[name] = version(name)
    return known | {"C compiler": _compiler()}


def _compiler() -> str:
    """Return what the compiler says of itself."""
    try:
        path = compiler.C.path()
    except CompilerError:
        return _MISSING
    said = subprocess.run([path, "--version"], capture_output=True, text=True, check=False).stdout
    return said.splitlines()[0] if said else path
