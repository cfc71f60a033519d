"""Algorithms in two speeds."""
