"""Derivation of the kernel of a choice, and properties of its method that need no derivation."""

from __future__ import annotations

from fractions import Fraction
from functools import cache, lru_cache
from importlib import import_module
from typing import TYPE_CHECKING

from strapgen.catalogue.choice import AnyMethod, Choice
from strapgen.catalogue.method_names import INTEGRATORS, VECTORS
from strapgen.catalogue.methods import tableaux
from strapgen.catalogue.methods.shaped_coning import named_shape
from strapgen.catalogue.methods.tableau import Tableau
from strapgen.catalogue.methods.tableaux import TABLEAUX
from strapgen.catalogue.methods.window import Window
from strapgen.catalogue.methods.windows import named_window
from strapgen.catalogue.names import KERNELS, LAYOUT_KERNELS, MOST_INCREMENTS
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.catalogue.methods.coefficients import Number
    from strapgen.catalogue.methods.method import Method
    from strapgen.kernel.kernel import Kernel

#: The package of the modules in `names`.
_PACKAGE = __name__.rpartition(".")[0]


def nodes(choice: Choice) -> tuple[Number, ...]:
    """Return the nodes at which a step takes the rate; empty for one that takes increments."""
    if choice.user_kernel is not None:
        step_kernels = choice.user_kernel.head.companions
        return step_kernels.nodes if step_kernels else ()
    if choice.method is None or choice.increments is not None:
        return ()
    return _method(choice.method).nodes


def rounding(choice: Choice) -> Fraction:
    """Return the largest rounding error of a method's published coefficients; 0 if they are exact, as most are."""
    method = TABLEAUX.get(choice.method) if isinstance(choice.method, str) else choice.method
    return method.tolerance if isinstance(method, Tableau) else Fraction(0)


def enough(method: AnyMethod) -> int:
    """Return the smallest number of increments with which a step reaches the order of its method.

    >>> enough("rk4"), enough("butcher6"), enough("window-7-7")
    (2, 4, 1)
    """
    shape = named_shape(method)
    if shape is not None:
        return shape.samples
    window = named_window(method) if isinstance(method, (str, Window)) else None
    if window is not None:
        return window.increments
    loaded = _method(method)
    return next(
        count for count in range(1, MOST_INCREMENTS + 1) if loaded.limit(count, 0, 0) >= min(loaded.order, 10)
    )


def derive(choice: Choice) -> Kernel:
    """Derive a kernel exactly; raise InputError if it has no input for a constant of the choice."""
    kernel = _derived(choice)
    if not choice.constants:
        return kernel
    from strapgen.catalogue.folding import fold

    return fold(kernel, choice.constants)


def _derived(choice: Choice) -> Kernel:
    """Return the kernel of a choice with all its inputs."""
    if choice.user_kernel is not None:
        return choice.user_kernel.kernel
    if choice.method is None or isinstance(choice.method, str):
        return _known(choice)
    return _of_catalogue(choice)  # the same coefficients from two files are told apart by the kernel alone


@lru_cache(maxsize=8)  # lowering, closed forms and noise are of the same kernel, one after the other
def _known(choice: Choice) -> Kernel:
    return _of_catalogue(choice)


def _of_catalogue(choice: Choice) -> Kernel:
    if choice.method is None:
        described = choice.layout is not None
        registry = LAYOUT_KERNELS if described else KERNELS
        recipe = registry[choice.name]
        arguments = (choice.layout,) if described else recipe.arguments
        with registry.guarded(choice.name, "return a Kernel"):
            kernel: Kernel = getattr(import_module(recipe.module), recipe.function)(*arguments)
        return kernel
    with INTEGRATORS.guarded(str(choice.method), "derive a step"):
        method = _method(choice.method)
        if choice.name in VECTORS:
            vector = VECTORS[choice.name]
            function = getattr(import_module(f"{_PACKAGE}.kernels.{vector.module}"), vector.function)
            ahead = {"ahead": choice.ahead} if choice.ahead else {}
            derived: Kernel = function(method, choice.increments, choice.previous, **ahead)
            return derived
        from strapgen.catalogue.kernels.attitude_step import step
        from strapgen.catalogue.kinematics import KINEMATICS

        return step(KINEMATICS[choice.name], method, choice.increments, choice.previous, choice.ahead)


def companion(kernel: Kernel, name: str) -> Kernel:
    """Return a kernel named in a step's `companions`: the user's own if there is one, else that of the catalogue."""
    return next((brought for brought in kernel.own if brought.name == name), None) or derive(Choice(name))


@cache
def _require_conditions(tableau: Tableau) -> None:
    """Refuse a tableau that misses a condition of its order, a built-in one too."""
    try:
        tableaux.verify(tableau)
    except InputError as error:
        raise InputError(f"tableau {tableau.name}: {error}") from None


def _method(method: AnyMethod) -> Method:
    """Return a method by its name, from its tableau or from its window."""
    from strapgen.catalogue.methods import coning, runge_kutta, windowed

    shape = named_shape(method)
    if shape is not None:
        return coning.shaped(shape)
    window = named_window(method) if isinstance(method, (str, Window)) else None
    if window is not None:
        return windowed.method(window)
    tableau = method if isinstance(method, Tableau) else TABLEAUX.get(str(method))
    if tableau is not None:
        _require_conditions(tableau)
        return runge_kutta.method(tableau)
    name = str(method)
    family = INTEGRATORS[name]
    with INTEGRATORS.guarded(name, "return a Method"):
        integrator: Method = import_module(family.module).method(*(family.arguments or (family.order,)))
    return integrator
