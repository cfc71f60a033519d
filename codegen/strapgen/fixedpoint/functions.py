"""Derives sine, cosine, sin(x)/x and atan2 as sums of products, quotients and selections, with bounds of their errors.

Every function is derived from the computed value of its argument, taken as exact: then all comparisons are exact, the
argument is reduced by identities, and a polynomial is cut where a word cannot tell any more. The derivative alone tells
what becomes of the error of the argument.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction

from strapgen.fixedpoint.angles import arctangent, wrap
from strapgen.fixedpoint.chain import Chain
from strapgen.fixedpoint.sines import cosine, sinc, sine

_FUNCTIONS: dict[str, Callable[..., None]] = {
    "sin": sine,
    "cos": cosine,
    "sinc": sinc,
    "atan2": arctangent,
    "direction": arctangent,
    "wrap": wrap,
}


def derive_function(
    kind: str, chain: Chain, arguments: Sequence[str], distance: Fraction = Fraction(0)
) -> None:
    """Append to a chain the quantities from which a function is computed; the last is its value."""
    options = {"distance": distance, "turns": kind == "atan2"} if kind in ("atan2", "direction") else {}
    _FUNCTIONS[kind](chain, *arguments, **options)
