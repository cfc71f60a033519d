"""Reports Butcher tableaux, and what their order conditions say, as plain data and as text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from strapgen.catalogue.methods import order_conditions
from strapgen.catalogue.methods.tableau import Tableau
from strapgen.results.display.methods import method_latex
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable

#: Widest table; a wider tableau is listed coefficient by coefficient.
_WIDEST = 120
_TWO_COLUMNS = (Column(align="<"), Column(align="<"))


def tableau_data(tableau: Tableau) -> dict[str, Any]:
    """Return a tableau and its order conditions, evaluated exactly, as plain JSON data; coefficients are text."""
    embedded = tableau.embedded_weights
    return {
        "name": tableau.name,
        "title": tableau.title,
        "source": tableau.source,
        "stages": len(tableau.nodes),
        "order": order_conditions.order(tableau),
        "attitude_order": order_conditions.attitude_order(tableau),
        "conditions": order_conditions.conditions(tableau),
        "principal_error_norm": order_conditions.principal_error_norm(tableau),
        "embedded_order": None if embedded is None else order_conditions.embedded_order(tableau),
        "tolerance": float(tableau.tolerance),
        "largest_residual": float(order_conditions.largest_residual(tableau)),
        "nodes": [str(value) for value in tableau.nodes],
        "matrix": [[str(value) for value in row] for row in tableau.matrix],
        "weights": [str(value) for value in tableau.weights],
        "embedded_weights": None if embedded is None else [str(value) for value in embedded],
    }


def tableau_text(data: Mapping[str, Any]) -> str:
    """Return a tableau as text: as books print it, or as a list of its coefficients where that would be too wide."""
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
    tableau = _tableau_lines(data)
    return "\n".join(
        [
            f"{data['name']}: {data['title']}",
            f"source: {data['source']}",
            "",
            *TextTable(_TWO_COLUMNS, [(fact, str(value)) for fact, value in facts.items()]).lines(),
            "",
            *(tableau if max(map(len, tableau)) <= _WIDEST else _coefficient_lines(data)),
        ]
    )


def tableau_report(data: Mapping[str, Any], tableau: Tableau) -> Report:
    """Return a tableau as a report, whose table has a row for each stage, then those of the weights."""

    def table() -> TextTable:
        stages = data["stages"]
        rows = [
            [f"stage {number}", node, *row, *[None] * (stages - len(row))]
            for number, (node, row) in enumerate(zip(data["nodes"], data["matrix"], strict=True), 1)
        ]
        rows.append(["weights", None, *data["weights"]])
        if data["embedded_weights"]:
            rows.append(["embedded weights", None, *data["embedded_weights"]])
        heads = [Column("row", "<"), Column("node", missing="")]
        return TextTable([*heads, *(Column(f"k{k}", missing="") for k in range(1, stages + 1))], rows)

    return Report(lambda: tableau_text(data), lambda: data, table, latex=lambda: method_latex(tableau))


def _tableau_lines(data: Mapping[str, Any]) -> list[str]:
    """Return the tableau as it is printed in books."""
    bottom = [row for row in (data["weights"], data["embedded_weights"]) if row]
    stages = data["stages"]
    rows = [
        [head, "|", *row, *[""] * (stages - len(row))]
        for head, row in zip([*data["nodes"], *[""] * len(bottom)], [*data["matrix"], *bottom], strict=True)
    ]
    columns = [Column(), Column(gap=1), Column(gap=1), *[Column()] * (stages - 1)]
    lines = TextTable(columns, rows).lines()
    before = lines[-1].index("|")
    rule = "-" * before + "+" + "-" * (max(map(len, lines)) - before - 1)
    return [*lines[:stages], rule, *lines[stages:]]


def _coefficient_lines(data: Mapping[str, Any]) -> list[str]:
    """Return what is not zero in the tableau, a coefficient a line."""
    named = []
    for stage, (node, row) in enumerate(zip(data["nodes"], data["matrix"], strict=True), 1):
        named.append((f"c_{stage}", node))
        named += [(f"a_{stage},{place}", value) for place, value in enumerate(row, 1) if value != "0"]
    for letter, row in (("b", data["weights"]), ("e", data["embedded_weights"] or [])):
        named += [(f"{letter}_{place}", value) for place, value in enumerate(row, 1) if value != "0"]
    note = ["", "e: the embedded weights"] if data["embedded_weights"] else []
    return TextTable(_TWO_COLUMNS, named).lines() + note
