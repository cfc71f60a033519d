"""Reports on the choice of an algorithm: the frontier of all, and the answer to a brief."""
