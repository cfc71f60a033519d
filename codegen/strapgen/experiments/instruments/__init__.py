"""Experiments on the instruments and systems of 1984."""
