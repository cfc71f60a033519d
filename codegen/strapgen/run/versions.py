"""Tells the versions of strapgen and of what its output depends on."""

from __future__ import annotations

import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version

from strapgen.ir.exceptions import CompilerError
from strapgen.ir.version import VERSION
from strapgen.run import compiler

_SHAPES_OUTPUT = ("sympy", "numpy", "jinja2", "cffi", "typer", "rich")


def versions() -> dict[str, str]:
    """Return the versions of strapgen, Python, the packages that shape the output, and the C compiler.

    Examples
    --------
    >>> [*versions()][:3]
    ['strapgen', 'python', 'sympy']
    """
    known = {"strapgen": VERSION, "python": platform.python_version()}
    for name in _SHAPES_OUTPUT:
        try:
            known[name] = version(name)
        except PackageNotFoundError:
            known[name] = "is not installed"
    return known | {"C compiler": _compiler()}


def _compiler() -> str:
    """Return what the compiler says of itself."""
    try:
        path = compiler.compiler()
    except CompilerError:
        return "is not installed"
    said = subprocess.run([path, "--version"], capture_output=True, text=True, check=False).stdout
    return said.splitlines()[0] if said else path
