"""Kernels: attitude steps, conversions, updates, loops of two speeds, motions."""
