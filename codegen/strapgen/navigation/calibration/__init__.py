"""Calibration of a measurement unit."""
