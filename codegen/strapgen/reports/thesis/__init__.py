"""Reports what is computed again of the thesis: its tables, and the statements of its text."""
