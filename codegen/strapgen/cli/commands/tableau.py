"""strapgen tableau."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapgen.cli.output import Format, check_format, print_json
from strapgen.support import checks

if TYPE_CHECKING:
    from strapgen.catalogue.methods.tableau import Tableau

#: Widest table; what is wider is listed coefficient by coefficient.
_WIDEST = 120


def tableau(
    method: Annotated[
        str,
        typer.Argument(metavar="NAME|FILE", help="A method of strapgen list, or a TOML file with a tableau."),
    ],
    format: Format = "text",
) -> None:
    """Show a Butcher tableau, and what its order conditions say when they are evaluated exactly.

    A file is what ends in .toml or holds a path separator. Its keys are those of the files in
    strapgen/catalogue/methods: name, source, order, nodes, matrix, weights, embedded_weights, tolerance.

    Example: strapgen tableau dormand-prince5
    """
    check_format(format)
    from strapgen.catalogue.methods import tableaux

    if method.endswith(".toml") or any(separator in method for separator in (os.sep, os.altsep) if separator):
        chosen = tableaux.read(method)
    else:
        chosen = tableaux.TABLEAUX[checks.choice("method", method, tableaux.TABLEAUX)]
        tableaux.verify(chosen)
    data = _data(chosen)
    if format == "json":
        print_json(data)
    else:
        typer.echo(_text(data))


def _data(chosen: Tableau) -> dict[str, Any]:
    from strapgen.catalogue.methods import order_conditions
    from strapgen.catalogue.methods.coefficients import text

    embedded = chosen.embedded_weights
    return {
        "name": chosen.name,
        "title": chosen.title,
        "source": chosen.source,
        "stages": len(chosen.nodes),
        "order": order_conditions.order(chosen),
        "attitude_order": order_conditions.attitude_order(chosen),
        "conditions": order_conditions.conditions(chosen),
        "principal_error_norm": order_conditions.principal_error_norm(chosen),
        "embedded_order": None if embedded is None else order_conditions.embedded_order(chosen),
        "tolerance": float(chosen.tolerance),
        "largest_residual": float(order_conditions.largest_residual(chosen)),
        "nodes": [text(value) for value in chosen.nodes],
        "matrix": [[text(value) for value in row] for row in chosen.matrix],
        "weights": [text(value) for value in chosen.weights],
        "embedded_weights": None if embedded is None else [text(value) for value in embedded],
    }


def _text(data: dict[str, Any]) -> str:
    facts = {
        "stages": data["stages"],
        "classical order": data["order"],
        "order on attitude kinematics": data["attitude_order"],
        "conditions checked exactly": data["conditions"],
        "principal error norm": f"{data['principal_error_norm']:.5g}",
    }
    if data["embedded_order"] is not None:
        facts["order of the embedded weights"] = data["embedded_order"]
    if data["tolerance"]:
        facts["largest residual"] = f"{data['largest_residual']:.3g}, tolerance {data['tolerance']:.3g}"
    width = max(map(len, facts))
    table = _table(data)
    return "\n".join(
        [
            f"{data['name']}: {data['title']}",
            f"source: {data['source']}",
            "",
            *(f"{fact:<{width}}  {value}" for fact, value in facts.items()),
            "",
            *(table if max(map(len, table)) <= _WIDEST else _list(data)),
        ]
    )


def _table(data: dict[str, Any]) -> list[str]:
    """Return the tableau as it is printed in books."""
    bottom = [row for row in (data["weights"], data["embedded_weights"]) if row]
    widths = [
        max(len(row[k]) for row in (*data["matrix"], *bottom) if k < len(row)) for k in range(data["stages"])
    ]
    first = max(map(len, data["nodes"]))

    def line(head: str, row: list[str]) -> str:
        cells = (f"{cell:>{width}}" for cell, width in zip(row, widths, strict=False))
        return f"{head:>{first}} | {'  '.join(cells)}".rstrip()

    rule = "-" * first + "-+-" + "-" * (sum(widths) + 2 * len(widths) - 2)
    rows = [line(node, row) for node, row in zip(data["nodes"], data["matrix"], strict=True)]
    return [*rows, rule, *(line("", row) for row in bottom)]


def _list(data: dict[str, Any]) -> list[str]:
    """Return what is not zero in the tableau, a coefficient a line."""
    named = []
    for stage, (node, row) in enumerate(zip(data["nodes"], data["matrix"], strict=True), 1):
        named.append((f"c_{stage}", node))
        named += [(f"a_{stage},{place}", value) for place, value in enumerate(row, 1) if value != "0"]
    for letter, row in (("b", data["weights"]), ("e", data["embedded_weights"] or [])):
        named += [(f"{letter}_{place}", value) for place, value in enumerate(row, 1) if value != "0"]
    width = max(len(name) for name, _ in named)
    note = ["", "e: the embedded weights"] if data["embedded_weights"] else []
    return [f"{name:<{width}}  {value}" for name, value in named] + note
