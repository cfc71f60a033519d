"""Returns the programs and the generated sources of a choice, from the cache or, if they are new, from `pipeline`.

The key of an entry is the choice with the generator itself, its code and templates: after a change of either, entries
are generated again, and what runs agrees with the derivation. A second use loads neither SymPy nor Jinja; another
target or other settings of the same kernel derive nothing again, and the integer model has the integers of the C.
"""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from strapgen import targets
from strapgen.catalogue import Choice
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.ir.timing import from_cache
from strapgen.storage import cache
from strapgen.targets.names import UNNAMED, Naming

if TYPE_CHECKING:
    from strapgen.ir.integer_program import FixedProgram
    from strapgen.ir.program import Program

T = TypeVar("T")

_programs: dict[str, Program] = {}
#: What this process has read last from the cache, by its folder and the key of the entry, whose content never changes.
_entries: dict[tuple[Path, str], Any] = {}
#: So many entries are remembered; one of sources takes some ten kilobytes.
_MOST_ENTRIES = 256


def _remembered(key: str, what: str, read: Callable[[], T]) -> T:
    """Return the content of an entry, which a process checks and reads once; the log has every use."""
    place = cache.root(), key
    content: T | None = _entries.pop(place, None)
    if content is None:
        content = cache.persistently(read)
    else:
        from_cache(what)
    _entries[place] = content  # the last one now
    if len(_entries) > _MOST_ENTRIES:
        oldest, *_ = tuple(_entries)  # at once, as other threads may add some
        _entries.pop(oldest, None)
    return content


def program(choice: Choice) -> Program:
    """Return a kernel as straight-line code, derived and lowered once for all targets and settings.

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
        from strapgen import pipeline  # what is in the cache does without the stages

        (draft / "program.pickle").write_bytes(pickle.dumps(pipeline.lowered(choice)))

    key = cache.digest([cache.generator_digest(), choice.identity])
    if key not in _programs:

        def read() -> bytes:
            place = cache.entry("programs", key, fill, f"program of {choice.kernel}")
            return cache.read(place, "program.pickle")

        _programs[key] = pickle.loads(cache.persistently(read))
    return _programs[key]


def fixed_program(choice: Choice, settings: Settings | None = None) -> FixedProgram:
    """Return a kernel in fixed point, quantized once for all targets.

    Parameters
    ----------
    choice : Choice
        What `strapgen.catalogue.choose` returned.
    settings : Settings, optional
        Word, ranges and rounding; by default 32 bits and 1/8 rad.

    Returns
    -------
    FixedProgram

    Raises
    ------
    InputError
        If the kernel has no fixed point with these settings, see `strapgen.quantize`.

    Examples
    --------
    >>> from strapgen.catalogue import choose
    >>> str(fixed_program(choose("euler")).formats["state"])
    'Q1.30'
    """
    settings = settings or Settings()

    def fill(draft: Path) -> None:
        from strapgen import pipeline

        (draft / "fixed.pickle").write_bytes(pickle.dumps(pipeline.quantize(program(choice), settings)))

    what = f"integers of {choice.kernel}"

    def read() -> FixedProgram:
        place = cache.entry("fixed-programs", key, fill, what)
        fixed: FixedProgram = pickle.loads(cache.read(place, "fixed.pickle"))
        return fixed

    key = cache.digest([cache.generator_digest(), choice.identity, _text(settings)])
    return _remembered(key, what, read)


def _text(settings: Settings) -> str:
    return json.dumps(settings.as_dict(), sort_keys=True)


def sources(
    choice: Choice, target: str, settings: Settings | None = None, naming: Naming = UNNAMED
) -> Sources:
    """Return the generated sources of a kernel.

    Parameters
    ----------
    choice : Choice
        What `strapgen.catalogue.choose` returned.
    target : str
        A key of `strapgen.targets.TARGETS`.
    settings : Settings, optional
        Word, ranges and rounding of fixed point; by default 32 bits and 1/8 rad.
    naming : Naming, optional
        The name of the function in C, if the user chooses it.

    Returns
    -------
    Sources

    Raises
    ------
    InputError
        If the target is unknown, or does not go with the kernel or the settings.
    """

    def fill(draft: Path) -> None:
        from strapgen import pipeline

        compiled = pipeline.compile(
            choice,
            target,
            settings,
            lambda chosen: naming.of(program(chosen)),
            None if naming.option else fixed_program,
        )
        for name, text in compiled.files.items():
            (draft / name).write_text(text)
        (draft / "interface.json").write_text(json.dumps(compiled.interface()))

    stated = _text(settings) if settings else ""
    targets.require(target, settings)
    if naming.option and not targets.TARGETS[target].nameable:
        raise InputError(f"{naming.option} goes with targets in C, C++, Rust and MATLAB, not with {target}")
    code = targets.TARGETS.code(target)
    key = cache.digest(
        [
            cache.generator_digest(),
            choice.identity,
            target,
            code,
            stated,
            naming.name or "",
            naming.prefix or "",
        ]
    )

    what = f"sources of {choice.kernel} for {target}"

    def read() -> Sources:
        folder = cache.entry("sources", key, fill, what)
        interface = json.loads(cache.read(folder, "interface.json"))
        files = {name: cache.read(folder, name).decode() for name in interface["files"]}
        return Sources.restore(interface, files)

    known = _remembered(key, what, read)
    # Copies: what a user does to them changes nothing that others get.
    return replace(known, files={**known.files}, operations={**known.operations})
