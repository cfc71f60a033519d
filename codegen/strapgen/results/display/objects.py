"""Objects in a notebook: formulas as LaTeX, code and tables as HTML.

An application registers the forms of its objects in its module ``display``, which `strapgen.ir.notebook_display` loads
when one of them is first shown.
"""

from __future__ import annotations

import html as markup
from functools import singledispatch
from pathlib import Path
from typing import Any

from strapgen.catalogue.methods.coning_coefficients import Design
from strapgen.catalogue.methods.shaped_coning import ShapedConing
from strapgen.catalogue.methods.tableaux import Tableau
from strapgen.catalogue.methods.window import Window
from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.kernel.kernel import Kernel
from strapgen.results import figures
from strapgen.results.display import formulas
from strapgen.results.display.methods import (
    coning_latex,
    shaped_coning_latex,
    tableau_latex,
    window_latex,
)
from strapgen.results.table import Column, TextTable
from strapgen.storage.files import write_file

#: Most lines of code in a notebook.
_CODE_LINES = 200
_FORMAT_COLUMNS = (Column("value", "<"), Column("format", "<"), Column("error bound", spec=".2e"))


@singledispatch
def latex(value: Any) -> str | None:
    """Return an object as LaTeX; None where a reader would not see it at a glance."""
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
