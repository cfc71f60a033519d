"""Ratios of errors as text and LaTeX."""

from __future__ import annotations

from collections.abc import Sequence

import sympy as sp

from strapgen.analysis.ratios import _ANGLE, Claim, Ratio, _columns


def ratio_text(found: Ratio) -> str:
    """Return a comparison as text."""
    lines = [f"{found.first} over {found.second}, {found.motion} motion: {found.quantity}"]
    if found.symbol == _ANGLE:
        lines.append("x = |w| h, the angle of a step")
    data = found.as_dict()
    for name, key in ((found.first, "first_terms"), (found.second, "second_terms")):
        axes = ("",) if len(data[key]) == 1 else (", x", ", y", ", z")
        lines += ["", *(f"{name}{axis} = {text}" for axis, text in zip(axes, data[key], strict=True))]
    lines += ["", f"ratio = {data['ratio']}" if found.ratio is not None else _no_ratio(found)]
    return "\n".join(lines)


def _no_ratio(comparison: Ratio) -> str:
    empty = [
        n
        for n, terms in zip((comparison.first, comparison.second), comparison.terms, strict=True)
        if not terms
    ]
    return (
        f"no ratio: {' and '.join(empty)} loses nothing"
        if empty
        else "no ratio: the vectors are not parallel"
    )


def ratio_latex(found: Ratio) -> str:
    """Return a comparison as LaTeX: lines of an align environment of the package amsmath."""
    rows = []
    for name, terms in zip((found.first, found.second), found.terms, strict=True):
        for row in _columns(terms):
            total = sp.Add(*(x * found.symbol**power for power, x in row.items()))
            rows.append(rf"  \text{{{name}}} &= {sp.latex(total)}")
    if found.expression is not None:
        rows.append(rf"  \text{{ratio}} &= {sp.latex(found.expression)}")
    body = " \\\\\n".join(rows)
    return f"% {found.quantity}, {found.motion} motion\n\\begin{{align*}}\n{body}\n\\end{{align*}}"


def claims_text(found: Sequence[Claim]) -> str:
    """Return claims as a table."""
    width = max(len(claim.statement) for claim in found)
    lines = ["Ratios of the drift at a constant rate, x = |w| h (for three axes: of the one axis)"]
    for claim in found:
        terms = [f"{value}" + (f" x^{power}" if power else "") for power, value in claim.ratio.items()]
        lines.append(f"  {claim.statement:<{width}}  {' + '.join(terms).replace('+ -', '- ')}")
    return "\n".join(lines)
