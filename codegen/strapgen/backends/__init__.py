"""Back ends by name."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import NamedTuple

from strapgen import catalogue, checks, library
from strapgen.backends.protocol import Backend, Evaluator
from strapgen.targets import Sources

__all__ = ["BACKENDS", "Backend", "Entry", "Evaluator", "backend", "build", "evaluator"]


class Entry(NamedTuple):
    """A back end: what it is, and the module and classes of this package that run it."""

    title: str
    module: str
    evaluator: str
    backend: str


#: Back ends by name; each runs the target of the same name.
BACKENDS = {
    "numpy": Entry("generated numpy code in double", "numpy", "NumpyEvaluator", "NumpyBackend"),
    "c": Entry("generated C in double, compiled", "c", "CEvaluator", "CBackend"),
    "c-float": Entry("generated C in float, compiled", "c", "CEvaluator", "CBackend"),
}


def _loaded(target: str) -> tuple[type[Evaluator], type[Backend]]:
    entry = BACKENDS[target]
    module = import_module(f"{__name__}.{entry.module}")
    return getattr(module, entry.evaluator), getattr(module, entry.backend)


def evaluator(kernel: str, backend: str = "numpy") -> Evaluator:
    """Return a kernel of the catalogue that takes no method as a callable.

    Parameters
    ----------
    kernel : str
        Name of the kernel, for instance "dcm-from-euler".
    backend : str, optional
        A key of `BACKENDS`.

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
    checks.choice("kernel", kernel, catalogue.KERNELS)
    return _evaluator(library.sources(catalogue.choose(kernel), backend))


def backend(
    algorithm: str,
    method: str | None = None,
    increments: int | None = None,
    backend: str = "numpy",
    orthonormalization: str | None = None,
) -> Backend:
    """Return an attitude algorithm as a back end, generated and compiled if it is not in the cache.

    Parameters
    ----------
    algorithm : str
        "dcm", "euler" or "cayley-klein".
    method : str, optional
        "rk1" to "rk4"; by default "rk4".
    increments : int, optional
        Angle increments a step, 1 to 8; by default 2.
    backend : str, optional
        A key of `BACKENDS`.
    orthonormalization : str, optional
        Kernel that orthonormalizes, for instance "dcm-orthonormalize-optimal"; by default the thesis's.

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
    checks.choice("algorithm", algorithm, catalogue.ALGORITHMS)
    if orthonormalization is not None:
        checks.choice("orthonormalization", orthonormalization, catalogue.orthonormalizations(algorithm))
    choice = catalogue.choose(algorithm, method, increments)
    return build(library.sources(choice, backend), orthonormalization)


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
        return _evaluator(sources) if kernel == sources.kernel else evaluator(kernel, sources.target)

    make = _loaded(sources.target)[1]
    return make(sources, evaluate, orthonormalization)


def _evaluator(sources: Sources) -> Evaluator:
    make: Callable[[Sources], Evaluator] = _loaded(sources.target)[0]
    return make(sources)
