"""Runs back ends on motions with known attitude and on recordings."""
