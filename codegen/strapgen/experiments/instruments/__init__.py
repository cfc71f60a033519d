"""Experiments on the instruments and systems of 1984 that stand around an attitude algorithm."""
