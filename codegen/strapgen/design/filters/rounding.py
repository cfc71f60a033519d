"""Rounds the taps of filters to rationals inside their conditions."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from strapgen.catalogue.methods.window import Taps
from strapgen.design.filters.band_grid import REAL
from strapgen.design.filters.unknowns import Unknowns

#: Free taps of a table are multiples of 2 to the power of minus this.
TABLE_BITS = 60


def rounded(unknowns: Unknowns, taps: Sequence[Any], bits: int = TABLE_BITS) -> Taps:
    """Return taps as rationals: the outer ones as nearest multiples of a unit, the inner ones from the conditions.

    `taps` (p + 1 + L): the oldest first.

    >>> from strapgen.design.filters.unknowns import Shape
    >>> taps = [0, 0, 0, 0, 0.408856141152301, -0.0995849129218411, 0.0134378948971269]
    >>> taps[:3] = [-tap for tap in reversed(taps[4:])]
    >>> [str(tap) for tap in rounded(Unknowns(Shape(3, 3, 4), 1), taps, 30)[4:]]
    ['3292544549/8053063680', '-200490913/2013265920', '7214415/536870912']
    """
    outer = [nearest(value, bits) for value in unknowns.values(taps)[unknowns.inner :]]
    return unknowns.taps(unknowns.complete(outer))


def nearest(value: Any, bits: int) -> Fraction:
    """Return the multiple of 2^-bits nearest to a number.

    >>> nearest(REAL.mpf(1) / 3, 4)
    Fraction(5, 16)
    """
    return Fraction(int(REAL.nint(REAL.ldexp(value, bits))), 1 << bits)
