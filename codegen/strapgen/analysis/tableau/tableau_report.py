"""A Butcher tableau, and what its order conditions say, as a result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from strapgen.catalogue.methods import order_conditions
from strapgen.catalogue.methods.tableau import Tableau
from strapgen.results.display.objects import method_latex
from strapgen.results.records import INTERNAL
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable

#: Widest table; a wider tableau is listed coefficient by coefficient.
_WIDEST = 120
_TWO_COLUMNS = (Column(align="<"), Column(align="<"))


def _texts(values: Sequence[Any]) -> list[str]:
    return list(map(str, values))


@dataclass(frozen=True)
class TableauResult(Result):
    """A Butcher tableau with its order conditions, evaluated exactly; coefficients are text."""

    tableau: Tableau = field(metadata=INTERNAL)
    name: str
    title: str
    source: str
    stages: int
    #: Order on any differential equation
    order: int
    #: Order on attitude kinematics
    attitude_order: int
    #: Number of conditions that were evaluated
    conditions: int
    #: Norm of the error coefficients of the next order
    principal_error_norm: float
    embedded_order: int | None
    #: By which a condition may be missed where coefficients are rounded decimals
    tolerance: float
    largest_residual: float
    nodes: list[str]
    matrix: list[list[str]]
    weights: list[str]
    embedded_weights: list[str] | None

    @staticmethod
    def of(tableau: Tableau) -> TableauResult:
        """Return a tableau with what its conditions say."""
        embedded = tableau.embedded_weights
        return TableauResult(
            tableau=tableau,
            name=tableau.name,
            title=tableau.title,
            source=tableau.source,
            stages=len(tableau.nodes),
            order=order_conditions.order(tableau),
            attitude_order=order_conditions.attitude_order(tableau),
            conditions=order_conditions.conditions(tableau),
            principal_error_norm=order_conditions.principal_error_norm(tableau),
            embedded_order=None if embedded is None else order_conditions.embedded_order(tableau),
            tolerance=float(tableau.tolerance),
            largest_residual=float(order_conditions.largest_residual(tableau)),
            nodes=_texts(tableau.nodes),
            matrix=list(map(_texts, tableau.matrix)),
            weights=_texts(tableau.weights),
            embedded_weights=None if embedded is None else _texts(embedded),
        )

    def rows(self) -> list[list[str | None]]:
        """Return the stages, then the weights."""
        rows: list[list[str | None]] = [
            [f"stage {number}", node, *row, *[None] * (self.stages - len(row))]
            for number, (node, row) in enumerate(zip(self.nodes, self.matrix, strict=True), 1)
        ]
        rows.append(["weights", None, *self.weights])
        return [*rows, ["embedded weights", None, *self.embedded_weights]] if self.embedded_weights else rows

    def table(self) -> TextTable:
        """Return a row for each stage, then those of the weights."""
        heads = [Column("row", "<"), Column("node", missing="")]
        heads += [Column(f"k{k}", missing="") for k in range(1, self.stages + 1)]
        return TextTable(heads, self.rows())

    def latex(self) -> str:
        """Return the tableau as books print it."""
        return method_latex(self.tableau)

    def text(self) -> str:
        """Return the tableau as books print it, or as a list of its coefficients where that would be too wide."""
        facts = {
            "stages": self.stages,
            "classical order": self.order,
            "order on attitude kinematics": self.attitude_order,
            "conditions checked exactly": self.conditions,
            "principal error norm": f"{self.principal_error_norm:.5g}",
        }
        if self.embedded_order is not None:
            facts["order of the embedded weights"] = self.embedded_order
        if self.tolerance:
            residual = f"{self.largest_residual:.3g}, tolerance {self.tolerance:.3g}"
            facts["largest residual"] = residual
        tableau = _tableau_lines(self)
        return "\n".join(
            [
                f"{self.name}: {self.title}",
                f"source: {self.source}",
                "",
                *TextTable(_TWO_COLUMNS, [(fact, str(value)) for fact, value in facts.items()]).lines(),
                "",
                *(tableau if max(map(len, tableau)) <= _WIDEST else _coefficient_lines(self)),
            ]
        )


def _tableau_lines(data: TableauResult) -> list[str]:
    """Return the tableau as it is printed in books."""
    bottom = [row for row in (data.weights, data.embedded_weights) if row]
    stages = data.stages
    rows = [
        [head, "|", *row, *[""] * (stages - len(row))]
        for head, row in zip([*data.nodes, *[""] * len(bottom)], [*data.matrix, *bottom], strict=True)
    ]
    columns = [Column(), Column(gap=1), Column(gap=1), *[Column()] * (stages - 1)]
    lines = TextTable(columns, rows).lines()
    before = lines[-1].index("|")
    rule = "-" * before + "+" + "-" * (max(map(len, lines)) - before - 1)
    return [*lines[:stages], rule, *lines[stages:]]


def _coefficient_lines(data: TableauResult) -> list[str]:
    """Return what is not zero in the tableau, a coefficient a line."""
    named = []
    for stage, (node, row) in enumerate(zip(data.nodes, data.matrix, strict=True), 1):
        named.append((f"c_{stage}", node))
        named += [(f"a_{stage},{place}", value) for place, value in enumerate(row, 1) if value != "0"]
    for letter, row in (("b", data.weights), ("e", data.embedded_weights or [])):
        named += [(f"{letter}_{place}", value) for place, value in enumerate(row, 1) if value != "0"]
    note = ["", "e: the embedded weights"] if data.embedded_weights else []
    return TextTable(_TWO_COLUMNS, named).lines() + note
