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
    """Add to a chain the quantities that a function is computed by, in order; the last is its value.

    Parameters
    ----------
    kind : str
        "sin", "cos", "sinc", "atan2", "direction" or "wrap".
    chain : Chain
    arguments : sequence of str
        Quantities that are stored whole.
    distance : Fraction, optional
        The inverse of a bound of how fast atan2 changes with its arguments, where more is known than their ranges tell.

    Raises
    ------
    ValueError
        If the range of an argument is too wide.
    """
    options = {"distance": distance, "turns": kind == "atan2"} if kind in ("atan2", "direction") else {}
    _FUNCTIONS[kind](chain, *arguments, **options)
