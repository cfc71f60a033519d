"""The target that prints the integer model of the fixed-point C in Python."""
