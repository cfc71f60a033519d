"""Ratios of errors between methods."""
