"""Back ends by name."""

from __future__ import annotations

import os
from dataclasses import replace

from strapgen import catalogue
from strapgen.backends.protocol import Backend, Evaluator
from strapgen.backends.registry import BACKENDS, Entry, classes, of_sources
from strapgen.backends.step_sources import StepSources
from strapgen.catalogue import Choice
from strapgen.catalogue.methods.tableau import Tableau
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.library import generated_sources
from strapgen.support import checks, stages
from strapgen.support.exceptions import InputError, InputTypeError
from strapgen.targets import FIXED

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


def evaluator(kernel: str | Choice, backend: str = "numpy", settings: Settings | None = None) -> Evaluator:
    """Return a kernel as a callable.

    Parameters
    ----------
    kernel : str or Choice
        Name of a kernel that takes no method, for instance "dcm-from-euler"; or what `catalogue.choose` returned, a
        user's algorithm too, and `Choice.companion` for the kernels that it brings.
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
    stages.require("evaluator", kernel, str, Choice)
    checks.choice("backend", backend, BACKENDS)
    if not isinstance(kernel, Choice):
        checks.choice("kernel", kernel, catalogue.KERNELS)
        kernel = catalogue.choose(kernel)
    chosen = fitted(backend, settings)
    return of_sources(generated_sources.sources(kernel, BACKENDS[backend].target, chosen))


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
    stages.require("backend", algorithm, str, os.PathLike)
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
        checks.choice("orthonormalization", orthonormalization, choice.orthonormalizations)
    chosen = fitted(backend, settings)
    step = generated_sources.sources(choice, BACKENDS[backend].target, chosen)
    return classes(step.target)[1](StepSources(step, choice, orthonormalization))


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

    Examples
    --------
    >>> from strapgen import derive, generate, lower
    >>> build(generate(lower(derive("euler")), "numpy")).name
    'numpy'
    """
    stages.require("build", sources, Sources)
    return classes(sources.target)[1](StepSources(sources, None, orthonormalization))
