"""The target that prints fixed-point C99, on integers alone."""
