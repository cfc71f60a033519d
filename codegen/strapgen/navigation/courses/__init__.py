"""Courses over the Earth."""
