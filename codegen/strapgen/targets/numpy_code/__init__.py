"""The target that prints numpy code, vectorised over leading axes."""
