"""Choosing checks names and options, fills in the defaults and returns a `Choice`."""

from __future__ import annotations

import os
from typing import Any

from strapgen.catalogue.choice import Choice
from strapgen.catalogue.methods.tableau import Tableau
from strapgen.catalogue.methods.tableaux import TABLEAUX
from strapgen.catalogue.names import (
    ALGORITHMS,
    INTEGRATORS,
    KERNELS,
    METHODS,
    MOST_BESIDE,
    MOST_INCREMENTS,
    RESERVED,
    STANDARD_METHODS,
    VECTORS,
)
from strapgen.catalogue.user import loading
from strapgen.support import checks
from strapgen.support.exceptions import InputError, InputTypeError
from strapgen.support.suggestions import some

#: What every message about an algorithm allows beside the names.
_FILE = "a Python file"


def choose(
    name: str,
    method: str | Tableau | None = None,
    increments: int | None = None,
    rates: bool = False,
    previous: int = 0,
    ahead: int = 0,
) -> Choice:
    """Check a choice of kernel and fill in the defaults: fourth order, two increments.

    Parameters
    ----------
    name : str
        A name of the catalogue, a user's Python file, or the entry point of one.
    method : str or Tableau, optional
    increments : int, optional
        Increments in a step.
    previous, ahead : int, optional
        Increments from before the step and from after it that it takes in addition, together at most 32.
    rates : bool, optional
        Whether the step takes the rate at the nodes of its method in place of increments.

    Raises
    ------
    InputError
        If a name is unknown, or an option does not go with the kernel or with another option.

    Examples
    --------
    >>> choose("euler").kernel
    'euler-rk4-2'
    """
    if isinstance(name, os.PathLike):
        name = os.fspath(name)
    if not isinstance(name, str):
        raise InputTypeError(f"algorithm is {name!r}; a name or the path of a Python file is needed")
    if name.endswith(".py") or (name not in RESERVED and name in loading.installed()):
        return _choose_users(name, method, increments, rates, previous, ahead)
    if name not in RESERVED:
        shown = [kernel for kernel, recipe in KERNELS.items() if recipe.standard]
        names = [*_algorithms(), *VECTORS, *shown, *KERNELS]
        checks.choice("algorithm", name, dict.fromkeys(names), _FILE, "kernels")
    if name in KERNELS:
        options = {
            "method": method.name if isinstance(method, Tableau) else method,
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
    if name in VECTORS:
        if isinstance(method, Tableau):
            raise InputError(
                f"{name} goes with no tableau; allowed methods: {', '.join(VECTORS[name].methods)}"
            )
        method = VECTORS[name].default if method is None else method
        checks.choice(f"method of {name}", method, VECTORS[name].methods)
    if not isinstance(method, Tableau):
        method = checks.choice("method", "rk4" if method is None else method, METHODS)
    previous, ahead = _beside(previous, ahead)
    if rates:
        if increments is not None or previous or ahead:
            beside = f"{previous} previous ones" if previous else f"{ahead} ahead"
            what = f"{increments} increments" if increments is not None else beside
            raise InputError(f"a step takes increments or rates, not both (got {what} and rates)")
        if method in INTEGRATORS and not INTEGRATORS[method].takes_rates:
            raise InputError(f"method {method} takes increments; rates at nodes do not go with it")
        return Choice(name, method)
    increments = checks.count("increments", 2 if increments is None else increments, largest=MOST_INCREMENTS)
    if ahead and method in INTEGRATORS and not INTEGRATORS[method].takes_ahead:
        raise InputError(f"method {method} takes no increments ahead; --previous goes with it")
    return Choice(name, method, increments, previous, ahead)


def _beside(previous: int, ahead: int) -> tuple[int, int]:
    """Check the numbers of increments from before a step and from after it."""
    before = checks.count("previous", previous, smallest=0, largest=MOST_BESIDE)
    after = checks.count("ahead", ahead, smallest=0, largest=MOST_BESIDE)
    if before + after > MOST_BESIDE:
        raise InputError(
            f"previous {before} and ahead {after} are {before + after} together; at most {MOST_BESIDE} are allowed"
        )
    return before, after


def _choose_users(
    name: str, method: str | Tableau | None, increments: int | None, rates: bool, previous: int, ahead: int
) -> Choice:
    """Load a user's algorithm with the options that the user chose."""
    if rates:
        raise InputError(f"{name}: an algorithm of a user takes increments, not rates")
    options: dict[str, Any] = {}
    if method is not None:
        options["method"] = method if isinstance(method, Tableau) else TABLEAUX[_tableau_name(method)]
    if increments is not None:
        options["increments"] = checks.count("increments", increments, largest=MOST_INCREMENTS)
    options |= {k: v for k, v in zip(("previous", "ahead"), _beside(previous, ahead), strict=True) if v}
    return Choice.of_user(loading.load(name, **options))


def _algorithms() -> list[str]:
    """Return the names of all attitude steps: those of the catalogue, and those that users have installed."""
    return list(dict.fromkeys([*ALGORITHMS, *loading.installed()]))


def _tableau_name(method: str) -> str:
    if method in INTEGRATORS:
        raise InputError(f"method {method!r} has no tableau; these have: {some(TABLEAUX)}")
    return checks.choice("method", method, TABLEAUX)


def choose_step(
    name: str,
    method: str | Tableau | None = None,
    increments: int | None = None,
    rates: bool = False,
    previous: int = 0,
    ahead: int = 0,
) -> Choice:
    """Check a choice of attitude step; parameters and errors are those of `choose`."""
    if name in KERNELS or name in VECTORS:
        raise InputError(
            f"algorithm {name!r} is no attitude step; allowed: {some(_algorithms())}, or {_FILE}"
        )
    if isinstance(name, str) and name not in ALGORITHMS and not name.endswith(".py"):
        checks.choice("algorithm", name, _algorithms(), _FILE)
    return choose(name, method, increments, rates, previous, ahead)


def standard() -> list[Choice]:
    """Return the standard catalogue: attitude steps by the thesis's methods on two increments, and other kernels."""
    steps = [Choice(algorithm, method, 2) for algorithm in ALGORITHMS for method in STANDARD_METHODS]
    return steps + [Choice(name) for name, recipe in KERNELS.items() if recipe.standard]
