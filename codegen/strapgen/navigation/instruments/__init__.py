"""Errors of instruments and their compensation."""
