"""strapgen list."""

from __future__ import annotations

import typer

from strapgen.cli.output import Format, check_format, print_json


def list_names(format: Format = "text") -> None:
    """List algorithms, methods, kernels, motions, targets and back ends.

    Example: strapgen list
    """
    check_format(format)
    from strapgen import catalogue
    from strapgen.backends import BACKENDS
    from strapgen.catalogue.user import loading
    from strapgen.simulation.motions import keys
    from strapgen.targets import TARGETS

    installed = {
        name: f"from {point.value}"
        for name, point in loading.installed().items()
        if name not in catalogue.ALGORITHMS and name not in catalogue.KERNELS
    }
    parts: dict[str, dict[str, str]] = {
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
        "targets": {name: target.title for name, target in TARGETS.items()},
        "backends": {name: entry.title for name, entry in BACKENDS.items()},
    }
    if format == "json":
        print_json(parts)
        return
    series = [name for name in catalogue.METHODS if name.startswith("taylor")]
    methods = {name: title for name, title in catalogue.METHODS.items() if name not in series}
    methods[f"{series[0]} to {series[-1]}"] = "Taylor series of the transition, of any order to 20"
    parts["methods"] = methods
    first, *_, last = catalogue.UPDATE_ORDERS
    for algorithm, title in catalogue.ALGORITHMS.items():
        orders = [f"{algorithm}-update-{order}" for order in catalogue.UPDATE_ORDERS]
        parts["kernels"] = {
            f"{name} to {last}" if name == orders[0] else name: (
                f"{title}: update by a rotation vector, order {first} to {last}"
                if name == orders[0]
                else said
            )
            for name, said in parts["kernels"].items()
            if name not in orders[1:]
        }
    width = max(len(name) for part in parts.values() for name in part)
    for title, part in parts.items():
        typer.echo(title)
        for name, meaning in part.items():
            typer.echo(f"  {name:<{width}}  {meaning}".rstrip())
