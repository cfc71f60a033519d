"""The command ``strapgen list`` shows all names."""

from __future__ import annotations

import typer

from strapgen.cli.output import Format, check_format, print_json


def list_names(format: Format = "text") -> None:
    """List all names that the other commands take, from algorithms and methods to motions and back ends.

    Example: strapgen list
    """
    check_format(format)
    parts = _parts()
    if format == "json":
        print_json(parts)
        return
    parts["methods"] = _with_one_line_for_taylor(parts["methods"])
    parts["kernels"] = _with_one_line_for_updates(parts["kernels"])
    width = max(len(name) for part in parts.values() for name in part)
    for title, part in parts.items():
        typer.echo(title)
        for name, meaning in part.items():
            typer.echo(f"  {name:<{width}}  {meaning}".rstrip())


def _parts() -> dict[str, dict[str, str]]:
    """Return all names with their meanings, by the heading under which they are listed."""
    from strapgen import catalogue
    from strapgen.backends import BACKENDS
    from strapgen.catalogue.user import loading
    from strapgen.simulation.motions import keys
    from strapgen.targets import titles

    installed = {
        name: f"from {point.value}"
        for name, point in loading.installed().items()
        if name not in catalogue.ALGORITHMS and name not in catalogue.KERNELS
    }
    return {
        "algorithms": {**catalogue.ALGORITHMS, **installed},
        "methods": catalogue.METHODS,
        "vectors": {
            name: f"{vector.title}; methods {', '.join(vector.methods)}"
            for name, vector in catalogue.VECTORS.items()
        },
        "kernels": {name: recipe.title for name, recipe in catalogue.KERNELS.items()},
        "motions": {
            name: ", ".join(" or ".join(choices) for choices in keys(name).values())
            for name in catalogue.MOTIONS
        },
        "targets": titles(),
        "backends": {name: entry.title for name, entry in BACKENDS.items()},
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
