"""Writes generated C as a unit for co-simulation by the standard FMI 2.0 or 3.0."""
