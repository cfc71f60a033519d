"""`BACKENDS` lists the back ends by name, and functions here load their classes when they are needed."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from strapgen import registration
from strapgen.ir.exceptions import InputError
from strapgen.registry import Registry
from strapgen.run.backend_names import Entry
from strapgen.targets import BUILT_IN

if TYPE_CHECKING:
    from strapgen.ir.sources import Sources
    from strapgen.run.evaluators import Evaluator


#: Other names of back ends, which every command takes too.
ALIASES = {"c-q31": "c-fixed32", "c-q15": "c-fixed16"}


class _Backends(Registry[Entry]):
    """Back ends by name; one can be looked up by its other name, too."""

    def __getitem__(self, name: str) -> Entry:
        return super().__getitem__(ALIASES.get(name, name))

    def __contains__(self, name: object) -> bool:
        return super().__contains__(ALIASES.get(str(name), name))


#: Back ends by name.
BACKENDS = _Backends("backends", Entry)

#: Back ends on which an experiment runs by default.
DEFAULT_BACKENDS = tuple(name for name, entry in BACKENDS.own.items() if entry.by_default and not entry.slow)


def _of_target(target: str) -> Entry:
    for entry in BACKENDS.values():
        if entry.target == target:
            return entry
    runnable = ", ".join(dict.fromkeys(e.target for e in BACKENDS.own.values() if e.target in BUILT_IN))
    raise InputError(f"no back end runs code for target {target}; those for these targets run: {runnable}")


def evaluator_class(target: str) -> Callable[[Sources], Evaluator]:
    """Return the class that runs a kernel for a target."""
    loaded: Callable[[Sources], Evaluator] = registration.load(_of_target(target).evaluator)
    return loaded


def of_sources(sources: Sources) -> Evaluator:
    """Return any kernel as a callable from its sources."""
    return evaluator_class(sources.target)(sources)
