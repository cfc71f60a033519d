"""Kernels of the navigation frame: its rate, gravity, velocity and position, and how they begin."""
