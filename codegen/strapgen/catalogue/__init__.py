"""The catalogue: every algorithm by name.

The names are plain data, so that listing and checking them imports no computer algebra; a kernel's module is
loaded when it is derived.
"""

from __future__ import annotations

import os
from fractions import Fraction
from importlib import import_module
from typing import TYPE_CHECKING, Any, NamedTuple

from strapgen import checks
from strapgen.catalogue import user
from strapgen.catalogue.tableaux import TABLEAUX, TITLES, Tableau
from strapgen.exceptions import InputError, InputTypeError

if TYPE_CHECKING:
    from strapgen.catalogue.coefficients import Number
    from strapgen.catalogue.steps import Method
    from strapgen.kernel import Kernel

#: Attitude algorithms, by the state they integrate.
ALGORITHMS = {
    "dcm": "direction cosine matrix",
    "euler": "Euler parameters, scalar last",
    "cayley-klein": "Cayley-Klein parameters, scalar first",
}


class Integrator(NamedTuple):
    """A method without tableau: a module of this package whose ``method`` makes it of its arguments, or its order."""

    title: str
    module: str
    order: int
    takes_rates: bool = True
    arguments: tuple[str, ...] = ()


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
    "munthe-kaas4": Integrator("Runge-Kutta-Munthe-Kaas method of order 4", "munthe_kaas", 4),
    "coning-compressed": Integrator(
        "compressed coning coefficients, made for coning", "coning_methods", 4, False, ("compressed",)
    ),
    "coning-uncompressed": Integrator(
        "uncompressed coning coefficients, made for polynomial rates",
        "coning_methods",
        4,
        False,
        ("uncompressed",),
    ),
    "coning-combined": Integrator(
        "coning coefficients for both, with the terms of third and fourth order",
        "coning_methods",
        6,
        False,
        ("combined",),
    ),
    "coning-polynomial": Integrator(
        "uncompressed coning coefficients, with the terms of third and fourth order",
        "coning_methods",
        6,
        False,
        ("polynomial",),
    ),
}

#: Integration methods.
METHODS = {**TITLES, **{name: integrator.title for name, integrator in INTEGRATORS.items()}}

#: Methods of the standard catalogue: the thesis's.
STANDARD_METHODS = ("rk1", "rk2", "rk3", "rk4")

#: Most angle increments that one step may take, and most that it may keep from the steps before.
MOST_INCREMENTS = 8
MOST_PREVIOUS = 3

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
    arguments: tuple[Any, ...] = ()
    standard: bool = True


#: Orders of the updates that are cut off.
UPDATE_ORDERS = range(1, 21)

#: Kernels of algorithms in two speeds that are in the standard catalogue; their variants are not.
_STANDARD_TWO_SPEED = (
    *("dcm-update", "coning-fast", "sculling-fast-2", "dcm-velocity-2"),
    *("euler-from-dcm-sheppard", "dcm-from-euler-angles", "euler-angles-from-dcm"),
)

