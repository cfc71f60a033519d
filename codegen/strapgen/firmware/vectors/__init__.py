"""Test vectors for generated C."""
