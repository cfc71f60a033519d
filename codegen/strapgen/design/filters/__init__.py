"""Coefficients of filters by constrained least squares."""
