"""Runs of an algorithm along a motion, on any back end."""
