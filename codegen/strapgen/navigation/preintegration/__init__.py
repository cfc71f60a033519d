"""Preintegration of stamped samples between any two instants, in Python and as a C++ header."""

#: What samples are: increments since the stamp before, rates that are their means, or rates at the stamps.
INPUTS = ("increments", "rates", "instants")
