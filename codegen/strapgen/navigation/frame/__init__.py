"""Kernels of the navigation frame."""
