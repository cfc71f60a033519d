"""Truncation-error series."""
