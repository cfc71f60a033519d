"""Filters of signals: designs from files, kernels, proofs for fixed point, and the study of their responses."""
