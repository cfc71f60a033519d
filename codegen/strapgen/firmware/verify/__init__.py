"""Verification of generated files."""
