"""Tableaux: coefficients, order conditions, families."""
