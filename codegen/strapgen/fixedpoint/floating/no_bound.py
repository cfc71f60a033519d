"""The error that says why rounding has no bound."""

from __future__ import annotations


class NoBoundError(Exception):
    """No bound of the rounding can be proved; the text says why."""
