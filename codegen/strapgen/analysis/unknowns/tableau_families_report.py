"""Reports the families of Runge-Kutta methods that satisfy the order conditions of a tableau with unknowns."""

from __future__ import annotations

from typing import Any

from strapgen.analysis.unknowns.families import Equation, PolynomialSolution
from strapgen.analysis.unknowns.unknown_tableau import UnknownTableau
from strapgen.analysis.unknowns.unknowns_latex import solution_latex, unknown_tableau_latex
from strapgen.analysis.unknowns.unknowns_report import family_lines, solution_data, text_of
from strapgen.catalogue.methods.tableau import Tableau
from strapgen.results.report import Report

#: Most families that a text shows; data has all.
_MOST_FAMILIES = 12
_TITLES = {
    "general": "any differential equation",
    "attitude": "x' = A(t) x, which attitude kinematics is",
}


def families_report(unknown: UnknownTableau, solutions: dict[str, PolynomialSolution]) -> Report:
    """Return the families of a tableau with unknowns as a report."""
    leading = [unknown.leading(family) for family in solutions["general"].families]

    def latex() -> str:
        return f"{unknown_tableau_latex(unknown)}\n\n{solution_latex(solutions['general'])}"

    return Report(
        lambda: _text(unknown, solutions, leading), lambda: _data(unknown, solutions, leading), latex=latex
    )


def _data(
    unknown: UnknownTableau, solutions: dict[str, PolynomialSolution], leading: list[list[Equation]]
) -> dict[str, Any]:
    data: dict[str, Any] = {
        "name": unknown.name,
        "title": unknown.title,
        "source": unknown.source,
        "stages": len(unknown.nodes),
        "order": unknown.order,
        "unknowns": list(unknown.unknowns),
        "nodes": list(map(text_of, unknown.nodes)),
        "matrix": [list(map(text_of, row)) for row in unknown.matrix],
        "weights": list(map(text_of, unknown.weights)),
    }
    for equations, solution in solutions.items():
        data[equations] = {"conditions": len(unknown.conditions(equations)), **solution_data(solution)}
    for family, terms in zip(data["general"]["families"], leading, strict=True):
        family["leading_error"] = {each.label: text_of(each.value) for each in terms}
    return data


def _text(
    unknown: UnknownTableau, solutions: dict[str, PolynomialSolution], leading: list[list[Equation]]
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
        lines += [f"    {each.label}: {text_of(each.value)}" for each in terms] or ["    none"]
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
