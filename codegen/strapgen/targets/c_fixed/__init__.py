"""C99 on integers."""
