"""Errors of gyros and accelerometers, from a file to measured increments."""
