"""Prints programs that run a generated C function on any processor and report what it returns."""
