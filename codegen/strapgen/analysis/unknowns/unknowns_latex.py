"""Writes conditions on unknown coefficients, the families that satisfy them and tableaux with unknowns as LaTeX."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import sympy as sp

from strapgen.analysis.unknowns.families import Equation, Family, PolynomialSolution
from strapgen.analysis.unknowns.solving import LeadingError, SolvedStep
from strapgen.analysis.unknowns.unknown_tableau import UnknownTableau
from strapgen.results.display.expressions import expression_latex
from strapgen.results.display.latex import equations
from strapgen.results.display.objects import array_latex

#: Most conditions and most families that are shown.
_MOST_CONDITIONS, _MOST_FAMILIES = 12, 4


def conditions_latex(conditions: Sequence[Equation]) -> str:
    """Return conditions as one align environment, a polynomial that is 0 in each line."""
    rows = [("0", expression_latex(each.value)) for each in conditions[:_MOST_CONDITIONS]]
    if len(conditions) > _MOST_CONDITIONS:
        rows.append((rf"\text{{and {len(conditions) - _MOST_CONDITIONS} more: }} 0", r"\dots"))
    return equations(rows) if rows else "$0 = 0$"


def family_latex(family: Family) -> str:
    """Return a family as one align environment: unknowns in terms of the free ones, and what ties or excludes these."""
    text = equations(_family_rows(family)) if family.values or family.free else "$0 = 0$"
    return text.replace(r" &= \text{free}", r"\ &\text{free}").replace(r" &= \neq", r" &\neq")


def solution_latex(solution: PolynomialSolution) -> str:
    """Return the families of a solution, or the reason why there is none."""
    if not solution.families:
        return r"\(\text{no solution}\)"
    blocks = [family_latex(family) for family in solution.families[:_MOST_FAMILIES]]
    more = len(solution.families) - _MOST_FAMILIES
    return "\n".join([*blocks, *([rf"\(\text{{and {more} more}}\)"] if more > 0 else [])])


def solved_latex(solved: SolvedStep) -> str:
    """Return the conditions on a step, and the families that satisfy them."""
    return f"{conditions_latex(solved.conditions)}\n{solution_latex(solved.solution)}"


def leading_latex(error: LeadingError) -> str:
    """Return the sum of the squares of an error's coefficients, and the parameters at which it is least."""
    rows = [(rf"h^{{{error.power}}}\!:\ \textstyle\sum", expression_latex(error.square))]
    return equations([*rows, *_values(error.least.items())])


def unknown_tableau_latex(tableau: UnknownTableau) -> str:
    """Return a tableau with unknowns as books print one."""
    rows = [[node, *row] for node, row in zip(tableau.nodes, tableau.matrix, strict=True)]
    return array_latex([[str(sp.latex(x)) for x in row] for row in rows], [[*map(sp.latex, tableau.weights)]])


def _family_rows(family: Family) -> Iterator[tuple[str, str]]:
    yield from _values(family.values.items())
    for symbol in family.free:
        yield str(sp.latex(symbol)), r"\text{free}"
    yield from (("0", str(sp.latex(x))) for x in family.equations)
    yield from ((str(sp.latex(x)), r"\neq 0") for x in family.nonzero)


def _values(pairs: Iterable[tuple[sp.Symbol, sp.Expr]]) -> list[tuple[str, str]]:
    return [(str(sp.latex(symbol)), expression_latex(value)) for symbol, value in pairs]
