"""Block diagrams of described systems."""
