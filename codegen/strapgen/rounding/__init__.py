"""`rounding_bounds` proves how far generated floating-point code is from exact arithmetic."""

from strapgen.rounding.bounds import bounds_of_text, rounding_bounds

__all__ = ["bounds_of_text", "rounding_bounds"]
