"""The command ``strapgen list``: all names."""

from __future__ import annotations

from typing import Annotated

import typer

from strapgen import registration
from strapgen.cli.option_groups import Shown, grouped
from strapgen.cli.output import TEXT_OUTPUT, Output
from strapgen.ir import checks
from strapgen.registry import Titles

#: The kinds of names, in the order in which they are listed.
KINDS = (
    *("algorithms", "methods", "vectors", "kernels"),
    *(kind for one in reversed(registration.built_in().values()) for kind in one.lists),
    *("targets", "backends"),
)


@grouped
def list_names(
    kind: Annotated[
        str | None,
        typer.Argument(metavar="KIND", help=f"Kind of names: {', '.join(KINDS)}.  [default: all]"),
    ] = None,
    *,
    output: Annotated[Output, Shown(only=TEXT_OUTPUT)],
) -> None:
    """List all names that the other commands take.

    Example: strapgen list methods

    Example: strapgen list kernels --format markdown
    """
    output.check()
    if kind is not None:
        kind = checks.choice(
            "kind", kind if kind in KINDS else f"{kind}s" if f"{kind}s" in KINDS else kind, KINDS
        )
    for line in registration.broken():
        typer.echo(f"strapgen: {line}", err=True)
    parts = _parts()
    shown = parts if kind is None else {kind: parts[kind]}
    short = dict(shown)
    if kind is None:
        short["methods"] = _with_one_line_for_taylor(parts["methods"])
        short["kernels"] = _with_one_line_for_updates(parts["kernels"])
    from strapgen.cli.names_result import NamesResult

    output.show(NamesResult(shown, short, kind is None))


def _parts() -> dict[str, dict[str, str]]:
    from strapgen import catalogue
    from strapgen.catalogue.user import loading
    from strapgen.run.backends import BACKENDS
    from strapgen.targets import titles

    installed = {
        name: f"from {point.value}"
        for name, point in loading.installed().items()
        if name not in (*catalogue.ALGORITHMS, *catalogue.KERNELS, *catalogue.LAYOUT_KERNELS)
    }
    return {
        "algorithms": {**catalogue.ALGORITHMS, **installed},
        "methods": {**catalogue.METHODS, **catalogue.INTEGRATORS.taken()},
        "vectors": {
            name: f"{vector.title}; methods {', '.join(vector.methods)}"
            for name, vector in catalogue.VECTORS.items()
        },
        "kernels": {
            **Titles(catalogue.KERNELS),
            **Titles(catalogue.LAYOUT_KERNELS),
            **catalogue.KERNELS.taken(),
        },
        **registration.lists(),
        "targets": titles(),
        "backends": {**Titles(BACKENDS), **BACKENDS.taken()},
    }


def _with_one_line_for_taylor(methods: dict[str, str]) -> dict[str, str]:
    """Return the methods with the Taylor series of all orders on one line."""
    series = [name for name in methods if name.startswith("taylor")]
    others = {name: title for name, title in methods.items() if name not in series}
    return others | {f"{series[0]} to {series[-1]}": "Taylor series of the transition, of any order to 20"}


def _with_one_line_for_updates(kernels: dict[str, str]) -> dict[str, str]:
    """Return the kernels with the updates of an algorithm by a rotation vector, of all orders, on one line."""
    from strapgen import catalogue

    first, *_, last = catalogue.UPDATE_ORDERS
    lines = {}
    updates = {
        f"{algorithm}-update-{order}": (order, title)
        for algorithm, title in catalogue.ALGORITHMS.items()
        for order in catalogue.UPDATE_ORDERS
    }
    for name, title in kernels.items():
        order, algorithm = updates.get(name, (None, ""))
        if order is None:
            lines[name] = title
        elif order == first:
            lines[f"{name} to {last}"] = f"{algorithm}: update by a rotation vector, order {first} to {last}"
    return lines
