"""Runs the loops of an algorithm in two speeds in arithmetic of 40 digits."""

from __future__ import annotations

import numpy as np

from strapgen.navigation.two_speed.loops import LoopsFromPython
from strapgen.run.evaluators import Array
from strapgen.run.exact import in_digits, rounded


class ExactLoops(LoopsFromPython):
    """Calls the loops with all digits, which nothing rounds before the end of the run."""

    def converted(self, name: str, values: Array, *, summed: bool = False) -> Array:
        """Return samples as numbers of mpmath, see `Loops.converted`."""
        return in_digits(values)

    def in_si(self, name: str, values: Array) -> Array:
        """Return numbers rounded to double, see `Loops.in_si`."""
        return np.asarray(rounded(values))
