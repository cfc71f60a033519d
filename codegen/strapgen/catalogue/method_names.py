"""The names of the integration methods, and of the vectors of a step that they compute, as plain data."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, ClassVar, NamedTuple

from strapgen.catalogue.methods.method_spec import Asked, MethodSpec, StepSamples, through_samples
from strapgen.catalogue.methods.shaped_coning import SHAPE_TITLES, SHAPES
from strapgen.catalogue.methods.tableaux import TABLEAUX, TITLES
from strapgen.catalogue.methods.windows import WINDOW_TITLES, named_window
from strapgen.ir.exceptions import InputError

#: From so many samples on a Taylor series has to keep every power of time of the polynomial through them.
LEAST_WHOLE = 4

#: Attitude algorithms, by the state they integrate.
ALGORITHMS = {
    "dcm": "direction cosine matrix",
    "euler": "Euler parameters, scalar last",
    "cayley-klein": "Cayley-Klein parameters, scalar first",
}


@dataclass(frozen=True)
class Integrator:
    """A method by its name; ``method(*arguments)``, or ``method(order)``, of its module returns it."""

    title: str
    module: str
    order: int
    takes_rates: bool = True
    arguments: tuple[str, ...] = ()
    takes_ahead: bool = True
    name: str = ""

    file: ClassVar = ""
    kind: ClassVar = "method"
    own_samples: ClassVar = None

    @property
    def recipe(self) -> tuple[str, str, tuple[Any, ...]]:
        """Module, function and arguments that make a `Method` of it."""
        if self.module == "tableaux":
            return TABLEAUX[self.name].recipe
        return self.module, "method", self.arguments or (self.order,)

    @property
    def tolerance(self) -> Fraction:
        """Largest residual of a condition that the rounding of published coefficients explains."""
        return TABLEAUX[self.name].tolerance if self.module == "tableaux" else Fraction(0)

    def keeps(self, samples: int) -> bool:
        """Tell whether it is no Taylor series, or keeps every power of the rate's polynomial through the samples."""
        return self.module != "taylor" or samples < LEAST_WHOLE or self.order >= samples

    def select(self, asked: Asked) -> tuple[Integrator, StepSamples]:
        """Return the method for the samples that are asked for, and the samples.

        A Taylor series that ends before the rate's polynomial through many samples does is refused: the powers of time
        that it leaves out are of first order in the increments, and the step does not turn by their sum.
        """
        increments, previous, ahead = through_samples(
            self.name, asked, takes_rates=self.takes_rates, takes_ahead=self.takes_ahead
        )
        samples = (increments or 0) + previous + ahead
        if not self.keeps(samples):
            allowed = [
                name for name, one in INTEGRATORS.items() if one.module == "taylor" and one.keeps(samples)
            ]
            series = (
                f"{allowed[0]} to {allowed[-1]} and fit-exact keep" if len(allowed) > 1 else "fit-exact keeps"
            )
            raise InputError(
                f"method {self.name} leaves out part of the rate through {samples} samples, those beside the step "
                f"included; {series} all of it"
            )
        return self, (increments, previous, ahead)


#: Integration methods that have no tableau.
INTEGRATORS = {
    **{
        f"taylor{order}": Integrator(
            f"Taylor series of order {order} of the transition", "taylor", order, False
        )
        for order in range(1, 21)
    },
    **{
        f"magnus{order}": Integrator(f"Magnus series of order {order}", "magnus", order)
        for order in (2, 4, 6)
    },
    "fit-exact": Integrator(
        "polynomial through the increments, integrated exactly", "fit_exact", 16, takes_rates=False
    ),
    "munthe-kaas4": Integrator("Runge-Kutta-Munthe-Kaas method of order 4", "munthe_kaas", 4),
    "crouch-grossman3": Integrator("Crouch-Grossman method of order 3", "crouch_grossman", 3),
    "coning-least-squares": Integrator(
        "compressed coning coefficients, by least squares over a band",
        "frequency_shaping",
        2,
        takes_rates=False,
        takes_ahead=False,
    ),
    "coning-compressed": Integrator(
        "compressed coning coefficients, made for coning", "coning", 4, False, ("compressed",), False
    ),
    "coning-uncompressed": Integrator(
        "uncompressed coning coefficients, made for polynomial rates",
        "coning",
        4,
        False,
        ("uncompressed",),
        False,
    ),
    "coning-combined": Integrator(
        "coning coefficients for both, with the terms of third and fourth order",
        "coning",
        6,
        False,
        ("combined",),
        False,
    ),
    "coning-exact-rest": Integrator(
        "coning coefficients for both, with all other terms of the polynomial through the increments",
        "exact_rest",
        16,
        False,
        takes_ahead=False,
    ),
    "coning-polynomial": Integrator(
        "uncompressed coning coefficients, with the terms of third and fourth order",
        "coning",
        6,
        False,
        ("polynomial",),
        False,
    ),
}

INTEGRATORS = {name: replace(one, name=name) for name, one in INTEGRATORS.items()}


def named_method(method: str | MethodSpec) -> MethodSpec | None:
    """Return the method of a name, None where there is none; what is a method already is returned as it is.

    Examples
    --------
    >>> named_method("window-7-7").own_samples, named_method("rk4").title, named_method("rk5")
    (1, 'classical fourth-order Runge-Kutta method', None)
    """
    if not isinstance(method, str):
        return method if isinstance(method, MethodSpec) else None
    if method in TITLES:
        return Integrator(TITLES[method], "tableaux", 0, name=method)  # read when it is needed
    return INTEGRATORS.get(method) or SHAPES.get(method) or named_window(method)


#: Integration methods. Each family of windows has others for the same samples, such as window-8-6 beside window-7-7.
METHODS = {
    **TITLES,
    **{name: integrator.title for name, integrator in INTEGRATORS.items()},
    **SHAPE_TITLES,
    **WINDOW_TITLES,
}

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
        ("magnus", "munthe_kaas", "coning"),
        "coning-combined",
        True,
    ),
    "sculling": StepVector(
        "sculling term of a step, by duality with coning",
        "sculling_term",
        "sculling",
        ("coning",),
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
