"""Compiles generated C and loads it, through cffi."""
