"""Comparison of back ends."""
