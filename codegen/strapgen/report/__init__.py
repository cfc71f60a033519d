"""Writes one page of HTML that needs no network: formulas, code, bounds, tables and plots of an algorithm."""
