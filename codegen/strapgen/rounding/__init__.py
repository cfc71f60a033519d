"""`rounding_bounds` proves how far generated floating-point code is from exact arithmetic."""

from strapgen.rounding.bounds import rounding_bounds

__all__ = ["rounding_bounds"]
