"""The library: generated sources by name, made when first asked for and cached.

The key is the generator itself, its code and templates: a change of either makes new sources, so what runs is
never out of step with the derivation. A second use loads neither SymPy nor Jinja.
"""

from __future__ import annotations

import json
from pathlib import Path

from strapgen import cache
from strapgen.catalogue import Choice, derive
from strapgen.fixedpoint import Settings
from strapgen.targets import Sources, emit


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
        # Imported here: with the sources in the cache, SymPy and Jinja stay unloaded.
        from strapgen.lowering import lower

        made = emit(lower(derive(choice)), target, settings)
        for name, text in made.files.items():
            (draft / name).write_text(text)
        (draft / "interface.json").write_text(json.dumps(made.interface()))

    asked = json.dumps(settings.as_dict(), sort_keys=True) if settings else ""
    key = cache.digest([cache.generator_digest(), choice.identity, target, asked])
    folder = cache.entry("sources", key, fill)
    interface = json.loads((folder / "interface.json").read_text())
    return Sources.restore(interface, {name: (folder / name).read_text() for name in interface["files"]})
