"""The catalogue: every algorithm by name.

The names are plain data, so that listing and checking them imports no computer algebra; a kernel's module is
loaded when it is derived.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, NamedTuple

from strapgen import checks

if TYPE_CHECKING:
    from strapgen.kernel import Kernel

#: Attitude algorithms, by the state they integrate.
ALGORITHMS = {
    "dcm": "direction cosine matrix",
    "euler": "Euler parameters, scalar last",
    "cayley-klein": "Cayley-Klein parameters, scalar first",
}

#: Integration methods.
METHODS = {
    "rk1": "Euler's method, first order",
    "rk2": "Heun's method, second order",
    "rk3": "Kutta's method, third order",
    "rk4": "the classical Runge-Kutta method, fourth order",
}

#: Most angle increments that one step may take.
MOST_INCREMENTS = 8

#: Motions with a closed-form attitude, and their parameters.
MOTIONS = {
    "constant": ("x", "y", "z"),
    "sinusoidal": ("a", "b"),
    "coning": ("a", "b", "g"),
    "polynomial": ("a0", "a1", "a2", "a3", "a4"),
}


class Recipe(NamedTuple):
    """Where a kernel that takes no method is derived: a module of this package, a function, its arguments."""

    module: str
    function: str
    arguments: tuple[str, ...] = ()


#: Kernels that take no method.
KERNELS = {
    **{f"{algorithm}-product": Recipe("runge_kutta", "product", (algorithm,)) for algorithm in ALGORITHMS},
    "dcm-orthonormalize": Recipe("orthonormal", "dcm"),
    "dcm-orthonormalize-optimal": Recipe("orthonormal", "dcm_optimal"),
    "dcm-orthonormalize-first-order": Recipe("orthonormal", "dcm_first_order"),
    "dcm-orthonormalize-second-order": Recipe("orthonormal", "dcm_second_order"),
    "euler-normalize": Recipe("orthonormal", "euler"),
    "cayley-klein-normalize": Recipe("orthonormal", "cayley_klein"),
    "dcm-from-euler": Recipe("conversions", "dcm_from_euler"),
    "dcm-from-cayley-klein": Recipe("conversions", "dcm_from_cayley_klein"),
    "euler-from-dcm": Recipe("conversions", "euler_from_dcm"),
    "euler-from-cayley-klein": Recipe("conversions", "euler_from_cayley_klein"),
    "cayley-klein-from-dcm": Recipe("conversions", "cayley_klein_from_dcm"),
    "cayley-klein-from-euler": Recipe("conversions", "cayley_klein_from_euler"),
    "error-matrix": Recipe("error_matrix", "error_matrix"),
    **{f"{motion}-truth": Recipe("motions", "truth", (motion,)) for motion in MOTIONS},
    **{f"{motion}-increments": Recipe("motions", "increments", (motion,)) for motion in MOTIONS},
}


class Choice(NamedTuple):
    """A kernel of the catalogue: its name, and method and increments where it is an attitude step."""

    name: str
    method: str | None = None
    increments: int | None = None

    @property
    def kernel(self) -> str:
        """Name of the kernel."""
        return self.name if self.method is None else f"{self.name}-{self.method}-{self.increments}"


def choose(name: str, method: str | None = None, increments: int | None = None) -> Choice:
    """Check a choice of kernel and fill in the defaults: fourth order, two increments.

    Raises
    ------
    InputError
        If a name is unknown, or a method is given for a kernel that takes none.

    Examples
    --------
    >>> choose("euler").kernel
    'euler-rk4-2'
    """
    checks.choice("algorithm", name, [*ALGORITHMS, *KERNELS])
    if name in KERNELS:
        for option, value in (("method", method), ("increments", increments)):
            if value is not None:
                checks.choice(f"algorithm with {option} {value}:", name, ALGORITHMS)
        return Choice(name)
    method = checks.choice("method", "rk4" if method is None else method, METHODS)
    increments = checks.count("increments", 2 if increments is None else increments, largest=MOST_INCREMENTS)
    return Choice(name, method, increments)


def orthonormalizations(algorithm: str) -> list[str]:
    """Return the kernels that orthonormalize the state of an algorithm."""
    starts = (f"{algorithm}-orthonormalize", f"{algorithm}-normalize")
    return [name for name in KERNELS if name.startswith(starts)]


def standard() -> list[Choice]:
    """Return the standard catalogue: every algorithm by every method on two increments, and all else."""
    steps = [Choice(algorithm, method, 2) for algorithm in ALGORITHMS for method in METHODS]
    return steps + [Choice(name) for name in KERNELS]


def derive(choice: Choice) -> Kernel:
    """Derive a kernel exactly.

    Parameters
    ----------
    choice : Choice
        What `choose` returned.
    """
    if choice.method is None or choice.increments is None:
        recipe = KERNELS[choice.name]
        function = getattr(import_module(f"{__name__}.{recipe.module}"), recipe.function)
        kernel: Kernel = function(*recipe.arguments)
        return kernel
    from strapgen.catalogue.kinematics import KINEMATICS
    from strapgen.catalogue.runge_kutta import step
    from strapgen.catalogue.tableaux import TABLEAUX

    return step(KINEMATICS[choice.name], TABLEAUX[choice.method], choice.increments)
