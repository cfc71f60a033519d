"""`rounding_bounds` proves how far generated floating-point code is from exact arithmetic."""

from strapgen.fixedpoint.floating.bounds import rounding_bounds

__all__ = ["rounding_bounds"]
