"""The names of algorithms, methods, kernels and vectors: listing and checking them needs no computer algebra."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from typing import Any, ClassVar, NamedTuple

from strapgen.catalogue.methods.method_spec import (
    Integrator,
    MethodSpec,
    RequestedSamples,
    StepSamples,
    through_samples,
)
from strapgen.catalogue.methods.shaped_coning import SHAPE_TITLES, SHAPES
from strapgen.catalogue.methods.tableaux import TABLEAUX, TITLES
from strapgen.catalogue.methods.windows import EXACT, WINDOW_TITLES, named_window
from strapgen.ir.kernel_info import Recipe
from strapgen.registry import Merged, Names, Registry, Titles

#: Kernels that take no method.
KERNELS = Registry("kernels", Recipe, lambda recipe: not getattr(recipe, "reader", ""))
#: Kernels of a description in a file.
LAYOUT_KERNELS = Registry("kernels", Recipe, lambda recipe: bool(getattr(recipe, "reader", "")))


@cache
def reserved() -> tuple[str, ...]:
    """Return the names that a user's algorithm cannot have, as they are at the first call."""
    return (*ALGORITHMS, *VECTORS, *KERNELS, *LAYOUT_KERNELS)


#: The folder of the modules that derive methods.
_METHODS = f"{__package__}.methods."

#: Attitude algorithms, by the state they integrate.
ALGORITHMS: Names[str] = Merged(
    {
        "dcm": "direction cosine matrix",
        "euler": "Euler parameters, scalar last",
        "cayley-klein": "Cayley-Klein parameters, scalar first",
    }
)

#: Integration methods without files of coefficients.
INTEGRATORS = Registry("methods", Integrator)


@dataclass(frozen=True)
class _NamedTableau:
    """A tableau of strapgen by its name, whose file is read when its coefficients are needed."""

    name: str
    title: str

    file: ClassVar = ""
    kind: ClassVar = "method"  # whoever names one need not know that it is a tableau
    own_samples: ClassVar = None

    @property
    def recipe(self) -> tuple[str, str, tuple[Any, ...]]:
        """Module, function and arguments that make a `Method` of it."""
        return TABLEAUX[self.name].recipe

    @property
    def tolerance(self) -> Fraction:
        """Largest residual of a condition that the rounding of published coefficients explains."""
        return TABLEAUX[self.name].tolerance

    def select(self, asked: RequestedSamples) -> tuple[_NamedTableau, StepSamples]:
        """Return the requested samples."""
        return self, through_samples(self.name, asked)


def named_method(method: str | MethodSpec) -> MethodSpec | None:
    """Return the method of a name, None for an unknown name; return a method unchanged.

    Examples
    --------
    >>> named_method("window-7-7").own_samples, named_method("rk4").title, named_method("rk5")
    (1, 'classical fourth-order Runge-Kutta method', None)
    """
    if not isinstance(method, str):
        return method if isinstance(method, MethodSpec) else None
    if method in TITLES:
        return _NamedTableau(method, TITLES[method]) if method in TITLES.own else TABLEAUX[method]
    integrator = INTEGRATORS.get(method)
    if integrator is not None:
        return replace(integrator, name=method)
    return SHAPES.get(method) or named_window(method)


def is_built_in(method: str) -> bool:
    """Return whether a name is not that of an installed package's coefficient file."""
    name = method.removesuffix(EXACT)
    tables = (TITLES, SHAPE_TITLES, WINDOW_TITLES)
    return any(name in table.own for table in tables) or not any(name in table for table in tables)


#: Integration methods. Each family of windows has others for the same samples, such as window-8-6 beside window-7-7.
METHODS: Names[str] = Merged(TITLES, Titles(INTEGRATORS), SHAPE_TITLES, WINDOW_TITLES)

#: Methods of the standard catalogue, which are those of the thesis.
STANDARD_METHODS = ("rk1", "rk2", "rk3", "rk4")


class StepVector(NamedTuple):
    """A vector of a step: the module and function that derive it, the methods that it can use, and the default.

    One with `every` goes with every method on increments, those of tableaux and exact rotations of windows among them.
    """

    title: str
    module: str
    function: str
    families: tuple[str, ...]
    default: str
    takes_windows: bool = False
    every: bool = False

    @property
    def methods(self) -> list[str]:
        """Names of the methods that can compute it, without windows."""
        if self.every:
            return [*TITLES, *INTEGRATORS]
        return [
            name
            for name, one in INTEGRATORS.items()
            if one.module.startswith(_METHODS) and one.function in self.families
        ]


#: Vectors of a step that a method computes.
_VECTORS = {
    "rotation-vector": StepVector(
        "rotation vector of a step",
        "attitude_step",
        "rotation_vector",
        ("magnus", "munthe_kaas", "by_form"),
        "coning-combined",
        True,
    ),
    "sculling": StepVector(
        "sculling term of a step, by duality with coning",
        "attitude_step",
        "sculling",
        ("by_form",),
        "coning-combined",
    ),
    "velocity-position": StepVector(
        "velocity and position change of a step",
        "velocity_position",
        "step",
        (),
        "coning-combined",
        True,
        True,
    ),
    "preintegrate": StepVector(
        "preintegration: sums of a step with covariance and bias Jacobian",
        "preintegration",
        "step",
        ("magnus", "munthe_kaas", "by_form"),
        "coning-combined",
        True,
    ),
    **{
        f"{algorithm}-jacobian": StepVector(
            f"Jacobians of a step by state and increments: {words}",
            "jacobians",
            algorithm.replace("-", "_"),
            (),
            "rk4",
            True,
            True,
        )
        for algorithm, words in ALGORITHMS.items()
    },
    "error-state": StepVector(
        "attitude error over a step: transition and noise input",
        "jacobians",
        "error_state",
        (),
        "rk4",
        True,
        True,
    ),
}

#: Functions of `jacobians` that derive the Jacobians of a vector.
_JACOBIANS = {
    "rotation-vector": "rotation_vector",
    "sculling": "sculling",
    "velocity-position": "velocity_and_position",
}

#: Vectors of a step that a method computes, and their Jacobians.
VECTORS = {
    **_VECTORS,
    **{
        f"{name}-jacobian": _VECTORS[name]._replace(
            title=f"Jacobians of the {_VECTORS[name].title}", module="jacobians", function=function
        )
        for name, function in _JACOBIANS.items()
    },
}
