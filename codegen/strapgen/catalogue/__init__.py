"""The catalogue: every algorithm by name.

The names are plain data, so that listing and checking them imports no computer algebra; a kernel's module is
loaded when it is derived.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

from strapgen import checks
from strapgen.catalogue.tableaux import TABLEAUX, TITLES
from strapgen.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.kernel import Kernel

#: Attitude algorithms, by the state they integrate.
ALGORITHMS = {
    "dcm": "direction cosine matrix",
    "euler": "Euler parameters, scalar last",
    "cayley-klein": "Cayley-Klein parameters, scalar first",
}

#: Integration methods.
METHODS = TITLES

#: The thesis's methods, which the checked-in sources are generated for.
STANDARD_METHODS = ("rk1", "rk2", "rk3", "rk4")

#: Most angle increments that one step may take.
MOST_INCREMENTS = 8

#: Motions with a closed-form attitude, and the unit of each of their parameters.
MOTIONS = {
    "constant": dict.fromkeys("xyz", "rad/s"),
    "sinusoidal": dict.fromkeys("ab", "rad/s"),
    "coning": dict.fromkeys("abg", "rad/s"),
    "polynomial": {"a0": "rad/s", **{f"a{k}": f"rad/s^{k + 1}" for k in range(1, 5)}},
}


class Recipe(NamedTuple):
    """Where a kernel that takes no method is derived: a module of this package, a function, its arguments."""

    title: str
    module: str
    function: str
    arguments: tuple[str, ...] = ()


#: Kernels that take no method.
KERNELS = {
    **{
        f"{algorithm}-product": Recipe(
            f"{title}: state after a transition", "runge_kutta", "product", (algorithm,)
        )
        for algorithm, title in ALGORITHMS.items()
    },
    "dcm-orthonormalize": Recipe(
        "orthonormalization by dual rows, the thesis's scheme", "orthonormal", "dcm"
    ),
    "dcm-orthonormalize-optimal": Recipe("the nearest rotation", "orthonormal", "dcm_optimal"),
    "dcm-orthonormalize-first-order": Recipe(
        "the nearest rotation to first order", "orthonormal", "dcm_first_order"
    ),
    "dcm-orthonormalize-second-order": Recipe(
        "the nearest rotation to second order", "orthonormal", "dcm_second_order"
    ),
    "euler-normalize": Recipe("exact normalization", "orthonormal", "euler"),
    "cayley-klein-normalize": Recipe("exact normalization", "orthonormal", "cayley_klein"),
    **{
        f"{to}-from-{source}": Recipe(
            f"conversion: {ALGORITHMS[to]} from {ALGORITHMS[source]}",
            "conversions",
            f"{to}_from_{source}".replace("-", "_"),
        )
        for to in ALGORITHMS
        for source in ALGORITHMS
        if to != source
    },
    "error-matrix": Recipe("scale, skew and drift of a computed attitude", "error_matrix", "error_matrix"),
    **{
        f"{motion}-truth": Recipe(
            f"rate and true attitude of the {motion} motion", "motions", "truth", (motion,)
        )
        for motion in MOTIONS
    },
    **{
        f"{motion}-increments": Recipe(
            f"exact increments of the {motion} motion", "motions", "increments", (motion,)
        )
        for motion in MOTIONS
    },
}


class Choice(NamedTuple):
    """A kernel of the catalogue: its name, and method and increments where it is an attitude step.

    A step without increments is given the body rate at every node of its method.
    """

    name: str
    method: str | None = None
    increments: int | None = None

    @property
    def kernel(self) -> str:
        """Name of the kernel."""
        return self.name if self.method is None else f"{self.name}-{self.method}-{self.increments or 'rates'}"


def choose(
    name: str, method: str | None = None, increments: int | None = None, rates: bool = False
) -> Choice:
    """Check a choice of kernel and fill in the defaults: fourth order, two increments.

    Raises
    ------
    InputError
        If a name is unknown, a method is given for a kernel that takes none, or increments for a step that
        takes rates.

    Examples
    --------
    >>> choose("euler").kernel
    'euler-rk4-2'
    """
    checks.choice("algorithm", name, [*ALGORITHMS, *KERNELS])
    if name in KERNELS:
        for option, value in (("method", method), ("increments", increments), ("rates", rates or None)):
            if value is not None:
                takers = ", ".join(ALGORITHMS)
                raise InputError(f"kernel {name} takes no {option} (got {value}); these do: {takers}")
        return Choice(name)
    method = checks.choice("method", "rk4" if method is None else method, METHODS)
    if rates:
        if increments is not None:
            raise InputError(
                f"a step takes increments or rates, not both (got {increments} increments and rates)"
            )
        return Choice(name, method)
    increments = checks.count("increments", 2 if increments is None else increments, largest=MOST_INCREMENTS)
    return Choice(name, method, increments)


def orthonormalizations(algorithm: str) -> list[str]:
    """Return the kernels that orthonormalize the state of an algorithm."""
    starts = (f"{algorithm}-orthonormalize", f"{algorithm}-normalize")
    return [name for name in KERNELS if name.startswith(starts)]


def standard() -> list[Choice]:
    """Return the standard catalogue: every algorithm by the thesis's methods on two increments, and all else."""
    steps = [Choice(algorithm, method, 2) for algorithm in ALGORITHMS for method in STANDARD_METHODS]
    return steps + [Choice(name) for name in KERNELS]


def derive(choice: Choice) -> Kernel:
    """Derive a kernel exactly.

    Parameters
    ----------
    choice : Choice
        What `choose` returned.
    """
    if choice.method is None:
        recipe = KERNELS[choice.name]
        function = getattr(import_module(f"{__name__}.{recipe.module}"), recipe.function)
        kernel: Kernel = function(*recipe.arguments)
        return kernel
    from strapgen.catalogue.kinematics import KINEMATICS
    from strapgen.catalogue.runge_kutta import step

    return step(KINEMATICS[choice.name], TABLEAUX[choice.method], choice.increments)
