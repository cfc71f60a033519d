"""The families of Runge-Kutta methods that satisfy the order conditions of a tableau with unknowns, as a result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import sympy as sp

from strapgen.analysis.unknowns.families import Family, PolynomialSolution
from strapgen.analysis.unknowns.unknown_tableau import UnknownTableau
from strapgen.analysis.unknowns.unknowns_latex import solution_latex, unknown_tableau_latex
from strapgen.analysis.unknowns.unknowns_report import family_lines, text_of
from strapgen.catalogue.methods.tableaux import Tableau
from strapgen.results.records import INTERNAL, entry
from strapgen.results.result import Result

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
