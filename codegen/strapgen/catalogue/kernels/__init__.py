"""Modules that derive the kernels of the catalogue: attitude steps, conversions, updates, loops and motions."""
