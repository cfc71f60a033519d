"""The library: lowered programs and generated sources by name, made when first asked for and cached.

The key is the generator itself, its code and templates: a change of either makes new sources, so what runs is
never out of step with the derivation. A second use loads neither SymPy nor Jinja; another target or other settings of
the same kernel derive nothing again.
"""

from __future__ import annotations

import json
import pickle
from pathlib import Path

from strapgen.catalogue import Choice, derive
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.support import cache
from strapgen.targets import emit

_programs: dict[str, Program] = {}


def program(choice: Choice) -> Program:
    """Return a kernel of the catalogue as straight-line code, derived once for all targets and settings.

    Parameters
    ----------
    choice : Choice
        What `strapgen.catalogue.choose` returned.

    Returns
    -------
    Program

    Examples
    --------
    >>> from strapgen.catalogue import choose
    >>> program(choose("euler")).operations["divide"]
    0
    """

    def fill(draft: Path) -> None:
        from strapgen import pipeline  # imported here, as SymPy is: a program in the cache needs neither

        (draft / "program.pickle").write_bytes(pickle.dumps(pipeline.lower(derive(choice))))

    key = cache.digest([cache.generator_digest(), choice.identity])
    if key not in _programs:
        folder = cache.entry("programs", key, fill)
        _programs[key] = pickle.loads((folder / "program.pickle").read_bytes())
    return _programs[key]


def sources(choice: Choice, target: str, settings: Settings | None = None) -> Sources:
    """Return the generated sources of a kernel of the catalogue.

    Parameters
    ----------
    choice : Choice
        What `strapgen.catalogue.choose` returned.
    target : str
        A key of `strapgen.targets.TARGETS`.
    settings : Settings, optional
        What fixed point is made for.

    Returns
    -------
    Sources
    """

    def fill(draft: Path) -> None:
        made = emit(program(choice), target, settings)
        for name, text in made.files.items():
            (draft / name).write_text(text)
        (draft / "interface.json").write_text(json.dumps(made.interface()))

    asked = json.dumps(settings.as_dict(), sort_keys=True) if settings else ""
    key = cache.digest([cache.generator_digest(), choice.identity, target, asked])
    folder = cache.entry("sources", key, fill)
    interface = json.loads((folder / "interface.json").read_text())
    return Sources.restore(interface, {name: (folder / name).read_text() for name in interface["files"]})
