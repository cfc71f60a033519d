"""The target that prints the C of a described system."""
