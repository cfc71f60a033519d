"""Writes SymPy's expressions as LaTeX whose sums can be broken at the width of a page."""

from __future__ import annotations

from fractions import Fraction

import sympy as sp

from strapgen.reports.display.latex import PAGE, sum_text, unbroken

#: Width of a left side, about, in widths of a digit.
_LEFT = 8.0


def expression_latex(expression: sp.Expr) -> str:
    r"""Return an expression as LaTeX: as it stands if lines hold its parts, otherwise expanded, a term at a time.

    Examples
    --------
    >>> x = sp.Symbol("x")
    >>> expression_latex((x - 1) / 2)
    '\\frac{x}{2} - \\frac{1}{2}'
    """
    text = str(sp.latex(expression))
    if unbroken(text) <= PAGE - _LEFT:
        return text
    terms = sp.Add.make_args(sp.expand(expression))
    numbers = []
    for term in terms:
        number, factor = term.as_coeff_Mul()
        if not number.is_Rational:
            return " + ".join(str(sp.latex(one)) for one in terms).replace("+ -", "- ")
        numbers.append((sp.Rational(number), factor))
    return sum_text(
        [(_fraction(number), "" if factor == 1 else str(sp.latex(factor))) for number, factor in numbers]
    )


def _fraction(number: sp.Rational) -> Fraction:
    return Fraction(int(number.p), int(number.q))
