"""Delivery into firmware: projects, test vectors, verification, check of foreign code."""
