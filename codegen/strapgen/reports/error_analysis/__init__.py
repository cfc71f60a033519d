"""Lays out the error analysis: series of truncation errors, ratios of errors, growth."""
