"""Redundant gyros: geometry, parity equations, failures."""
