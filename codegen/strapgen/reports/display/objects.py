"""Shows objects in a notebook: formulas as LaTeX, code and tables as HTML, records as plots.

`strapgen.support.brief` loads this module when one of the objects is first shown.
"""

from __future__ import annotations

import base64
import html as markup
from functools import singledispatch
from pathlib import Path
from typing import Any

from strapgen.analysis.error_analysis import ErrorAnalysis
from strapgen.analysis.growth import Stability
from strapgen.analysis.notation import LATEX, covariant_text
from strapgen.analysis.series import PARTS, STEP, ErrorSeries
from strapgen.analysis.solving import LeadingError, SolvedStep
from strapgen.analysis.velocity_series import VelocitySeries
from strapgen.catalogue.methods.coning_coefficients import Design
from strapgen.catalogue.methods.shaped_coning import ShapedConing
from strapgen.catalogue.methods.tableau import Tableau
from strapgen.catalogue.methods.unknown_tableau import UnknownTableau
from strapgen.catalogue.methods.window import Window
from strapgen.experiments.algorithm import AttitudeAlgorithm
from strapgen.experiments.comparison import Comparisons
from strapgen.experiments.convergence import Convergence
from strapgen.ir.integer_program import FixedProgram
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources
from strapgen.reports import comparison, convergence, formulas, runs
from strapgen.reports.display import unknowns
from strapgen.reports.display.expressions import expression_latex
from strapgen.reports.display.latex import equations
from strapgen.reports.display.methods import (
    coning_latex,
    shaped_coning_latex,
    stability_latex,
    tableau_latex,
    window_latex,
)
from strapgen.reports.error_analysis.velocity_series import velocity_series_latex
from strapgen.reports.plots import figures
from strapgen.reports.plots import runs as run_plots
from strapgen.reports.table import Column, TextTable
from strapgen.simulation.courses import Course
from strapgen.simulation.recording import History
from strapgen.simulation.runs import Run
from strapgen.support.exceptions import MissingExtraError
from strapgen.support.files import write_file
from strapgen.symbolic.families import Equation, Family, PolynomialSolution
from strapgen.symbolic.kernel import Kernel

#: Most lines of a formula in a notebook, and most lines of code.
_LINES, _CODE_LINES = 24, 200
_FORMAT_COLUMNS = (Column("value", "<"), Column("format", "<"), Column("error bound", spec=".2e"))


@singledispatch
def latex(value: Any) -> str | None:
    """Return an object as LaTeX; None where a reader would not see it at a glance."""
    return None


@latex.register
def _(kernel: Kernel) -> str | None:
    return formulas.short_latex(kernel)


@latex.register
def _(algorithm: AttitudeAlgorithm) -> str | None:
    return formulas.short_latex(algorithm.derive())


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


@latex.register
def _(stability: Stability) -> str | None:
    return stability_latex([stability])


@latex.register
def _(tableau: UnknownTableau) -> str | None:
    return unknowns.unknown_tableau_latex(tableau)


@latex.register
def _(equation: Equation) -> str | None:
    return unknowns.conditions_latex([equation])


@latex.register
def _(family: Family) -> str | None:
    return unknowns.family_latex(family)


@latex.register
def _(solution: PolynomialSolution) -> str | None:
    return unknowns.solution_latex(solution)


@latex.register
def _(solved: SolvedStep) -> str | None:
    return unknowns.solved_latex(solved)


@latex.register
def _(error: LeadingError) -> str | None:
    return unknowns.leading_latex(error)


@latex.register
def _(series: VelocitySeries) -> str | None:
    text = velocity_series_latex(series)
    return text if len(text.splitlines()) <= _LINES else None


@latex.register
def _(analysis: ErrorAnalysis) -> str | None:
    return latex(analysis.step)


@latex.register
def _(series: ErrorSeries) -> str | None:
    """Return the leading terms of drift, scale and skew: in vectors for a general rate."""
    rows = []
    if series.invariant:
        power = min(series.invariant)
        one = series.invariant[power]
        rows.append((rf"h^{{{power}}}\!:\ \mathbf{{d}}", covariant_text(one.drift, notation=LATEX)))
        if one.symmetric:
            rows.append(
                (
                    rf"h^{{{power}}}\!:\ \mathbf{{Y}}",
                    covariant_text(one.symmetric, symmetric=True, notation=LATEX),
                )
            )
    else:
        for part in PARTS:
            if coefficients := series.coefficients(part):
                power = min(coefficients)
                rows += [
                    (rf"\mathrm{{{part}}}_{axis}", expression_latex(coefficients[power][k] * STEP**power))
                    for k, axis in enumerate("xyz")
                ]
    text = equations(rows) if rows else "$0$"
    return text if len(text.splitlines()) <= _LINES else None


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


@html.register
def _(run: Run) -> str | None:
    table = runs.largest_table(run).as_html(f"mean drift {run_drift(run):.3g} deg")
    try:
        content = figures.image(run_plots.run_figure(run, ""), "run.png")
    except MissingExtraError:
        return table
    picture = base64.b64encode(content).decode()
    return (
        f'{table}\n<img alt="errors of the run" style="max-width:100%" src="data:image/png;base64,{picture}">'
    )


@html.register
def _(rows: Comparisons) -> str | None:
    return comparison.comparison_table(rows).as_html()


@html.register
def _(ladder: Convergence) -> str | None:
    return convergence.ladder_table(ladder).as_html(f"{ladder.kernel} on {ladder.backend}")


def run_drift(run: Run) -> float:
    """Return the mean drift of a run in deg."""
    import math

    return math.degrees(run.mean_drift)


def plot(records: Run | History | Course, path: str | Path | None, title: str) -> Any:
    """Return the figure of some records, or write it to a file and return its path."""
    if isinstance(records, Run):
        figure = run_plots.run_figure(records, title)
    elif isinstance(records, Course):
        figure = run_plots.course_figure(records, title)
    else:
        names = runs.history_elements(records)
        figure = run_plots.history_figure(records, names, title)
    if path is not None:
        return write_file(path, figures.image(figure, path))
    figures.pyplot().close(figure)  # a notebook shows what a cell returns, and nothing twice
    return figure


def _code(text: str, title: str) -> str:
    """Return code under a title that opens it; what follows many lines is counted."""
    lines = text.split("\n")
    if len(lines) > _CODE_LINES:
        lines = [*lines[:_CODE_LINES], f"... {len(lines) - _CODE_LINES} more lines"]
    shown = markup.escape("\n".join(lines))
    return f"<details open><summary>{markup.escape(title)}</summary><pre>{shown}</pre></details>"
