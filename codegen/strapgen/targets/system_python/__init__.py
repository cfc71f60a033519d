"""The target that prints the Python twin of the C of a described system."""
