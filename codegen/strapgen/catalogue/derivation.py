"""Derivation of the kernel of a choice, and properties of its method that need no derivation."""

from __future__ import annotations

from fractions import Fraction
from functools import lru_cache
from importlib import import_module
from typing import TYPE_CHECKING

from strapgen.catalogue.choice import AnyMethod, Choice
from strapgen.catalogue.methods.method_spec import MOST_INCREMENTS
from strapgen.catalogue.names import INTEGRATORS, KERNELS, LAYOUT_KERNELS, METHODS, VECTORS, named_method
from strapgen.ir import checks
from strapgen.ir.timing import timed

if TYPE_CHECKING:
    from strapgen.catalogue.coefficients import Number
    from strapgen.catalogue.methods.method import Method
    from strapgen.catalogue.methods.rate_fit import Fit
    from strapgen.kernel.kernel import Kernel

#: The package of the modules in `names`.
_PACKAGE = __name__.rpartition(".")[0]


def nodes(choice: Choice) -> tuple[Number, ...]:
    """Return the nodes at which a step takes the rate; empty for one that takes increments."""
    if choice.user_kernel is not None:
        step_kernels = choice.user_kernel.head.attitude_step
        return step_kernels.nodes if step_kernels else ()
    if choice.method is None or choice.increments is not None:
        return ()
    return _method(choice.method).nodes


def rounding(choice: Choice) -> Fraction:
    """Return the largest rounding error of a method's published coefficients; 0 if they are exact, as most are."""
    tolerance: Fraction = getattr(choice.method_spec, "tolerance", Fraction(0))
    return tolerance


def enough(method: AnyMethod) -> int:
    """Return the smallest number of increments with which a step reaches the order of its method.

    >>> enough("rk4"), enough("butcher6"), enough("window-7-7")
    (2, 4, 1)
    """
    spec = named_method(method)
    if spec is not None and spec.own_samples is not None:
        return spec.own_samples
    loaded = _method(method)
    return next(
        count for count in range(1, MOST_INCREMENTS + 1) if loaded.limit(count, 0, 0) >= min(loaded.order, 10)
    )


def fit(choice: Choice) -> Fit | None:
    """Return the rate over a step in terms of its increments; None where the step has no such rate.

    A step that takes rates has none, nor has a user's, nor a pair of filters, whose product counts.
    """
    if choice.method is None or choice.increments is None:
        return None
    method = _method(choice.method)
    if method.window is not None and method.window.form == "pair":
        return None
    return method.fit(choice.increments, choice.previous, choice.ahead)


def derive(choice: Choice) -> Kernel:
    """Derive a kernel exactly; raise InputError if it has no input for a constant of the choice."""
    with timed("derive", choice.kernel):
        users = choice.user_kernel
        kernel = _of_catalogue(choice, choice.identity) if users is None else users.kernel
        if not choice.constants:
            return kernel
        from strapgen.catalogue.folding import fold

        return fold(kernel, choice.constants)


@lru_cache(maxsize=8)  # lowering, closed forms and noise are of the same kernel, one after the other
def _of_catalogue(choice: Choice, _identity: str) -> Kernel:
    """Return the kernel of a choice with all its inputs; the identity tells equal choices of two files apart."""
    if choice.method is None:
        described = choice.layout is not None
        registry = LAYOUT_KERNELS if described else KERNELS
        recipe = registry[choice.name]
        arguments = (choice.layout,) if described else recipe.arguments
        with registry.guarded(choice.name, "return a Kernel"):
            kernel: Kernel = getattr(import_module(recipe.module), recipe.function)(*arguments)
        return kernel
    with INTEGRATORS.guarded(choice.method_name or "", "derive a step"):
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
    """Return a kernel named in a step's `attitude_step`: the user's own if there is one, else that of the catalogue."""
    return next((brought for brought in kernel.bundled_kernels if brought.name == name), None) or derive(
        Choice(name)
    )


def _method(method: AnyMethod) -> Method:
    """Load a method by its name, from its tableau or from its window."""
    spec = named_method(method)
    if spec is None:
        raise checks.unknown_name("method", method, METHODS)
    module, function, arguments = spec.recipe
    with INTEGRATORS.guarded(spec.name, "return a Method"):
        loaded: Method = getattr(import_module(module), function)(*arguments)
    return loaded
