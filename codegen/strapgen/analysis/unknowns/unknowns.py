"""Algorithms with unknown coefficients: their series, their conditions, and the families that satisfy these.

>>> from strapgen import unknowns
>>> unknowns.series("euler", "constant", terms=1).order
4
"""

from strapgen.analysis.series.series import ErrorSeries, series
from strapgen.analysis.series.velocity_series import VelocitySeries
from strapgen.analysis.series.velocity_series import series as velocity_series
from strapgen.analysis.unknowns.elimination import Equation, Family, PolynomialSolution
from strapgen.analysis.unknowns.solving import LeadingError, SolvedStep, solve
from strapgen.analysis.unknowns.unknown_tableau import UnknownTableau
from strapgen.analysis.unknowns.unknown_tableau import read as read_tableau

__all__ = [
    "Equation",
    "ErrorSeries",
    "Family",
    "LeadingError",
    "PolynomialSolution",
    "SolvedStep",
    "UnknownTableau",
    "VelocitySeries",
    "read_tableau",
    "series",
    "solve",
    "velocity_series",
]
