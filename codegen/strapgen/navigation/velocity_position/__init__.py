"""Velocity and position beside truth."""
