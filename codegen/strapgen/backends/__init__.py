"""Back ends by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import NamedTuple

from strapgen import catalogue, checks, library
from strapgen.backends.protocol import Backend, Evaluator
from strapgen.catalogue import Choice
from strapgen.catalogue.tableaux import Tableau
from strapgen.exceptions import InputError, InputTypeError
from strapgen.fixedpoint import Settings
from strapgen.targets import FIXED, Sources

__all__ = [
    "BACKENDS",
    "Backend",
    "Entry",
    "Evaluator",
    "backend",
    "build",
    "evaluator",
    "fitted",
    "of",
    "of_sources",
]


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
    "numpy": Entry("generated numpy code in double", "numpy", "numpy", "NumpyEvaluator", "NumpyBackend"),
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


def fitted(backend: str, settings: Settings | None) -> Settings | None:
    """Return the settings that a back end runs with: its own word, and defaults where none are given.

    Raises
    ------
    InputError, InputTypeError
        If the back end takes no settings, or none of this word.
    """
    entry = BACKENDS[checks.choice("backend", backend, BACKENDS)]
    if entry.target not in FIXED:
        if settings is not None:
            takers = ", ".join(name for name, other in BACKENDS.items() if other.target in FIXED)
            raise InputError(f"backend {backend} takes no fixed-point settings; these do: {takers}")
        return None
    if settings is not None and not isinstance(settings, Settings):
        raise InputTypeError(f"settings is {settings!r}; strapgen.Settings is needed")
    settings = settings or Settings()
    if entry.word is None:
        return settings
    if settings.word not in (entry.word, Settings().word):
        raise InputError(f"word is {settings.word}; backend {backend} has words of {entry.word} bits")
    return replace(settings, word=entry.word)


def _loaded(target: str) -> tuple[type[Evaluator], type[Backend]]:
    entry = next(entry for entry in BACKENDS.values() if entry.target == target)
    module = import_module(f"{__name__}.{entry.module}")
    return getattr(module, entry.evaluator), getattr(module, entry.backend)


def evaluator(kernel: str | Choice, backend: str = "numpy", settings: Settings | None = None) -> Evaluator:
    """Return a kernel of the catalogue as a callable.

    Parameters
    ----------
    kernel : str or Choice
        Name of a kernel that takes no method, for instance "dcm-from-euler"; or what `catalogue.choose` returned.
    backend : str, optional
        A key of `BACKENDS`.
    settings : Settings, optional
        What fixed point is made for.

    Returns
    -------
    Evaluator

    Raises
    ------
    InputError
        If a name is unknown.
    CompilerError
        If the back end needs a C compiler and there is none.

    Examples
    --------
    >>> evaluator("dcm-from-euler")([0.0, 0.0, 1.0, 0.0])
    array([[-1.,  0.,  0.],
           [ 0., -1.,  0.],
           [ 0.,  0.,  1.]])
    """
    checks.choice("backend", backend, BACKENDS)
    if not isinstance(kernel, Choice):
        if kernel not in catalogue.user.KERNELS:
            checks.choice("kernel", kernel, catalogue.KERNELS)
        kernel = catalogue.choose(kernel)
    chosen = fitted(backend, settings)
    return of_sources(library.sources(kernel, BACKENDS[backend].target, chosen))


def backend(
    algorithm: str,
    method: str | Tableau | None = None,
    increments: int | None = None,
    backend: str = "numpy",
    orthonormalization: str | None = None,
    settings: Settings | None = None,
    *,
    previous: int = 0,
) -> Backend:
    """Return an attitude algorithm as a back end, generated and compiled if it is not in the cache.

    Parameters
    ----------
    algorithm : str
        "dcm", "euler" or "cayley-klein"; a Python file, or the entry point of a user's algorithm.
    method : str or Tableau, optional
        A name that ``strapgen list`` shows, or a tableau; by default "rk4".
    increments : int, optional
        Angle increments a step, 1 to 8; by default 2.
    backend : str, optional
        A key of `BACKENDS`.
    orthonormalization : str, optional
        Kernel that orthonormalizes, for instance "dcm-orthonormalize-optimal"; by default the thesis's.
    settings : Settings, optional
        What fixed point is made for: largest increment, rounding, residuals, and the word of "fixed-model". By default
        increments of up to 1/8 rad.
    previous : int, optional
        Increments before the step that it takes too, 0 to 3; by default 0.

    Returns
    -------
    Backend

    Raises
    ------
    InputError
        If a name or number is not allowed.
    CompilerError
        If the back end needs a C compiler and there is none.

    Examples
    --------
    >>> backend("dcm", method="rk2").increments
    2
    """
    checks.choice("backend", backend, BACKENDS)
    choice = catalogue.choose_step(algorithm, method, increments, previous=previous)
    return of(choice, backend, orthonormalization, settings)


def of(
    choice: Choice,
    backend: str = "numpy",
    orthonormalization: str | None = None,
    settings: Settings | None = None,
) -> Backend:
    """Return a chosen attitude step as a back end; parameters and errors are those of `backend`."""
    checks.choice("backend", backend, BACKENDS)
    if orthonormalization is not None:
        checks.choice("orthonormalization", orthonormalization, catalogue.orthonormalizations(choice.name))
    chosen = fitted(backend, settings)
    return build(library.sources(choice, BACKENDS[backend].target, chosen), orthonormalization)


def build(sources: Sources, orthonormalization: str | None = None) -> Backend:
    """Make a back end of the generated sources of an attitude step; C is compiled, once.

    Parameters
    ----------
    sources : Sources
    orthonormalization : str, optional
        Kernel that orthonormalizes; by default the one that goes with the algorithm.

    Returns
    -------
    Backend

    Raises
    ------
    InputError
        If the sources are of no attitude step.
    CompilerError
        If a C compiler is needed and there is none, or it fails.
    """

    def evaluate(kernel: str) -> Evaluator:
        if kernel == sources.kernel:
            return of_sources(sources)
        settings = sources.fixed.companion_settings if sources.fixed else None
        return of_sources(library.sources(catalogue.choose(kernel), sources.target, settings))

    make = _loaded(sources.target)[1]
    return make(sources, evaluate, orthonormalization)


def of_sources(sources: Sources) -> Evaluator:
    """Return the generated function of any kernel as a callable."""
    make: Callable[[Sources], Evaluator] = _loaded(sources.target)[0]
    return make(sources)
