"""Firmware projects with CMake and tests."""
