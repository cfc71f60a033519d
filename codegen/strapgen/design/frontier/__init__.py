"""Accuracy against cost over all methods."""
