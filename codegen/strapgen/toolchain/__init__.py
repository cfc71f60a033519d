"""The C compiler, through cffi."""
