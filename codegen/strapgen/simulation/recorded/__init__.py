"""Reads recorded files: their rows, columns and headers, and rates that are integrated."""
