"""One step as a power series in its length, of which noise and truncation errors are predicted."""
