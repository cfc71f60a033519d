"""Functions that all other folders use: checks, errors, files, cache and timing. They know nothing of algorithms."""
