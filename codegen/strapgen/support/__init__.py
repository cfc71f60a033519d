"""The ground: checks, errors, files. It knows nothing of algorithms."""
