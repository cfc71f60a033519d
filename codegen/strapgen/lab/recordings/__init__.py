"""Recorded rates and increments: reading, and attitude along them."""
