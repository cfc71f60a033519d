"""Choice of a kernel: names and options are checked, defaults are filled in."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strapgen import registration
from strapgen.catalogue.choice import (
    AnyAlgorithm,
    AnyMethod,
    Choice,
    constant_options,
    named,
    read_constants,
)
from strapgen.catalogue.methods.method_spec import MOST_INCREMENTS, MethodSpec, RequestedSamples
from strapgen.catalogue.methods.tableaux import TABLEAUX
from strapgen.catalogue.methods.window import Window
from strapgen.catalogue.methods.windows import EXACT
from strapgen.catalogue.names import (
    ALGORITHMS,
    INTEGRATORS,
    KERNELS,
    LAYOUT_KERNELS,
    METHODS,
    STANDARD_METHODS,
    VECTORS,
    StepVector,
    is_built_in,
    named_method,
    reserved,
)
from strapgen.catalogue.user import loading
from strapgen.ir import checks
from strapgen.ir.checks import some
from strapgen.ir.exceptions import InputError
from strapgen.ir.kernel_info import Description

if TYPE_CHECKING:
    from strapgen.catalogue.choice import Constants
    from strapgen.kernel.kernel import Kernel

#: What every message about an algorithm allows beside the names.
_FILE = "a Python file"


def choose(
    name: AnyAlgorithm,
    method: AnyMethod | None = None,
    increments: int | None = None,
    rates: bool = False,
    previous: int | None = None,
    ahead: int | None = None,
    constants: Mapping[str, Any] | None = None,
    layout: str | Path | Description | None = None,
) -> Choice:
    """Check a choice of kernel and fill in the defaults: fourth order, two increments.

    Parameters
    ----------
    name : str, path, Choice or AttitudeAlgorithm
        A name of the catalogue, a user's Python file, or the entry point of one. A choice, and that of an algorithm
        object, is returned as it is; the other parameters do not go with it.
    method : str, Tableau, Window or ShapedConing, optional
    increments : int, optional
        Increments in a step.
    previous, ahead : int, optional
        Increments from before the step and from after it that it takes in addition, together at most 32. Of a window
        they choose the filters with so many of its samples on that side.
    rates : bool, optional
        Whether the step takes the rate at the nodes of its method in place of increments.
    constants : mapping of str to number, or to an array or nested sequence of numbers, optional
        Values of inputs of a kernel that is no attitude step, in their units and row by row; they are then constants
        of its code. Of a user's kernel with unknowns, values of these. A float stands for its shortest decimal form.
        `derive` refuses what the kernel has no input for.
    layout : path or Description, optional
        Of the kernels "separate", "torques", "magnetic-field" and "filter": the file that describes the gyros, the
        field or the filter, or what was read from it.

    Raises
    ------
    InputError
        If a name is unknown, or an option does not go with the kernel or with another option.

    Examples
    --------
    >>> choose("euler").kernel
    'euler-rk4-2'
    >>> choose("temperature-coefficient", constants={"slope_above": 0}).constants
    (('slope_above', (Fraction(0, 1),)),)
    """
    name = named("choose", name)
    if isinstance(name, Choice):
        stated: dict[str, Any] = {"method": method, "increments": increments, "rates": rates or None}
        stated |= {"previous": previous, "ahead": ahead, "constants": constants, "layout": layout}
        for option, value in stated.items():
            if value is not None:
                raise InputError(f"{option} is {value!r}, but the choice of {name.kernel} has its own")
        return name
    name = os.fspath(name)
    asked = RequestedSamples(increments, rates, previous, ahead)
    takes_method = name in ALGORITHMS or name in VECTORS  # asked first: others need what is installed
    if name.endswith(".py") or (not takes_method and name not in reserved() and name in loading.installed()):
        choice = _choose_users(name, method, asked)
    elif takes_method:
        choice = _choose_method(name, method, asked)
    else:
        if name not in reserved():
            shown = [kernel for kernel, recipe in KERNELS.items() if recipe.standard]
            names = [*_algorithms(), *VECTORS, *shown, *KERNELS, *LAYOUT_KERNELS]
            checks.choice("algorithm", name, dict.fromkeys(names), _FILE, "kernels")
        options = {
            "method": method if isinstance(method, str) or method is None else method.name,
            "increments": increments,
            "rates": rates or None,
            "previous": previous or None,
            "ahead": ahead or None,
        }
        for option, value in options.items():
            if value is not None:
                takers = ", ".join([*ALGORITHMS, *VECTORS])
                raise InputError(f"kernel {name} takes no {option} (got {value}); these do: {takers}")
        choice = Choice(name)
    if layout is not None or (not takes_method and name in LAYOUT_KERNELS):
        choice = _with_layout(choice, layout)
    return choice if constants is None else _with_constants(choice, constants)


def _with_constants(choice: Choice, constants: Mapping[str, Any]) -> Choice:
    """Return a choice with constants in place of inputs."""
    values = read_constants(constants)
    if choice.user_kernel is not None and choice.user_kernel.unknowns:
        return Choice.of_user(_with_values(choice.user_kernel.kernel, values))
    if values and (choice.name in ALGORITHMS or choice.name in VECTORS or choice.user_kernel is not None):
        raise InputError(
            f"algorithm {choice.name} takes no constants (got {values[0][0]}); kernels without a method do, such as "
            "imu-compensate"
        )
    return replace(choice, constants=values)


def _with_values(kernel: Kernel, values: Constants) -> Kernel:
    """Return a user's kernel with numbers in place of unknowns, stated in its arguments."""
    for name, numbers in values:
        if len(numbers) != 1:
            raise InputError(f"kernel {kernel.name}: {name} has {len(numbers)} numbers; 1 is needed")
    chosen = kernel.substitute({name: number for name, (number,) in values})
    return replace(chosen, arguments=f"{kernel.arguments} {constant_options(values)}".strip())


