"""Conditions on unknown coefficients, and the families that satisfy them, as text, LaTeX and results."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import sympy as sp

from strapgen.analysis.unknowns.conditions import Demand
from strapgen.analysis.unknowns.elimination import Equation, Family, PolynomialSolution, shown
from strapgen.analysis.unknowns.solving import LeadingError, SolvedStep
from strapgen.analysis.unknowns.unknown_tableau import UnknownTableau
from strapgen.results.display.expressions import expression_latex
from strapgen.results.display.latex import equations
from strapgen.results.display.objects import array_latex
from strapgen.results.records import INTERNAL, entry
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable

#: Most conditions, and most families, that a text shows; data has all.
_MOST_CONDITIONS, _MOST_FAMILIES = 40, 12
_TWO_COLUMNS = (Column(align="<"), Column(align="<"))


def text_of(expression: sp.Expr) -> str:
    """Return an expression as text that SymPy can read."""
    return str(sp.sstr(expression))


def family_lines(number: int, family: Family) -> list[str]:
    """Return a family as text."""
    names = ", ".join(symbol.name for symbol in family.free)
    lines = [f"family {number}: " + (f"free {names}" if names else "no free parameter")]
    if family.values:
        rows = [(symbol.name, f"= {text_of(value)}") for symbol, value in family.values.items()]
        lines += TextTable(_TWO_COLUMNS, rows).lines("  ")
    if family.nonzero:
        lines.append(f"  not zero: {', '.join(map(shown, family.nonzero))}")
    lines += [f"  tied by {shown(x)} = 0" for x in family.equations]
    return lines


def condition_lines(conditions: Sequence[Equation]) -> Iterator[str]:
    """Yield conditions as text, a line each."""
    rows = [(each.label, f"{text_of(each.value)} = 0") for each in conditions[:_MOST_CONDITIONS]]
    yield from TextTable(_TWO_COLUMNS, rows).lines("  ")
    if len(conditions) > _MOST_CONDITIONS:
        yield f"  and {len(conditions) - _MOST_CONDITIONS} more, which --format json shows"


@dataclass(frozen=True)
class SolvedFamily:
    """Solutions with free parameters, and the errors that they leave."""

    family: Family = field(metadata=entry(spread=True))
    leading_errors: Sequence[LeadingError]


@dataclass(frozen=True)
class SolvedResult(Result):
    """The conditions on the unknowns of a step, and the families that satisfy them; expressions are text."""

    solved: SolvedStep = field(metadata=INTERNAL)
    kernel: str
    #: Motions, with the order that is asked for on each
    demands: tuple[Demand, ...]
    #: What has to vanish
    conditions: tuple[Equation, ...]
    solution: PolynomialSolution = field(metadata=entry(spread=True))
    families: list[SolvedFamily]
    #: Values of the unknowns of a member that was chosen
    chosen: Mapping[str, sp.Expr] | None = field(metadata=entry(optional=True, kind=dict[str, str]))

    @staticmethod
    def of(solved: SolvedStep, chosen: Mapping[str, sp.Expr] | None = None) -> SolvedResult:
        """Return the solution of a step as a result."""
        families = [
            SolvedFamily(family, errors)
            for family, errors in zip(solved.families, solved.leading, strict=True)
        ]
        name, demands, conditions = solved.kernel.name, solved.demands, solved.conditions
        return SolvedResult(solved, name, demands, conditions, solved.solution, families, chosen)

    def text(self) -> str:
        """Return the conditions, the families and their leading errors."""
        return _solved_text(self.solved, self.chosen)

    def latex(self) -> str:
        """Return the same as align environments."""
        return solved_latex(self.solved)


def _solved_text(solved: SolvedStep, chosen: Mapping[str, sp.Expr] | None) -> str:
    demands = " and ".join(f"order {demand.order} on {demand.motion} motion" for demand in solved.demands)
    lines = [
        f"{solved.kernel.name}: unknowns {', '.join(solved.kernel.unknowns)}",
        f"conditions of {demands}",
    ]
    lines += (
        condition_lines(solved.conditions) if solved.conditions else ["  none: every value satisfies them"]
    )
    if not solved.families:
        lines += ["", f"no solution: {solved.solution.reason}"]
        if solved.solution.solvable:
            lines.append(f"the conditions up to h^{solved.solution.solvable} have one")
    for number, family in enumerate(solved.families[:_MOST_FAMILIES], 1):
        lines += ["", *family_lines(number, family)]
        for error in solved.leading[number - 1]:
            lines += _leading_lines(error)
    if len(solved.families) > _MOST_FAMILIES:
        lines += [
            "",
            f"and {len(solved.families) - _MOST_FAMILIES} smaller families, which --format json shows",
        ]
    if chosen is not None:
        lines += ["", "chosen", *_chosen_lines(chosen)]
    return "\n".join(lines)


def _leading_lines(error: LeadingError) -> list[str]:
    lines = [f"  leading error on {error.motion} motion, h^{error.power}"]
    rows = [(each.label.partition(", ")[2], text_of(each.value)) for each in error.terms[:_MOST_CONDITIONS]]
    lines += TextTable(_TWO_COLUMNS, rows).lines("    ")
    if error.least:
        values = ", ".join(f"{symbol} = {text_of(value)}" for symbol, value in error.least.items())
        lines.append(f"    the sum of its squares is least at {values}")
    return lines


def _chosen_lines(chosen: Mapping[str, sp.Expr]) -> list[str]:
    lines = [f"  {name} = {text_of(value)}" for name, value in chosen.items()]
    if all(value.is_Rational for value in chosen.values()):
        lines.append(
            "  as options: " + " ".join(f"--constant {name}={value}" for name, value in chosen.items())
        )
    return lines


#: Most conditions and most families that are shown.
_LATEX_CONDITIONS, _LATEX_FAMILIES = 12, 4


def conditions_latex(conditions: Sequence[Equation]) -> str:
    """Return conditions as one align environment, a polynomial that is 0 in each line."""
    rows = [("0", expression_latex(each.value)) for each in conditions[:_LATEX_CONDITIONS]]
    if len(conditions) > _LATEX_CONDITIONS:
        rows.append((rf"\text{{and {len(conditions) - _LATEX_CONDITIONS} more: }} 0", r"\dots"))
    return equations(rows) if rows else "$0 = 0$"


def family_latex(family: Family) -> str:
    """Return a family as one align environment: unknowns in terms of the free ones, and what ties or excludes these."""
    text = equations(_family_rows(family)) if family.values or family.free else "$0 = 0$"
    return text.replace(r" &= \text{free}", r"\ &\text{free}").replace(r" &= \neq", r" &\neq")


def solution_latex(solution: PolynomialSolution) -> str:
    """Return the families of a solution, or the reason why there is none."""
    if not solution.families:
        return r"\(\text{no solution}\)"
    blocks = [family_latex(family) for family in solution.families[:_LATEX_FAMILIES]]
    more = len(solution.families) - _LATEX_FAMILIES
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
