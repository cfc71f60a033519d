"""Reports ratios of errors as text and LaTeX."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import sympy as sp

from strapgen.analysis.ratios.ratios import STEP_ANGLE, Claim, Ratio, columns
from strapgen.results.display.expressions import expression_latex
from strapgen.results.display.latex import PAGE, equations, unbroken
from strapgen.results.records import entry
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable


def ratio_text(comparison: Ratio) -> str:
    """Return a comparison as text."""
    lines = [
        f"{comparison.first} over {comparison.second}, {comparison.motion} motion: {comparison.quantity}"
    ]
    if comparison.symbol == STEP_ANGLE:
        lines.append("x = |w| h, the angle of a step")
    both = ((comparison.first, comparison.first_terms), (comparison.second, comparison.second_terms))
    for name, terms in both:
        axes = ("",) if len(terms) == 1 else (", x", ", y", ", z")
        lines += ["", *(f"{name}{axis} = {text}" for axis, text in zip(axes, terms, strict=True))]
    ratio = comparison.as_dict()["ratio"]
    lines += ["", _no_ratio(comparison) if ratio is None else f"ratio = {ratio}"]
    return "\n".join(lines)


def _no_ratio(comparison: Ratio) -> str:
    names = (comparison.first, comparison.second)
    exact = [name for name, terms in zip(names, comparison.terms, strict=True) if not terms]
    if exact:
        return f"no ratio: {' and '.join(exact)} loses nothing"
    return "no ratio: the vectors are not parallel"


def ratio_latex(comparison: Ratio) -> str:
    """Return a comparison as one align environment; a ratio that no line holds as a numerator and a denominator."""
    rows = []
    for name, terms in zip((comparison.first, comparison.second), comparison.terms, strict=True):
        rates = [*columns(terms)]
        for axis, row in zip("xyz" if len(rates) == 3 else ("",), rates, strict=True):
            total = sp.Add(*(x * comparison.symbol**power for power, x in row.items()))
            left = rf"\text{{{name}}}" + (f"_{{{axis}}}" if axis else "")
            rows.append((left, expression_latex(total)))
    if comparison.expression is not None:
        text = sp.latex(comparison.expression)
        if unbroken(text) <= PAGE / 2:
            rows.append((r"\text{ratio}", text))
        else:
            rows.append((r"\text{ratio}", "N / D"))
            rows += zip(("N", "D"), map(expression_latex, sp.fraction(comparison.expression)), strict=True)
    return f"% {comparison.quantity}, {comparison.motion} motion\n{equations(rows)}"


@dataclass(frozen=True)
class RatioResult(Result):
    """The ratio of the errors of two algorithms; expressions are text that SymPy can read."""

    comparison: Ratio = field(metadata=entry(spread=True))

    def text(self) -> str:
        """Return the terms of both, and the ratio."""
        return ratio_text(self.comparison)

    def latex(self) -> str:
        """Return the same as an align environment."""
        return ratio_latex(self.comparison)


def claims_text(claims: Sequence[Claim]) -> str:
    """Return claims as a table."""
    rows = [(claim.statement, _leading_terms(claim)) for claim in claims]
    title = "Ratios of the drift at a constant rate, x = |w| h (for three axes: of the one axis)"
    return "\n".join([title, *TextTable([Column(align="<")] * 2, rows).lines("  ")])


def _leading_terms(claim: Claim) -> str:
    terms = [f"{value}" + (f" x^{power}" if power else "") for power, value in claim.ratio.items()]
    return " + ".join(terms).replace("+ -", "- ")
