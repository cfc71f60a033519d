"""Choice of a kernel: names and options are checked, defaults are filled in."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from strapgen import registration
from strapgen.catalogue import constants as constant_values
from strapgen.catalogue.choice import AnyMethod, Choice
from strapgen.catalogue.method_names import ALGORITHMS, INTEGRATORS, METHODS, STANDARD_METHODS, VECTORS
from strapgen.catalogue.methods.integrators import TAYLOR
from strapgen.catalogue.methods.shaped_coning import SHAPES, ShapedConing, named_shape
from strapgen.catalogue.methods.tableau import Tableau
from strapgen.catalogue.methods.tableaux import TABLEAUX
from strapgen.catalogue.methods.window import Window
from strapgen.catalogue.methods.windows import EXACT, WINDOWS, named_window
from strapgen.catalogue.names import (
    KERNELS,
    LAYOUT_KERNELS,
    LEAST_WHOLE,
    MOST_BESIDE,
    MOST_INCREMENTS,
    reserved,
)
from strapgen.catalogue.user import loading
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError, InputTypeError
from strapgen.ir.recipe import Description
from strapgen.ir.suggestions import some

if TYPE_CHECKING:
    from strapgen.catalogue.constants import Constants
    from strapgen.kernel.kernel import Kernel

#: What every message about an algorithm allows beside the names.
_FILE = "a Python file"


def choose(
    name: str,
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
    name : str
        A name of the catalogue, a user's Python file, or the entry point of one.
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
        Of the kernels "separate" and "torques": the file that describes the gyros, or what was read from it.

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
    choice = _choose(name, method, increments, rates, previous, ahead)
    if layout is not None or name in LAYOUT_KERNELS:
        choice = _with_layout(choice, layout)
    return choice if constants is None else with_constants(choice, constants)


def with_constants(choice: Choice, constants: Mapping[str, Any]) -> Choice:
    """Return a choice with constants in place of inputs; `constants` and errors are those of `choose`."""
    values = constant_values.read(constants)
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
    return replace(chosen, arguments=f"{kernel.arguments} {constant_values.options(values)}".strip())


def _with_layout(choice: Choice, layout: str | Path | Description | None) -> Choice:
    if choice.name not in LAYOUT_KERNELS:
        raise InputError(f"{choice.name} takes no layout; {' and '.join(LAYOUT_KERNELS)} do")
    if layout is None:
        others = ", ".join(name for name in KERNELS if name.startswith(f"{choice.name}-"))
        raise InputError(f"{choice.name} needs the file of a layout; kernels of built-in ones are {others}")
    if isinstance(layout, str | os.PathLike):
        read: Callable[[str | os.PathLike[str]], Description] = registration.load(
            LAYOUT_KERNELS[choice.name].reader
        )
        layout = read(layout)
    kernel = f"{choice.name}-{layout.name}"
    if kernel in KERNELS:
        raise InputError(f"a layout called {layout.name} would make the kernel {kernel}, which exists")
    return replace(choice, layout=layout)


def _choose(
    name: str,
    method: AnyMethod | None,
    increments: int | None,
    rates: bool,
    previous: int | None,
    ahead: int | None,
) -> Choice:
    """Return the choice without constants."""
    if isinstance(name, os.PathLike):
        name = os.fspath(name)
    if not isinstance(name, str):
        raise InputTypeError(f"algorithm is {name!r}; a name or the path of a Python file is needed")
    if name.endswith(".py") or (name not in reserved() and name in loading.installed()):
        return _choose_users(name, method, increments, rates, previous, ahead)
    if name not in reserved():
        shown = [kernel for kernel, recipe in KERNELS.items() if recipe.standard]
        names = [*_algorithms(), *VECTORS, *shown, *KERNELS, *LAYOUT_KERNELS]
        checks.choice("algorithm", name, dict.fromkeys(names), _FILE, "kernels")
    if name in KERNELS or name in LAYOUT_KERNELS:
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
        return Choice(name)
    if isinstance(method, str) and method in TABLEAUX and method not in TABLEAUX.own:
        method = TABLEAUX[method]
    if isinstance(method, (str, Window)):
        window = named_window(method)
        if window is not None:
            return _choose_window(name, window, increments, rates, previous, ahead)
    shape = named_shape(method)
    if shape is not None:
        return _choose_shape(name, shape, increments, rates, (previous, ahead))
    assert not isinstance(method, (Window, ShapedConing)), "those are taken before"
    if name in VECTORS:
        if rates and VECTORS[name].every:
            raise InputError(f"{name} takes increments; rates at nodes do not go with it")
        if isinstance(method, Tableau) and not VECTORS[name].every:
            raise InputError(
                f"{name} goes with no tableau; allowed methods: {', '.join(VECTORS[name].methods)}"
            )
        method = VECTORS[name].default if method is None else method
        if not isinstance(method, Tableau):
            checks.choice(f"method of {name}", method, VECTORS[name].methods)
    if not isinstance(method, Tableau):
        method = checks.choice("method", "rk4" if method is None else method, METHODS)
    return _choose_samples(name, method, increments, rates, _beside(previous, ahead))


def _choose_samples(
    name: str, method: str | Tableau, increments: int | None, rates: bool, beside: tuple[int, int]
) -> Choice:
    previous, ahead = beside
    if rates:
        if increments is not None or previous or ahead:
            more = f"{previous} previous ones" if previous else f"{ahead} ahead"
            what = f"{increments} increments" if increments is not None else more
            raise InputError(f"a step takes increments or rates, not both (got {what} and rates)")
        if method in INTEGRATORS and not INTEGRATORS[str(method)].takes_rates:
            raise InputError(f"method {method} takes increments; rates at nodes do not go with it")
        return Choice(name, method)
    increments = checks.count("increments", 2 if increments is None else increments, largest=MOST_INCREMENTS)
    if ahead and method in INTEGRATORS and not INTEGRATORS[str(method)].takes_ahead:
        raise InputError(f"method {method} takes no increments ahead; --previous goes with it")
    if isinstance(method, str):
        _require_whole_rate(method, increments + previous + ahead)
    return Choice(name, method, increments, previous, ahead)


def _require_whole_rate(method: str, samples: int) -> None:
    """Refuse a Taylor series that ends before the rate's polynomial through many samples does.

    The powers of time that it leaves out are of first order in the increments: the step does not turn by their sum.
    """
    allowed = [
        name
        for name, integrator in INTEGRATORS.items()
        if integrator.module == TAYLOR and (samples < LEAST_WHOLE or integrator.order >= samples)
    ]
    if method not in INTEGRATORS or INTEGRATORS[method].module != TAYLOR or method in allowed:
        return
    series = f"{allowed[0]} to {allowed[-1]} and fit-exact keep" if len(allowed) > 1 else "fit-exact keeps"
    raise InputError(
        f"method {method} leaves out part of the rate through {samples} samples, those beside the step included; "
        f"{series} all of it"
    )


def _choose_window(
    name: str, window: Window, increments: int | None, rates: bool, previous: int | None, ahead: int | None
) -> Choice:
    """Return the choice of a window, or of the filters of its family with other numbers of samples beside the step."""
    if name in VECTORS and not VECTORS[name].takes_windows:
        raise InputError(f"{name} goes with no window; allowed methods: {', '.join(VECTORS[name].methods)}")
    if name in VECTORS and window.rotation != "fourth" and not VECTORS[name].every:
        raise InputError(
            f"{name}: {window.name} computes a rotation, not its vector; {window.name.removesuffix(EXACT)} does"
        )
    if rates:
        raise InputError(f"{window.name} takes increments; rates at nodes do not go with it")
    if increments is not None and checks.count("increments", increments) != window.increments:
        raise InputError(f"increments is {increments}; a step of {window.name} has {window.increments}")
    if ahead is None and previous is not None:
        ahead = window.previous + window.ahead - checks.count("previous", previous, smallest=0)
    if ahead is not None:
        chosen = window.one_sided_with(checks.count("ahead", ahead, smallest=0))
        if previous not in (None, chosen.previous):
            raise InputError(
                f"previous {previous} and ahead {ahead} are no samples of {window.name}, which has "
                f"{window.previous + window.ahead} beside the step"
            )
        window = chosen
    if f"{name}-{window.name}" in KERNELS:
        raise InputError(
            f"a window called {window.name} would make the kernel {name}-{window.name}, which exists"
        )
    method = window if window.file or named_window(window.name, WINDOWS.own) != window else window.name
    return Choice(name, method, window.increments, window.previous, window.ahead)


def _choose_shape(
    name: str,
    shape: ShapedConing,
    increments: int | None,
    rates: bool,
    beside: tuple[int | None, int | None],
) -> Choice:
    """Return the choice of coning coefficients for a band or a spectrum, which say what samples a step takes."""
    if rates:
        raise InputError(f"{shape.name} takes increments; rates at nodes do not go with it")
    stated = {"increments": increments, "previous": beside[0], "ahead": beside[1]}
    for (what, value), needed in zip(stated.items(), (shape.samples, shape.previous, 0), strict=True):
        if value is not None and checks.count(what, value, smallest=0) != needed:
            raise InputError(f"{what} is {value}; a step of {shape.name} has {needed}")
    method = shape if shape.file or SHAPES.own.get(shape.name) != shape else shape.name
    return Choice(name, method, shape.samples, shape.previous)


def _beside(previous: int | None, ahead: int | None) -> tuple[int, int]:
    """Check the numbers of increments from before a step and from after it."""
    before = checks.count("previous", previous or 0, smallest=0, largest=MOST_BESIDE)
    after = checks.count("ahead", ahead or 0, smallest=0, largest=MOST_BESIDE)
    if before + after > MOST_BESIDE:
        raise InputError(
            f"previous {before} and ahead {after} are {before + after} together; at most {MOST_BESIDE} are allowed"
        )
    return before, after


def _choose_users(
    name: str,
    method: AnyMethod | None,
    increments: int | None,
    rates: bool,
    previous: int | None,
    ahead: int | None,
) -> Choice:
    if rates:
        raise InputError(
            f"{name}: rates at nodes go with methods of the catalogue; the file of an algorithm says what it takes"
        )
    options: dict[str, Any] = {}
    if isinstance(method, (Window, ShapedConing)):
        what = "window" if isinstance(method, Window) else "coning coefficients"
        raise InputError(f"{name}: an algorithm of a user takes a tableau, not the {what} {method.name}")
    if method is not None:
        options["method"] = method if isinstance(method, Tableau) else TABLEAUX[_tableau_name(method)]
    if increments is not None:
        options["increments"] = checks.count("increments", increments, largest=MOST_INCREMENTS)
    options |= {k: v for k, v in zip(("previous", "ahead"), _beside(previous, ahead), strict=True) if v}
    return Choice.of_user(loading.load(name, **options))


def _algorithms() -> list[str]:
    """Return the names of all attitude steps, the installed ones included."""
    return list(dict.fromkeys([*ALGORITHMS, *loading.installed()]))


def _tableau_name(method: str) -> str:
    if method in INTEGRATORS:
        raise InputError(f"method {method!r} has no tableau; these have: {some(TABLEAUX)}")
    return checks.choice("method", method, TABLEAUX)


def choose_step(
    name: str,
    method: AnyMethod | None = None,
    increments: int | None = None,
    rates: bool = False,
    previous: int | None = None,
    ahead: int | None = None,
) -> Choice:
    """Check a choice of attitude step; parameters and errors are those of `choose`."""
    if name in KERNELS or name in VECTORS or name in LAYOUT_KERNELS:
        raise InputError(
            f"algorithm {name!r} is no attitude step; allowed: {some(_algorithms())}, or {_FILE}"
        )
    if isinstance(name, str) and name not in ALGORITHMS and not name.endswith(".py"):
        checks.choice("algorithm", name, _algorithms(), _FILE)
    choice = choose(name, method, increments, rates, previous, ahead)
    if choice.takes_velocity:
        raise InputError(f"algorithm {name} is a step of velocity and position; an attitude step is needed")
    return choice


def standard() -> list[Choice]:
    """Return the standard catalogue: attitude steps by the thesis's methods on two increments, and other kernels."""
    steps = [Choice(algorithm, method, 2) for algorithm in ALGORITHMS for method in STANDARD_METHODS]
    return steps + [Choice(name) for name, recipe in KERNELS.items() if recipe.standard]
