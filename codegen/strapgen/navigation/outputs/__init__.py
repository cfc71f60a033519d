"""Output functions and their filters."""
