"""`rounding_bounds` bounds the distance of generated floating-point code from exact arithmetic."""

from strapgen.fixedpoint.floating.bounds import rounding_bounds

__all__ = ["rounding_bounds"]
