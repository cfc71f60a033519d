"""Algorithms with unknown coefficients: their series, their conditions, and the families that satisfy these."""

from strapgen.analysis.series import ErrorSeries, series
from strapgen.analysis.solving import LeadingError, SolvedStep, solve
from strapgen.catalogue.methods.unknown_tableau import UnknownTableau
from strapgen.catalogue.methods.unknown_tableau import read as read_tableau
from strapgen.symbolic.families import Equation, Family, PolynomialSolution

__all__ = [
    "Equation",
    "ErrorSeries",
    "Family",
    "LeadingError",
    "PolynomialSolution",
    "SolvedStep",
    "UnknownTableau",
    "read_tableau",
    "series",
    "solve",
]
