"""The integer model of the fixed-point C, in Python."""
