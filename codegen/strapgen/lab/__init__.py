"""Simulation of generated code against truth: runs, comparisons, convergence, recordings, sensor errors, cost."""
