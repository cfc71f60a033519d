"""Pulse torquing of gyros."""
