"""Order of convergence from runs."""
