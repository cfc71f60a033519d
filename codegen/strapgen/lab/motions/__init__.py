"""Motions with known attitude, and specific forces along them."""
