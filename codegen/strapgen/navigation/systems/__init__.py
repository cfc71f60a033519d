"""Described systems: a text file says which kernels run at which rates and how they are wired; code follows from it."""
