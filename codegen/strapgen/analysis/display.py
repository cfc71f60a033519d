"""How the objects of the analysis show themselves in a notebook."""

from __future__ import annotations

from strapgen.analysis.error_analysis import ErrorAnalysis, invariant_rows
from strapgen.analysis.growth import Stability, stability_latex
from strapgen.analysis.series.series import PARTS, STEP, ErrorSeries
from strapgen.analysis.series.velocity_series import VelocitySeries, velocity_series_latex
from strapgen.analysis.unknowns import unknowns_report
from strapgen.analysis.unknowns.elimination import Equation, Family, PolynomialSolution
from strapgen.analysis.unknowns.solving import LeadingError, SolvedStep
from strapgen.analysis.unknowns.unknown_tableau import UnknownTableau
from strapgen.results.display.expressions import expression_latex
from strapgen.results.display.latex import equations
from strapgen.results.display.objects import latex

#: Most lines of a formula in a notebook.
_LINES = 24


latex.register(UnknownTableau, unknowns_report.unknown_tableau_latex)
latex.register(Family, unknowns_report.family_latex)
latex.register(PolynomialSolution, unknowns_report.solution_latex)
latex.register(SolvedStep, unknowns_report.solved_latex)
latex.register(LeadingError, unknowns_report.leading_latex)


@latex.register
def _(stability: Stability) -> str | None:
    return stability_latex([stability])


@latex.register
def _(equation: Equation) -> str | None:
    return unknowns_report.conditions_latex([equation])


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
    rows: list[tuple[str, str]] = []
    if series.invariant:
        power = min(series.invariant)
        rows = invariant_rows(power, series.invariant[power])
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
