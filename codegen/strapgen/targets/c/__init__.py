"""The target that prints C99 in double and in float."""
