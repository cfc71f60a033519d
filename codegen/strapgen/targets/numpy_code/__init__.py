"""numpy code, vectorised over leading axes."""
