"""Prints test vectors of a generated C function: a table, and a test that runs on any processor."""