#: Kernels of algorithms in two speeds: they take no method.
_TWO_SPEED = {
    **{
        f"{algorithm}-update": Recipe(
            f"{title}: update by a rotation vector", "updates", "update", (algorithm,)
        )
        for algorithm, title in ALGORITHMS.items()
    },
    **{
        f"{algorithm}-update-{order}": Recipe(
            f"{title}: update by a rotation vector, order {order}",
            "updates",
            "update",
            (algorithm, order),
        )
        for algorithm, title in ALGORITHMS.items()
        for order in UPDATE_ORDERS
    },
    **{
        f"{algorithm}-navigation-update{suffix}": Recipe(
            f"{title}: update by the rotation of the navigation frame{words}",
            "updates",
            "navigation_update",
            (algorithm, order),
        )
        for algorithm, title in ALGORITHMS.items()
        for order, suffix, words in ((1, "-1", ", order 1"), (2, "-2", ", order 2"), (None, "", ""))
    },
    "navigation-rotation": Recipe(
        "rotation of the navigation frame, trapezoidal", "updates", "navigation_rotation"
    ),
    "coning-fast": Recipe("rotation vector by recursion: fast loop", "coning_sculling", "coning"),
    "coning-slow": Recipe("rotation vector by recursion: slow loop", "coning_sculling", "rotation_vector"),
    **{
        f"sculling-fast-{form}": Recipe(
            f"sculling integral S{form} by recursion: fast loop", "coning_sculling", "sculling", (form,)
        )
        for form in (1, 2)
    },
    **{
        f"{name}-{what}": Recipe(title, "acceleration", function, (name, *more))
        for name in ("dcm", "euler")
        for what, title, function, *more in (
            ("acceleration", "acceleration transformation", "transformation"),
            ("velocity-1", "velocity increment in navigation axes with S1", "velocity", 1),
            ("velocity-2", "velocity increment in navigation axes with S2", "velocity", 2),
        )
    },
    "navigation-velocity": Recipe(
        "velocity correction for the rotation of the navigation frame", "acceleration", "navigation_velocity"
    ),
    **{
        f"two-speed-fast-{form}": Recipe(f"two speeds: fast loop with S{form}", "two_speed", "fast", (form,))
        for form in (1, 2)
    },
    **{
        f"{name}-two-speed-slow-{form}": Recipe(
            f"two speeds: slow loop with S{form}", "two_speed", "slow", (name, form)
        )
        for name in ("dcm", "euler")
        for form in (1, 2)
    },
    **{
        f"{name}-two-speed-navigation": Recipe(
            "two speeds: navigation loop", "two_speed", "navigation", (name,)
        )
        for name in ("dcm", "euler")
    },
    "dcm-rows-orthogonalize": Recipe(
        "rows made orthogonal, to first order", "orthonormal", "rows_orthogonalized"
    ),
    "dcm-rows-normalize": Recipe("rows made of length 1, to first order", "orthonormal", "rows_normalized"),
    "dcm-third-row": Recipe("third row from the first two", "orthonormal", "third_row"),
    **{
        f"{name}-normalize-first-order": Recipe(
            "normalization to first order", "orthonormal", "normalized_first_order", (name,)
        )
        for name in ("euler", "cayley-klein")
    },
    "euler-from-dcm-sheppard": Recipe(
        "conversion: the largest parameter keeps its sign",
        "conversions",
        "euler_from_dcm_followed",
        ("element",),
    ),
    "euler-from-dcm-continuous": Recipe(
        "conversion: the nearer sign to the call before",
        "conversions",
        "euler_from_dcm_followed",
        ("product",),
    ),
    "dcm-from-euler-angles": Recipe(
        "conversion: direction cosine matrix from Euler angles", "euler_angles", "dcm_from_euler_angles"
    ),
    "euler-angles-from-dcm": Recipe(
        "conversion: Euler angles from direction cosine matrix", "euler_angles", "euler_angles_from_dcm"
    ),
}

TWO_SPEED = {
    name: recipe._replace(standard=name in _STANDARD_TWO_SPEED) for name, recipe in _TWO_SPEED.items()
}