def _with_layout(choice: Choice, layout: str | Path | Description | None) -> Choice:
    if choice.name not in LAYOUT_KERNELS:
        raise InputError(f"{choice.name} takes no layout; these do: {', '.join(LAYOUT_KERNELS)}")
    if layout is None:
        others = ", ".join(name for name in KERNELS if name.startswith(f"{choice.name}-"))
        built_in = f"; kernels of built-in ones are {others}" if others else ""
        raise InputError(
            f"{choice.name} needs a file: layout names it, in a command --layout, --field or --filter{built_in}"
        )
    if isinstance(layout, str | os.PathLike):
        read: Callable[[str | os.PathLike[str]], Description] = registration.load(
            LAYOUT_KERNELS[choice.name].reader
        )
        layout = read(layout)
    kernel = f"{choice.name}-{layout.name}"
    if kernel in KERNELS:
        raise InputError(f"a layout called {layout.name} would make the kernel {kernel}, which exists")
    return replace(choice, layout=layout)


def _choose_method(name: str, method: AnyMethod | None, asked: RequestedSamples) -> Choice:
    """Return the choice of an attitude step of the catalogue, or of a vector of one."""
    vector = VECTORS.get(name)
    if method is None:
        method = "rk4" if vector is None else vector.default
    spec = named_method(method)
    if vector is not None:
        _require_vector(name, vector, method, spec, asked.rates)
    if spec is None:
        raise checks.unknown_name("method", method, METHODS)
    spec, samples = spec.select(asked)
    is_named = not spec.file and is_built_in(spec.name) and named_method(spec.name) == spec
    choice = Choice(name, spec.name if is_named else spec, *samples)
    if not is_named and choice.kernel in KERNELS:
        raise InputError(
            f"a {spec.kind} called {spec.name} would make the kernel {choice.kernel}, which exists"
        )
    return choice


def _require_vector(
    name: str, vector: StepVector, method: AnyMethod, spec: MethodSpec | None, rates: bool
) -> None:
    """Refuse a method that cannot compute a vector of a step."""
    allowed = ", ".join(vector.methods)
    if isinstance(spec, Window):
        if not vector.takes_windows:
            raise InputError(f"{name} goes with no window; allowed methods: {allowed}")
        if spec.rotation != "fourth" and not vector.every:
            raise InputError(
                f"{name}: {spec.name} computes a rotation, not its vector; {spec.name.removesuffix(EXACT)} does"
            )
    elif spec is None or spec.own_samples is None:
        if rates and vector.every:
            raise InputError(f"{name} takes increments; rates at nodes do not go with it")
        if spec is None or spec.kind != "tableau":
            checks.choice(f"method of {name}", spec.name if spec else str(method), vector.methods)
        elif not vector.every:
            raise InputError(f"{name} goes with no tableau; allowed methods: {allowed}")


def _choose_users(name: str, method: AnyMethod | None, asked: RequestedSamples) -> Choice:
    """Load a user's algorithm with the options that the user chose."""
    if asked.rates:
        raise InputError(
            f"{name}: rates at nodes go with methods of the catalogue; the file of an algorithm says what it takes"
        )
    options: dict[str, Any] = {}
    if method is not None:
        tableau = method if isinstance(method, MethodSpec) else TABLEAUX[_tableau_name(method)]
        if tableau.kind != "tableau":
            raise InputError(
                f"{name}: an algorithm of a user takes a tableau, not the {tableau.kind} {tableau.name}"
            )
        options["method"] = tableau
    if asked.increments is not None:
        options["increments"] = checks.count("increments", asked.increments, largest=MOST_INCREMENTS)
    options |= {k: v for k, v in zip(("previous", "ahead"), asked.beside, strict=True) if v}
    return Choice.of_user(loading.load(name, **options))


def _algorithms() -> list[str]:
    """Return the names of all attitude steps, the installed ones included."""
    return list(dict.fromkeys([*ALGORITHMS, *loading.installed()]))


def _tableau_name(method: str) -> str:
    if method in INTEGRATORS:
        raise InputError(f"method {method!r} has no tableau; these have: {some(TABLEAUX)}")
    return checks.choice("method", method, TABLEAUX)


def choose_step(
    name: AnyAlgorithm,
    method: AnyMethod | None = None,
    increments: int | None = None,
    rates: bool = False,
    previous: int | None = None,
    ahead: int | None = None,
    constants: Mapping[str, Any] | None = None,
) -> Choice:
    """Check a choice of attitude step; parameters and errors are those of `choose`.

    Examples
    --------
    >>> choose_step("dcm", "magnus4", 2).kernel
    'dcm-magnus4-2'
    """
    if isinstance(name, str):
        if name in KERNELS or name in VECTORS or name in LAYOUT_KERNELS:
            raise InputError(
                f"algorithm {name!r} is no attitude step; allowed: {some(_algorithms())}, or {_FILE}"
            )
        if name not in ALGORITHMS and not name.endswith(".py"):
            checks.choice("algorithm", name, _algorithms(), _FILE)
    choice = choose(name, method, increments, rates, previous, ahead, constants)
    if choice.takes_velocity:
        raise InputError(
            f"algorithm {choice.name} is a step of velocity and position; an attitude step is needed"
        )
    return choice


def standard() -> list[Choice]:
    """Return the standard catalogue: attitude steps by the thesis's methods on two increments, and other kernels."""
    steps = [Choice(algorithm, method, 2) for algorithm in ALGORITHMS for method in STANDARD_METHODS]
    return steps + [Choice(name) for name, recipe in KERNELS.items() if recipe.standard]
