"""Objects in a notebook: formulas as LaTeX, code and tables as HTML.

An application registers the forms of its objects in its module ``display``, which `strapgen.ir.notebook_display` loads
when one of them is first shown.
"""

from __future__ import annotations

import html as markup
import re
from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import singledispatch
from pathlib import Path
from typing import Any

import sympy as sp

from strapgen.catalogue.methods import order_conditions
from strapgen.catalogue.methods.coning_coefficients import Design
from strapgen.catalogue.methods.method import sample_names
from strapgen.catalogue.methods.shaped_coning import ShapedConing
from strapgen.catalogue.methods.tableaux import Tableau
from strapgen.catalogue.methods.window import Window
from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.kernel.kernel import Kernel
from strapgen.results import figures
from strapgen.results.display import formulas
from strapgen.results.display.expressions import expression_latex
from strapgen.results.display.latex import PAGE, equations, sum_text, width
from strapgen.results.table import Column, TextTable
from strapgen.storage.files import write_file

#: Most lines of code in a notebook.
_CODE_LINES = 200
_FORMAT_COLUMNS = (Column("value", "<"), Column("format", "<"), Column("error bound", spec=".2e"))
#: The highest order whose conditions stand below a tableau: there are eight.
_MOST_CONDITIONS = 4
#: Decimals of the weights of a filter.
_DECIMALS = 4


@singledispatch
def latex(value: Any) -> str | None:
    """Return an object as LaTeX; None if it is too long to read."""
    return None


@latex.register
def _(kernel: Kernel) -> str | None:
    return formulas.short_latex(kernel)


@latex.register
def _(tableau: Tableau) -> str | None:
    return tableau_latex(tableau)


@latex.register
def _(design: Design) -> str | None:
    return coning_latex(design)


@latex.register
def _(window: Window) -> str | None:
    return window_latex(window)


@latex.register
def _(shape: ShapedConing) -> str | None:
    return shaped_coning_latex(shape)


@singledispatch
def html(value: Any) -> str | None:
    """Return an object as HTML; None where it has no such form."""
    return None


@html.register
def _(program: Program) -> str | None:
    lines = formulas.program_as_text(program).split("\n")
    return _code("\n".join(lines[2:]).strip("\n"), f"{lines[0]}; {lines[1]}")


@html.register
def _(program: FixedProgram) -> str | None:
    interface, bounds = program.interface, program.error_bounds
    rows = [
        (a.signal.name, str(a.format), float(bounds[a.signal.name]) if a.signal.name in bounds else None)
        for a in (*interface.inputs, *interface.outputs)
    ]
    counts = ", ".join(f"{number} {kind}" for kind, number in program.operations.items() if number)
    return TextTable(_FORMAT_COLUMNS, rows).as_html(f"{program.name}: {program.program.title}; {counts}")


@html.register
def _(sources: Sources) -> str | None:
    return "\n".join(_code(text, name) for name, text in sources.step_files.items())


@singledispatch
def figure(records: Any, title: str) -> Any:
    """Return the figure of some records."""
    raise TypeError(f"{type(records).__name__} has no plot")


def plot(records: Any, path: str | Path | None, title: str) -> Any:
    """Return the figure of some records, or write it to a file and return its path."""
    drawn = figure(records, title)
    if path is not None:
        return write_file(path, figures.image(drawn, path))
    figures.pyplot().close(drawn)  # a notebook shows what a cell returns, and nothing twice
    return drawn


def _code(text: str, title: str) -> str:
    """Return code under a title that opens it; the lines after many are counted."""
    lines = text.split("\n")
    if len(lines) > _CODE_LINES:
        lines = [*lines[:_CODE_LINES], f"... {len(lines) - _CODE_LINES} more lines"]
    shown = markup.escape("\n".join(lines))
    return f"<details open><summary>{markup.escape(title)}</summary><pre>{shown}</pre></details>"


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
    names = [_sample(name) for name in sample_names(design.increments, design.previous)]
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
        rf"\mathbf{{d}}_{{{k}}}"
        for k in range(1 - window.previous, window.total_increments - window.previous + 1)
    ]
    return _rounded(
        (rf"\mathbf{{c}}_{{{m}}}", _decimal_sum(zip(row, samples, strict=True)))
        for m, row in enumerate(window.filters)
    )


def shaped_coning_latex(shape: ShapedConing) -> str:
    """Return the rotation vector of a step by coefficients for a band or a spectrum; they have four decimals."""
    names = [rf"\mathbf{{d}}_{{{k}}}" for k in range(1 - shape.previous, shape.increments + 1)]
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
        rows.append((f"c_{{{stage}}}", _join([_number(node), *parts])))
    for letter, weights in (("b", tableau.weights), (r"\hat b", tableau.embedded_weights or ())):
        named = [(f"{letter}_{{{place}}}", _number(x)) for place, x in enumerate(weights, 1) if x]
        if named:
            (left, right), *others = named
            rows.append((left, _join([right, *(f"{name} = {text}" for name, text in others)])))
    return equations(rows)


def _join(parts: Iterable[str]) -> str:
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
