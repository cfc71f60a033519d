"""Leaves out of the collection what has no tests: modules without an example, and examples whose tools are missing."""

import os
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest
from _pytest.doctest import DoctestModule

#: SymPy remembers a thousand results of each function; more spare a session of many kernels a tenth of its derivations.
os.environ.setdefault("SYMPY_CACHE_SIZE", "20000")
#: The processes of a session fill the processors: threads for products of matrices would only wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

collect_ignore_glob = []
if not (find_spec("z3") and find_spec("pycparser")):
    collect_ignore_glob.append("codegen/strapgen/evidence/overflow/*.py")


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(file_path: Path) -> Iterator[None]:
    """Look for examples in the docstrings of those modules alone that have any: others are not even imported."""
    collectors = yield
    if (
        not any(isinstance(collector, DoctestModule) for collector in collectors)
        or ">>>" in file_path.read_text()
    ):
        return collectors
    return [collector for collector in collectors if not isinstance(collector, DoctestModule)]
