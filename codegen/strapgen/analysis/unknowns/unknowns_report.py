"""Reports conditions on unknown coefficients, and the families that satisfy them, as text and plain data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import sympy as sp

from strapgen.analysis.unknowns.families import Equation, Family, PolynomialSolution, shown
from strapgen.analysis.unknowns.solving import LeadingError, SolvedStep
from strapgen.analysis.unknowns.unknowns_latex import solved_latex
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable

#: Most conditions, and most families, that a text shows; data has all.
_MOST_CONDITIONS, _MOST_FAMILIES = 40, 12
_TWO_COLUMNS = (Column(align="<"), Column(align="<"))


def text_of(expression: sp.Expr) -> str:
    """Return an expression as text that SymPy can read."""
    return str(sp.sstr(expression))


# Families


def family_data(family: Family) -> dict[str, Any]:
    """Return a family as plain JSON data; expressions are text that SymPy can read."""
    return {
        "parameters": [symbol.name for symbol in family.free],
        "dimension": family.dimension,
        "values": {symbol.name: text_of(value) for symbol, value in family.values.items()},
        "nonzero": [shown(x) for x in family.nonzero],
        "equations": [shown(x) for x in family.equations],
    }


def solution_data(solution: PolynomialSolution) -> dict[str, Any]:
    """Return a solution as plain JSON data."""
    return {
        "unknowns": [symbol.name for symbol in solution.unknowns],
        "families": [family_data(family) for family in solution.families],
        "reason": solution.reason or None,
        "solvable_order": solution.solvable,
    }


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


# Steps


def solved_report(solved: SolvedStep, chosen: Mapping[str, sp.Expr] | None = None) -> Report:
    """Return the conditions on a step's unknowns and their solution as a report."""

    def data() -> dict[str, Any]:
        return _solved_data(solved) | ({} if chosen is None else {"chosen": _texts(chosen)})

    return Report(lambda: _solved_text(solved, chosen), data, latex=lambda: solved_latex(solved))


def _solved_data(solved: SolvedStep) -> dict[str, Any]:
    data = {
        "kernel": solved.kernel.name,
        "demands": [{"motion": demand.motion, "order": demand.order} for demand in solved.demands],
        "conditions": [
            {"label": each.label, "power": each.order, "expression": text_of(each.value)}
            for each in solved.conditions
        ],
        **solution_data(solved.solution),
    }
    for family, errors in zip(data["families"], solved.leading, strict=True):
        family["leading_errors"] = [_leading_data(error) for error in errors]
    return data


def _leading_data(error: LeadingError) -> dict[str, Any]:
    return {
        "motion": error.motion,
        "power": error.power,
        "terms": {each.label: text_of(each.value) for each in error.terms},
        "sum_of_squares": text_of(error.square),
        "least": {symbol.name: text_of(value) for symbol, value in error.least.items()},
    }


def _texts(values: Mapping[str, sp.Expr]) -> dict[str, str]:
    return {name: text_of(value) for name, value in values.items()}


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