#: Kernels that take no method.
KERNELS = {
    **{
        f"{algorithm}-product": Recipe(f"{title}: state after a transition", "steps", "product", (algorithm,))
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
    **TWO_SPEED,
}


class StepVector(NamedTuple):
    """A vector of one step, by a method: a module of this package, a function, modules of methods that go with it."""

    title: str
    module: str
    function: str
    families: tuple[str, ...]
    default: str

    @property
    def methods(self) -> list[str]:
        """Names of the methods that go with it."""
        return [name for name, integrator in INTEGRATORS.items() if integrator.module in self.families]


#: Vectors of a step that are derived by a method.
VECTORS = {
    "rotation-vector": StepVector(
        "rotation vector of a step",
        "steps",
        "rotation_vector",
        ("magnus", "munthe_kaas", "coning_methods"),
        "coning-combined",
    ),
    "sculling": StepVector(
        "sculling term of a step, by duality with coning",
        "coning_methods",
        "sculling",
        ("coning_methods",),
        "coning-combined",
    ),
}


#: Names that no algorithm of a user may have.
RESERVED = (*ALGORITHMS, *VECTORS, *KERNELS)


class Choice(NamedTuple):
    """A kernel of the catalogue: its name, and method and samples where it is an attitude step or a vector of one.

    A step without increments is given the body rate at every node of its method; `previous` counts increments before
    the step that it takes too.
    """

    name: str
    method: str | Tableau | None = None
    increments: int | None = None
    previous: int = 0

    @property
    def method_name(self) -> str | None:
        """Name of the method."""
        return self.method.name if isinstance(self.method, Tableau) else self.method

    @property
    def kernel(self) -> str:
        """Name of the kernel."""
        if self.method is None:
            return self.name
        kept = f"-previous{self.previous}" if self.previous else ""
        return f"{self.name}-{self.method_name}-{self.increments or 'rates'}{kept}"

    @property
    def identity(self) -> str:
        """What tells this choice from every other one: its kernel's name, and what a user made it of."""
        if self.name in user.KERNELS:
            return f"{self.kernel} {user.KERNELS[self.name]!r}"
        return f"{self.kernel} {self.method!r}" if isinstance(self.method, Tableau) else self.kernel


def choose(
    name: str,
    method: str | Tableau | None = None,
    increments: int | None = None,
    rates: bool = False,
    previous: int = 0,
) -> Choice:
    """Check a choice of kernel and fill in the defaults: fourth order, two increments.

    Parameters
    ----------
    name : str
        A name of the catalogue, a user's Python file, or the entry point of one.
    method : str or Tableau, optional
    increments, previous : int, optional
        Increments of a step, and increments before it that it takes too.
    rates : bool, optional
        Whether the step takes the rate at the nodes of its method instead.

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
    if isinstance(name, os.PathLike):
        name = os.fspath(name)
    if not isinstance(name, str):
        raise InputTypeError(f"algorithm is {name!r}; a name or the path of a Python file is needed")
    if name in user.KERNELS:
        for option, value in (
            ("method", method),
            ("increments", increments),
            ("rates", rates),
            ("previous", previous),
        ):
            if value:
                raise InputError(f"kernel {name} is loaded with its options; it takes no {option}")
        return Choice(name)
    if name.endswith(".py") or (name not in RESERVED and name in user.installed()):
        return _choose_own(name, method, increments, rates, previous)
    if name not in RESERVED:
        shown = [kernel for kernel, recipe in KERNELS.items() if recipe.standard]
        raise InputError(
            f"algorithm {name!r} is not known; "
            f"allowed: {_allowed(*VECTORS, *shown, 'other kernels of strapgen list')}"
        )
    if name in KERNELS:
        given = {
            "method": method.name if isinstance(method, Tableau) else method,
            "increments": increments,
            "rates": rates or None,
            "previous": previous or None,
        }
        for option, value in given.items():
            if value is not None:
                takers = ", ".join([*ALGORITHMS, *VECTORS])
                raise InputError(f"kernel {name} takes no {option} (got {value}); these do: {takers}")
        return Choice(name)
    if name in VECTORS:
        if isinstance(method, Tableau):
            raise InputError(
                f"{name} goes with no tableau; allowed methods: {', '.join(VECTORS[name].methods)}"
            )
        method = VECTORS[name].default if method is None else method
        checks.choice(f"method of {name}", method, VECTORS[name].methods)
    if not isinstance(method, Tableau):
        method = checks.choice("method", "rk4" if method is None else method, METHODS)
    previous = checks.count("previous", previous, smallest=0, largest=MOST_PREVIOUS)
    if rates:
        if increments is not None or previous:
            what = f"{increments} increments" if increments is not None else f"{previous} previous ones"
            raise InputError(f"a step takes increments or rates, not both (got {what} and rates)")
        if method in INTEGRATORS and not INTEGRATORS[method].takes_rates:
            raise InputError(f"method {method} takes increments; rates at nodes do not go with it")
        return Choice(name, method)
    increments = checks.count("increments", 2 if increments is None else increments, largest=MOST_INCREMENTS)
    return Choice(name, method, increments, previous)


def _choose_own(
    name: str, method: str | Tableau | None, increments: int | None, rates: bool, previous: int
) -> Choice:
    """Load a user's algorithm with the options that are given."""
    if rates:
        raise InputError(f"{name}: an algorithm of a user takes increments, not rates")
    options: dict[str, Any] = {}
    if method is not None:
        options["method"] = method if isinstance(method, Tableau) else TABLEAUX[_tableau_name(method)]
    if increments is not None:
        options["increments"] = checks.count("increments", increments, largest=MOST_INCREMENTS)
    if previous:
        options["previous"] = checks.count("previous", previous, smallest=0, largest=MOST_PREVIOUS)
    return Choice(user.load(name, frozenset(RESERVED), lambda known: derive(Choice(known)), **options).name)


def _allowed(*more: str) -> str:
    return f"{', '.join(dict.fromkeys([*ALGORITHMS, *user.installed(), *more]))}, or a Python file"


def _tableau_name(method: str) -> str:
    if method in INTEGRATORS:
        raise InputError(f"method {method!r} has no tableau; these have: {', '.join(TABLEAUX)}")
    return checks.choice("method", method, TABLEAUX)


def choose_step(
    name: str,
    method: str | Tableau | None = None,
    increments: int | None = None,
    rates: bool = False,
    previous: int = 0,
) -> Choice:
    """Check a choice of attitude step; parameters and errors are those of `choose`."""
    if name in KERNELS or name in VECTORS:
        raise InputError(f"algorithm {name!r} is no attitude step; allowed: {_allowed()}")
    return choose(name, method, increments, rates, previous)


def increments(choice: Choice) -> int:
    """Return how many increments belong to a step: 1 for one that takes rates, each over a whole step."""
    if choice.name in user.KERNELS:
        kernel = user.KERNELS[choice.name]
        return kernel.inputs[1].shape[0] - (kernel.companions.previous if kernel.companions else 0)
    return choice.increments or 1


def previous(choice: Choice) -> int:
    """Return how many increments before it a step takes too."""
    if choice.name in user.KERNELS:
        companions = user.KERNELS[choice.name].companions
        return companions.previous if companions else 0
    return choice.previous


def nodes(choice: Choice) -> tuple[Number, ...]:
    """Return the nodes at which a step takes the rate; empty for one that takes increments."""
    if choice.method is None or choice.increments is not None:
        return ()
    return _method(choice.method).nodes


def rounding(choice: Choice) -> Fraction:
    """Return by how much published coefficients of a chosen method may be off, which are rounded: mostly 0."""
    method = choice.method
    if isinstance(method, str):
        method = TABLEAUX.get(method)
    return Fraction(0) if method is None else method.tolerance


def enough(method: str | Tableau) -> int:
    """Return how many increments a step needs for the order of its method.

    Examples
    --------
    >>> enough("rk4"), enough("butcher6")
    (2, 4)
    """
    loaded = _method(method)
    return next(
        count for count in range(1, MOST_INCREMENTS + 1) if loaded.limit(count, 0) >= min(loaded.order, 10)
    )


def orthonormalizations(algorithm: str) -> list[str]:
    """Return the kernels that orthonormalize the state of an algorithm."""
    starts = (f"{algorithm}-orthonormalize", f"{algorithm}-normalize")
    return [name for name in KERNELS if name.startswith(starts)]


def standard() -> list[Choice]:
    """Return the standard catalogue: every algorithm by the thesis's methods on two increments, and all else."""
    steps = [Choice(algorithm, method, 2) for algorithm in ALGORITHMS for method in STANDARD_METHODS]
    return steps + [Choice(name) for name, recipe in KERNELS.items() if recipe.standard]


def derive(choice: Choice) -> Kernel:
    """Derive a kernel exactly.

    Parameters
    ----------
    choice : Choice
        What `choose` returned.
    """
    if choice.name in user.KERNELS:
        return user.KERNELS[choice.name]
    if choice.method is None:
        recipe = KERNELS[choice.name]
        function = getattr(import_module(f"{__name__}.{recipe.module}"), recipe.function)
        kernel: Kernel = function(*recipe.arguments)
        return kernel
    if choice.name in VECTORS:
        vector = VECTORS[choice.name]
        derived: Kernel = getattr(import_module(f"{__name__}.{vector.module}"), vector.function)(
            _method(choice.method), choice.increments, choice.previous
        )
        return derived
    from strapgen.catalogue.kinematics import KINEMATICS
    from strapgen.catalogue.steps import step

    return step(KINEMATICS[choice.name], _method(choice.method), choice.increments, choice.previous)


def _method(method: str | Tableau) -> Method:
    """Load a method by its name, or make one of a tableau."""
    from strapgen.catalogue import runge_kutta

    if isinstance(method, Tableau):
        return runge_kutta.method(method)
    if method in TABLEAUX:
        return runge_kutta.method(TABLEAUX[method])
    family = INTEGRATORS[method]
    made: Method = import_module(f"{__name__}.{family.module}").method(*(family.arguments or (family.order,)))
    return made
