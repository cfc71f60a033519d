"""Selects an algorithm for an environment, a gyro, a budget and a processor."""
