"""C99 in double and in float."""
