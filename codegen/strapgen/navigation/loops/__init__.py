"""Levelling, heading and vertical loops."""
