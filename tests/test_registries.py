"""Names of the public registries: they complete as keys, and show themselves with their titles."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

import strapgen
from strapgen.ir.notebook_display import NAMES, WIDTH
from strapgen.registry import Merged

REGISTRIES = ("METHODS", "ALGORITHMS", "KERNELS", "MOTIONS", "TARGETS", "BACKENDS", "WINDOWS", "TABLEAUX")


@pytest.mark.parametrize("name", REGISTRIES)
def test_a_registry_is_a_mapping_that_shows_its_names(name):
    registry = getattr(strapgen, name)
    assert isinstance(registry, Mapping) and name in strapgen.__all__
    first = next(iter(registry))
    assert registry._ipython_key_completions_() == list(registry)
    lines = str(registry).splitlines()
    assert len(lines) == min(len(registry), NAMES) and max(map(len, lines)) <= WIDTH + 20
    assert lines[0].split(maxsplit=1)[0] == first
    value = registry[first]
    title = value if isinstance(value, str) else value.title
    assert lines[0].split(maxsplit=1)[1] == " ".join(title.split())
    assert f">{first}<" in registry._repr_html_()


def test_of_many_names_the_others_are_counted():
    many = Merged({f"name-{k}": "a title" for k in range(100)})
    lines = str(many).splitlines()
    assert lines[-1].split(maxsplit=1) == [
        "...",
        f"{101 - NAMES} more; list() of this mapping gives all names",
    ]
    few = Merged({f"name-{k}": "a title" for k in range(NAMES)})
    assert str(few).splitlines()[-1].split()[0] == f"name-{NAMES - 1}"


def test_ipython_completes_keys_and_shows_the_table():
    shell = pytest.importorskip("IPython.core.interactiveshell").InteractiveShell()
    shell.run_cell("import strapgen")
    completer = shell.Completer
    completer.use_jedi = False
    _, matches = completer.complete(line_buffer='strapgen.METHODS["magnus', cursor_pos=24)
    assert {"magnus2", "magnus4"} <= {match.strip('"[]') for match in matches}
    data, _ = shell.display_formatter.format(strapgen.ALGORITHMS)
    assert data["text/plain"] == str(strapgen.ALGORITHMS)
    assert "<table" in data["text/html"]
