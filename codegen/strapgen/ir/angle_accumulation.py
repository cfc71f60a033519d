"""The angle by which rounding turns the attitude over a run: a bound that is linear in the number of steps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

#: Largest error of an element of an orthonormalization's result for which anything is proved.
LARGEST_ERROR = Fraction(1, 1 << 12)


@dataclass(frozen=True)
class AngleAccumulation:
    """The angle between the computed attitude and that of exact arithmetic on the same increments.

    It is at most ``once + per_step N + per_normalization M`` after N steps and M normalizations, while the state stays
    proper. A vector of parameters is proper while its length is at least `shortest`; a matrix while its singular values
    lie between `shortest` and the root of 2 - `shortest`**2. The attitude of a matrix is the nearest rotation.
    """

    once: Fraction  # rad
    per_step: Fraction  # rad
    input_rounding: Fraction  # rad a step, if increments are rounded to their format first
    #: In rad, of a normalization that multiplies the words of the state by one factor and rounds each of them once; an
    #: orthonormalization of a matrix has it too.
    per_normalization: Fraction
    #: In rad, of an orthonormalization that multiplies the matrix C by a symmetric expansion of the inverse root of
    #: C'C, per error of an element of its result; None where nothing is proved.
    per_element: Fraction | None
    shortest: Fraction  # length, or singular value, from which the bound holds
    #: Least length of the state from which `proved_steps` counts; of a matrix, least singular value, the largest
    #: being at most the root of 2 - `start`**2.
    start: Fraction
    proved_steps: int  # those in which the state is proved to stay proper
    beyond: Fraction  # factor of the bound over more steps, if the state stays proper all the same
    orthonormalized: Fraction  # factor of the steps' part of a run with orthonormalizations
    dual_rows_apart: int  # most steps between orthonormalizations by dual rows; 0 where nothing is proved
    dual_rows_growth: Fraction  # such an orthonormalization stretches the error by at most 1 and this
    added: Fraction = Fraction(0)  # rounding of a proper state in a step, as the length of all its elements

    @property
    def dual_rows_error(self) -> Fraction:
        """Largest error of an element of an orthonormalization by dual rows for which anything is proved."""
        return (1 - self.shortest) / 1024

    @property
    def dual_rows_start(self) -> Fraction:
        """Largest distance from 1 of a matrix's squared singular values where a run with dual rows begins."""
        return (1 - self.shortest) / 65

    def bound(
        self,
        steps: int,
        normalizations: int = 0,
        error: Fraction | float = 0,
        rounded_inputs: bool = False,
        dual_rows: bool = False,
    ) -> float:
        """Return a bound of the angle after a number of steps, in rad; inf where nothing is proved.

        Normalizations, or orthonormalizations, count among the steps and are at most `proved_steps` apart, or
        `dual_rows_apart` if it is that scheme; `error` bounds an element of an orthonormalization's result, up to
        `LARGEST_ERROR`. With `rounded_inputs` increments are rounded to their format first.

        >>> one, unit = Fraction(1), Fraction(1, 1000)
        >>> run = AngleAccumulation(4 * unit, unit, unit, 2 * unit, 0 * one, one / 2, one, 100, one, one, 0, 0 * one)
        >>> round(run.bound(10, normalizations=1), 6)
        0.016
        """
        total = self.once + steps * (self.per_step + (self.input_rounding if rounded_inputs else 0))
        if normalizations:
            limit = self.dual_rows_error if dual_rows else LARGEST_ERROR
            if self.per_element is None or (self.per_element and error > limit):
                return math.inf
            added = self.per_normalization + self.per_element * Fraction(error)
            total = total * self.orthonormalized + normalizations * added
            if dual_rows:
                return self._stretched(total, normalizations)
        elif steps > self.proved_steps:
            total *= self.beyond
        return math.nextafter(float(total), math.inf)

    def _stretched(self, total: Fraction, normalizations: int) -> float:
        """Return a bound after so many orthonormalizations by dual rows."""
        exponent = normalizations * float(self.dual_rows_growth)
        if not self.dual_rows_apart or exponent > 100:
            return math.inf
        return float(total) * math.exp(exponent) * (1 + 1e-12)  # which covers the rounding of this line
