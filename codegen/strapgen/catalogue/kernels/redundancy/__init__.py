"""Kernels of redundant single-axis sensors: parity equations, selection, triads, moment arm and boresight."""
