"""Back ends run generated algorithms: `backend` and `build` return one, `evaluator` a kernel as a callable."""

from __future__ import annotations

import os
from dataclasses import replace

from strapgen import catalogue
from strapgen.catalogue import Choice
from strapgen.catalogue.choice import AnyMethod
from strapgen.ir import checks, stage_arguments
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.sources import Sources
from strapgen.run.evaluators import Evaluator
from strapgen.run.kernel_sources import sources_of_choice
from strapgen.run.protocol import Backend
from strapgen.run.registry import BACKENDS, DEFAULT_BACKENDS, Entry, backend_class, of_sources
from strapgen.run.step_sources import StepSources

__all__ = [
    "BACKENDS",
    "DEFAULT_BACKENDS",
    "Backend",
    "Entry",
    "Evaluator",
    "backend",
    "build",
    "evaluator",
    "fitted",
    "of_sources",
    "sources_to_build",
]


def fitted(backend: str, settings: Settings | None) -> Settings | None:
    """Return the settings that a back end runs with, in its own word; where none are stated, the defaults.

    Parameters
    ----------
    backend : str
        A key of `BACKENDS`.
    settings : Settings or None

    Returns
    -------
    Settings or None
        None in floating point.

    Raises
    ------
    InputError, InputTypeError
        If the back end takes no settings, or none of this word.
    """
    entry = BACKENDS[checks.choice("backend", backend, BACKENDS)]
    if not entry.fixed:
        if settings is not None:
            takers = ", ".join(name for name, other in BACKENDS.items() if other.fixed)
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
        Name of a kernel that takes no method, for instance "dcm-from-euler"; or any choice that `catalogue.choose` or
        `Choice.companion` returns, of a user's algorithm too.
    backend : str, optional
        A key of `BACKENDS`.
    settings : Settings, optional
        Settings of fixed point.

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
    stage_arguments.require("evaluator", kernel, str, Choice)
    checks.choice("backend", backend, BACKENDS)
    if isinstance(kernel, str):
        checks.choice("kernel", kernel, {**catalogue.KERNELS, **catalogue.LAYOUT_KERNELS})
    choice = catalogue.choose(kernel)
    return of_sources(sources_of_choice(choice, BACKENDS[backend].target, fitted(backend, settings)))


def backend(
    algorithm: str | Choice,
    method: AnyMethod | None = None,
    increments: int | None = None,
    backend: str = "numpy",
    orthonormalization: str | None = None,
    settings: Settings | None = None,
    *,
    previous: int | None = None,
    ahead: int | None = None,
) -> Backend:
    """Return an attitude algorithm as a back end, generated and compiled if it is not in the cache.

    Parameters
    ----------
    algorithm : str or Choice
        "dcm", "euler" or "cayley-klein"; a Python file, or the entry point of a user's algorithm; or a choice that
        `catalogue.choose` returns, with which the other parameters of a choice do not go.
    method : str, Tableau, Window or ShapedConing, optional
        A name that ``strapgen list`` shows, or a tableau; by default "rk4".
    increments : int, optional
        Angle increments per step, 1 to 8; by default 2.
    backend : str, optional
        A key of `BACKENDS`.
    orthonormalization : str, optional
        Kernel that orthonormalizes, for instance "dcm-orthonormalize-optimal"; by default the thesis's.
    settings : Settings, optional
        Settings of fixed point: largest increment, rounding, error feedback, and the word of "fixed-model". By default
        increments are at most 1/8 rad.
    previous, ahead : int, optional
        Numbers of increments from before the step and from after it that it takes in addition, together at most 32;
        by default 0.

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
    >>> backend(catalogue.choose("dcm", "rk2"), backend="c").name
    'c'
    """
    stage_arguments.require("backend", algorithm, str, os.PathLike, Choice)
    checks.choice("backend", backend, BACKENDS)
    choice = catalogue.choose_step(algorithm, method, increments, previous=previous, ahead=ahead)
    if orthonormalization is not None:
        checks.choice("orthonormalization", orthonormalization, choice.orthonormalizations)
    step = sources_of_choice(choice, BACKENDS[backend].target, fitted(backend, settings))
    return backend_class(step.target)(StepSources(step, choice, orthonormalization))


def sources_to_build(choice: Choice, backend: str, settings: Settings | None = None) -> list[Sources]:
    """Return what a back end of an attitude step builds: the step, and the kernel that orthonormalizes its state.

    `strapgen.compile_together` compiles those of many steps in one call of the compiler.

    Parameters
    ----------
    choice : Choice
        What `strapgen.choose_step` returned.
    backend, settings
        As for `backend`.
    """
    entry = BACKENDS[checks.choice("backend", backend, BACKENDS)]
    step = StepSources(sources_of_choice(choice, entry.target, fitted(backend, settings)), choice)
    beside = step.step_kernels.orthonormalize
    return [step.step, *([] if beside is None else [step.sources(beside, entry.target)])]


def build(sources: Sources, orthonormalization: str | None = None) -> Backend:
    """Return the generated sources of an attitude step as a back end; C is compiled, once.

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
        If the sources are not those of an attitude step.
    CompilerError
        If a C compiler is needed and there is none, or it fails.

    Examples
    --------
    >>> from strapgen import derive, generate, lower
    >>> build(generate(lower(derive("euler")), "numpy")).name
    'numpy'
    """
    stage_arguments.require("build", sources, Sources)
    return backend_class(sources.target)(StepSources(sources, None, orthonormalization))
