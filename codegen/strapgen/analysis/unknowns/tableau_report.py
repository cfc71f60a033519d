"""A Butcher tableau with its order conditions, and the families of one with unknowns, as results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import sympy as sp

from strapgen.analysis.unknowns.elimination import Family, PolynomialSolution
from strapgen.analysis.unknowns.unknown_tableau import UnknownTableau
from strapgen.analysis.unknowns.unknowns_report import (
    family_lines,
    solution_latex,
    text_of,
    unknown_tableau_latex,
)
from strapgen.catalogue.methods import order_conditions
from strapgen.catalogue.methods.tableaux import Tableau
from strapgen.results.display.objects import method_latex
from strapgen.results.records import INTERNAL, entry
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
        """Return a tableau with its conditions, evaluated."""
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
    """Return the coefficients of the tableau that are not zero, one a line."""
    named = []
    for stage, (node, row) in enumerate(zip(data.nodes, data.matrix, strict=True), 1):
        named.append((f"c_{stage}", node))
        named += [(f"a_{stage},{place}", value) for place, value in enumerate(row, 1) if value != "0"]
    for letter, row in (("b", data.weights), ("e", data.embedded_weights or [])):
        named += [(f"{letter}_{place}", value) for place, value in enumerate(row, 1) if value != "0"]
    note = ["", "e: the embedded weights"] if data.embedded_weights else []
    return TextTable(_TWO_COLUMNS, named).lines() + note


#: Most families that a text shows; data has all.
_MOST_FAMILIES = 12
#: Fields that the result has from the tableau.
_SAME = ("name", "title", "source", "order", "unknowns", "nodes", "matrix", "weights")
_TITLES = {
    "general": "any differential equation",
    "attitude": "x' = A(t) x, which attitude kinematics is",
}


@dataclass(frozen=True)
class TableauFamily:
    """Methods with free parameters, and the errors that they leave."""

    family: Family = field(metadata=entry(spread=True))
    #: Error coefficients of the next order, as functions of the free parameters
    leading_error: dict[str, str] | None = field(metadata=entry(optional=True))


@dataclass(frozen=True)
class SolvedConditions:
    """The order conditions on one kind of equations, solved."""

    #: Number of conditions
    conditions: int
    solution: PolynomialSolution = field(metadata=entry(spread=True))
    families: list[TableauFamily]


@dataclass(frozen=True)
class FamiliesResult(Result):
    """The families of Runge-Kutta methods that a tableau with unknowns has; expressions are text."""

    unknown: UnknownTableau = field(metadata=INTERNAL)
    solutions: Mapping[str, PolynomialSolution] = field(metadata=INTERNAL)
    name: str
    title: str
    source: str
    stages: int
    order: int
    unknowns: tuple[str, ...]
    nodes: tuple[sp.Expr, ...]
    matrix: tuple[tuple[sp.Expr, ...], ...]
    weights: tuple[sp.Expr, ...]
    #: On any differential equation
    general: SolvedConditions
    #: On x' = A(t) x, which attitude kinematics is
    attitude: SolvedConditions

    @staticmethod
    def of(unknown: UnknownTableau, solutions: Mapping[str, PolynomialSolution]) -> FamiliesResult:
        """Return the families of a tableau, and the leading errors of those on any equation."""

        def solved(equations: str) -> SolvedConditions:
            families = [
                TableauFamily(family, _leading(unknown, family) if equations == "general" else None)
                for family in solutions[equations].families
            ]
            return SolvedConditions(len(unknown.conditions(equations)), solutions[equations], families)

        return FamiliesResult(
            unknown,
            solutions,
            **{name: getattr(unknown, name) for name in _SAME},
            stages=len(unknown.nodes),
            general=solved("general"),
            attitude=solved("attitude"),
        )

    def text(self) -> str:
        """Return the conditions and the families on both kinds of equations."""
        return _text(self.unknown, self.solutions, [one.leading_error or {} for one in self.general.families])

    def latex(self) -> str:
        """Return the tableau and the families on any equation as align environments."""
        return f"{unknown_tableau_latex(self.unknown)}\n\n{solution_latex(self.solutions['general'])}"


def _leading(unknown: UnknownTableau, family: Family) -> dict[str, str]:
    return {each.label: text_of(each.value) for each in unknown.leading(family)}


def _text(
    unknown: UnknownTableau, solutions: Mapping[str, PolynomialSolution], leading: Sequence[Mapping[str, str]]
) -> str:
    lines = [f"{unknown.name}: {unknown.title}", f"source: {unknown.source}"]
    lines.append(
        f"{len(unknown.nodes)} stages, order {unknown.order}; unknowns {', '.join(unknown.unknowns)}"
    )
    general, attitude = solutions["general"], solutions["attitude"]
    lines += ["", *_solution_lines(unknown, "general", general)]
    for number, (family, terms) in enumerate(zip(general.families, leading, strict=True), 1):
        if number > _MOST_FAMILIES:
            lines += ["", f"and {len(leading) - _MOST_FAMILIES} smaller families, which --format json shows"]
            break
        lines += ["", *family_lines(number, family), f"  error coefficients of order {unknown.order + 1}"]
        lines += [f"    {label}: {value}" for label, value in terms.items()] or ["    none"]
    lines += ["", *_solution_lines(unknown, "attitude", attitude)]
    if attitude.families == general.families:
        lines += ["the same families" if general.families else "none either"]
        return "\n".join(lines)
    for number, family in enumerate(attitude.families[:_MOST_FAMILIES], 1):
        lines += ["", *family_lines(number, family)]
    if len(attitude.families) > _MOST_FAMILIES:
        lines += ["", f"and {len(attitude.families) - _MOST_FAMILIES} smaller families"]
    return "\n".join(lines)


def _solution_lines(unknown: UnknownTableau, equations: str, solution: PolynomialSolution) -> list[str]:
    """Return how many conditions there are, and the number of free parameters that they leave."""
    number = len(unknown.conditions(equations))
    lines = [f"on {_TITLES[equations]}: {number} conditions"]
    if not solution.families:
        lines.append(f"no solution: {solution.reason}")
        if solution.solvable:
            lines.append(f"order {solution.solvable} has one")
    else:
        most = max(family.dimension for family in solution.families)
        lines[0] += f"; at most {most} free parameter{'s' * (most != 1)}"
    return lines


def toml_text(tableau: Tableau) -> str:
    """Return a tableau as the text of a file that `tableaux.read` reads."""

    def row(values: Any) -> str:
        return "[" + ", ".join(f'"{value}"' for value in values) + "]"

    def quoted(text: str) -> str:
        return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'

    lines = [
        f"name = {quoted(tableau.title)}",
        f"source = {quoted(tableau.source)}",
        f"order = {tableau.order}",
        f"nodes = {row(tableau.nodes)}",
        "matrix = [",
        *(f"    {row(values)}," for values in tableau.matrix),
        "]",
        f"weights = {row(tableau.weights)}",
    ]
    return "\n".join(lines) + "\n"
