"""Tableaux, order conditions, coning coefficients and windows as LaTeX, as the literature prints them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from fractions import Fraction

import sympy as sp

from strapgen.catalogue.methods import order_conditions
from strapgen.catalogue.methods.coning_coefficients import Design
from strapgen.catalogue.methods.method import sample_names
from strapgen.catalogue.methods.shaped_coning import ShapedConing
from strapgen.catalogue.methods.tableaux import Tableau
from strapgen.catalogue.methods.window import Window
from strapgen.results.display.expressions import expression_latex
from strapgen.results.display.latex import PAGE, equations, sum_text, width

#: The highest order whose conditions stand below a tableau: there are eight.
_MOST_CONDITIONS = 4
#: Decimals of the weights of a filter.
_DECIMALS = 4


def tableau_latex(tableau: Tableau) -> str:
    """Return a tableau as books print it, or its coefficients stage by stage where that is wider than a page."""
    rows = [
        [_number(x) for x in (node, *row)] for node, row in zip(tableau.nodes, tableau.matrix, strict=True)
    ]
    bottom = [[*map(_number, row)] for row in (tableau.weights, tableau.embedded_weights) if row]
    stages = len(tableau.nodes)
    filled = [[*row, *[""] * (1 + stages - len(row))] for row in (*rows, *(["", *row] for row in bottom))]
    if sum(max(width(row[k]) for row in filled) + 2 for k in range(1 + stages)) > PAGE:
        return _by_stage(tableau)
    return array_latex(rows, bottom)


def array_latex(rows: Sequence[Sequence[str]], bottom: Sequence[Sequence[str]]) -> str:
    """Return rows of node and matrix, and rows of weights, all as LaTeX, as an array with rules."""
    stages = len(rows)
    filled = [[*row, *[""] * (1 + stages - len(row))] for row in (*rows, *(["", *row] for row in bottom))]
    lines = [" & ".join(row) for row in filled]
    lines[stages] = r"\hline " + lines[stages]
    body = " \\\\\n".join(lines)
    return f"\\[\n\\begin{{array}}{{c|{'c' * stages}}}\n{body}\n\\end{{array}}\n\\]"


def order_conditions_latex(order: int) -> str:
    r"""Return the conditions up to an order, one for each rooted tree, as an align environment.

    >>> print(order_conditions_latex(2))
    \begin{align*}
    \sum b_{i} &= 1 \\
    \sum b_{i} c_{i} &= \frac{1}{2}
    \end{align*}
    """
    every = [tree for nodes in range(1, order + 1) for tree in order_conditions.trees(nodes)]
    return equations(
        (_weight(order_conditions.weight_text(tree)), _number(Fraction(1, order_conditions.density(tree))))
        for tree in every
    )


def method_latex(tableau: Tableau) -> str:
    """Return a tableau and below it the order conditions that it fulfils, up to the fourth order."""
    return "\n\n".join([tableau_latex(tableau), order_conditions_latex(min(tableau.order, _MOST_CONDITIONS))])


def coning_latex(design: Design) -> str:
    """Return the rotation vector of a step by coning coefficients, and the mean drift that remains on coning."""
    names = [_sample(name) for name in sample_names(design.samples, design.previous)]
    terms = [(Fraction(1), name) for name in names[design.previous :]]
    terms += [(c, rf"{names[older]} \times {names[newer]}") for (older, newer), c in design.pairs.items()]
    symbols = {name: sp.Symbol(name) for name in ("alpha", "omega", "T")}
    drift = sp.sympify(design.residual().expression, locals=symbols)
    return equations(
        [(r"\boldsymbol{\phi}", sum_text(terms)), (r"\delta\dot{\phi}", expression_latex(drift))]
    )


def window_latex(window: Window) -> str:
    r"""Return the Legendre coefficients of the rate that a window estimates; weights have four decimals.

    The increments of the step are \mathbf{d}_{1} and on, those before it \mathbf{d}_{0} and back.
    """
    samples = [
        rf"\mathbf{{d}}_{{{k}}}" for k in range(1 - window.previous, window.samples - window.previous + 1)
    ]
    return _rounded(
        (rf"\mathbf{{c}}_{{{m}}}", _decimal_sum(zip(row, samples, strict=True)))
        for m, row in enumerate(window.filters)
    )


def shaped_coning_latex(shape: ShapedConing) -> str:
    """Return the rotation vector of a step by coefficients for a band or a spectrum; they have four decimals."""
    names = [rf"\mathbf{{d}}_{{{k}}}" for k in range(1 - shape.previous, shape.samples + 1)]
    older = _decimal_sum((c, names[-1 - s]) for s, c in reversed([*enumerate(shape.coefficients, 1)]))
    total = " + ".join(names[shape.previous :])
    return _rounded([(r"\boldsymbol{\phi}", rf"{total} + \left({older}\right) \times {names[-1]}")])


def _rounded(rows: Iterable[tuple[str, str]]) -> str:
    """Return equations that hold for numbers with four decimals."""
    return equations(rows).replace(" &= ", r" &\approx ")


def _decimal_sum(terms: Iterable[tuple[Fraction, str]]) -> str:
    """Return a sum of vectors with weights of four decimals."""
    text = ""
    for weight, name in terms:
        if rounded := round(float(weight), _DECIMALS):
            size = "" if abs(rounded) == 1 else f"{abs(rounded):.{_DECIMALS}f} "
            sign = ("-" if rounded < 0 else "") if not text else (" - " if rounded < 0 else " + ")
            text += f"{sign}{size}{name}"
    return text or "0"


def _by_stage(tableau: Tableau) -> str:
    """Return the nonzero coefficients of a tableau, a row for each stage and one for the weights."""
    rows = []
    for stage, (node, row) in enumerate(zip(tableau.nodes, tableau.matrix, strict=True), 1):
        parts = [rf"a_{{{stage},{place}}} = {_number(x)}" for place, x in enumerate(row, 1) if x]
        rows.append((f"c_{{{stage}}}", _joined([_number(node), *parts])))
    for letter, weights in (("b", tableau.weights), (r"\hat b", tableau.embedded_weights or ())):
        named = [(f"{letter}_{{{place}}}", _number(x)) for place, x in enumerate(weights, 1) if x]
        if named:
            (left, right), *others = named
            rows.append((left, _joined([right, *(f"{name} = {text}" for name, text in others)])))
    return equations(rows)


def _joined(parts: Iterable[str]) -> str:
    return r", \quad ".join(parts)


def _number(value: Fraction | sp.Expr) -> str:
    return str(
        sp.latex(sp.Rational(value.numerator, value.denominator) if isinstance(value, Fraction) else value)
    )


def _weight(text: str) -> str:
    r"""Return an elementary weight: "sum b_i a_ij c_j^2" as \sum b_{i} a_{ij} c_{j}^2."""
    return re.sub(r"_([a-z]+)", r"_{\1}", text.replace("sum", r"\sum", 1))


def _sample(name: str) -> str:
    """Return the letter of a sample, those before the step counted from zero backwards as in d_0, d_{-1}."""
    kind, number = re.fullmatch(r"([a-z]+)(\d+)", name).groups()  # type: ignore[union-attr]
    index = {"past": 1 - int(number), "d": int(number)}[kind]
    return rf"\mathbf{{d}}_{{{index}}}"
