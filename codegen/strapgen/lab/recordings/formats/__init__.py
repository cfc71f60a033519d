"""Readers of log files, a module for each format."""
