"""The names of the integration methods, and of the vectors of a step that they compute, as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from strapgen.catalogue.methods.integrators import Integrator
from strapgen.catalogue.methods.shaped_coning import SHAPE_TITLES
from strapgen.catalogue.methods.tableaux import TITLES
from strapgen.catalogue.methods.windows import WINDOW_TITLES
from strapgen.registry import Merged, Registry, Titles

#: The folder of the modules that derive methods.
_METHODS = "strapgen.catalogue.methods"

#: Attitude algorithms, by the state they integrate.
ALGORITHMS = {
    "dcm": "direction cosine matrix",
    "euler": "Euler parameters, scalar last",
    "cayley-klein": "Cayley-Klein parameters, scalar first",
}

#: Integration methods without files of coefficients.
INTEGRATORS = Registry("methods", Integrator)

#: Integration methods. Each family of windows has others for the same samples, such as window-8-6 beside window-7-7.
METHODS: Mapping[str, str] = Merged(TITLES, Titles(INTEGRATORS), SHAPE_TITLES, WINDOW_TITLES)

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
        return [name for name, integrator in INTEGRATORS.items() if integrator.module in self.families]


#: Vectors of a step that a method computes.
_VECTORS = {
    "rotation-vector": StepVector(
        "rotation vector of a step",
        "attitude_step",
        "rotation_vector",
        (f"{_METHODS}.magnus", f"{_METHODS}.munthe_kaas", f"{_METHODS}.coning"),
        "coning-combined",
        True,
    ),
    "sculling": StepVector(
        "sculling term of a step, by duality with coning",
        "sculling_term",
        "sculling",
        (f"{_METHODS}.coning",),
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

#: Functions of `vector_jacobians` that derive the Jacobians of a vector.
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
            title=f"Jacobians of the {_VECTORS[name].title}", module="vector_jacobians", function=function
        )
        for name, function in _JACOBIANS.items()
    },
}
