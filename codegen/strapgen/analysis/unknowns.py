"""Algorithms with unknown coefficients: their series, their conditions, and the families that satisfy these."""

from strapgen.analysis.series import ErrorSeries, series
from strapgen.analysis.solving import LeadingError, SolvedStep, solve
from strapgen.analysis.velocity_series import VelocitySeries
from strapgen.analysis.velocity_series import series as velocity_series
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
    "VelocitySeries",
    "read_tableau",
    "series",
    "solve",
    "velocity_series",
]
