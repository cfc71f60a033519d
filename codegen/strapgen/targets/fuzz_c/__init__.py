"""Prints drivers for fuzzers of generated C functions."""
