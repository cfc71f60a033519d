"""Coning coefficients for a band of frequencies."""
