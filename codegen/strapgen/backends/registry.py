"""The table of back ends, and how their classes are loaded."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from strapgen.backends.protocol import Backend, Evaluator
    from strapgen.ir.sources import Sources

_PACKAGE = __name__.rpartition(".")[0]


class Entry(NamedTuple):
    """A back end: what it is, the target that it runs, the module and classes of this package that run it.

    `word` is the length of word in fixed point, None where it is the user's choice or there is none.
    """

    title: str
    target: str
    module: str
    evaluator: str
    backend: str
    word: int | None = None


#: Back ends by name.
BACKENDS = {
    "numpy": Entry(
        "generated numpy code in double", "numpy", "numpy_backend", "NumpyEvaluator", "NumpyBackend"
    ),
    "c": Entry("generated C in double, compiled", "c", "c", "CEvaluator", "CBackend"),
    "c-float": Entry("generated C in float, compiled", "c-float", "c", "CEvaluator", "CBackend"),
    "c-q31": Entry(
        "generated C in 32-bit fixed point, compiled",
        "c-fixed",
        "fixed",
        "CFixedEvaluator",
        "CFixedBackend",
        32,
    ),
    "c-q15": Entry(
        "generated C in 16-bit fixed point, compiled",
        "c-fixed",
        "fixed",
        "CFixedEvaluator",
        "CFixedBackend",
        16,
    ),
    "fixed-model": Entry(
        "integer model of the fixed-point C in Python, any word",
        "fixed-model",
        "fixed",
        "ModelEvaluator",
        "ModelBackend",
    ),
}


def classes(target: str) -> tuple[type[Evaluator], type[Backend]]:
    """Return the classes that run the sources of a target."""
    entry = next(entry for entry in BACKENDS.values() if entry.target == target)
    module = import_module(f"{_PACKAGE}.{entry.module}")
    return getattr(module, entry.evaluator), getattr(module, entry.backend)


def of_sources(sources: Sources) -> Evaluator:
    """Return the generated function of any kernel as a callable."""
    make: Callable[[Sources], Evaluator] = classes(sources.target)[0]
    return make(sources)
