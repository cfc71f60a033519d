"""Exact mathematics that other folders use: kernels, rotations, series, polynomials. Nothing here optimises code."""
