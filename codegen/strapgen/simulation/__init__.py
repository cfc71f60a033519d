"""Runs of back ends: on motions with known attitude, on recordings, along courses."""
