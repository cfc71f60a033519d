"""Drift of fixed point over the length of a word."""
