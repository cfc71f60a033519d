"""How rounding turns the attitude over the steps of a run: a bound that grows with their number and is not stretched."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from fractions import Fraction
from typing import Any


@dataclass(frozen=True)
class AngleAccumulation:
    """The angle between the computed attitude and that of exact arithmetic on the same increments.

    It is at most ``once + per_step N + per_normalization M`` after N steps and M normalizations, while the state stays
    proper. A vector of parameters is proper while its length is at least `shortest`; a matrix while its singular values
    lie between `shortest` and the root of 2 - `shortest`**2. The attitude of a matrix is the nearest rotation.

    Parameters
    ----------
    once : Fraction
        The part that does not depend on the number of steps, in rad.
    per_step : Fraction
        What every step adds, in rad.
    input_rounding : Fraction
        What every step adds if increments are rounded to their format first, in rad.
    per_normalization : Fraction or None
        What a normalization adds that multiplies the words of the state by one factor and rounds each of them once, in
        rad; None for a matrix, where that is no orthonormalization.
    shortest : Fraction
        Length, or singular value, from which the bound holds.
    start : Fraction
        Least length of the state from which `proved_steps` counts; of a matrix, least singular value, the largest being
        at most the root of 2 - `start`**2.
    proved_steps : int
        Number of steps in which the state is proved to stay proper.
    beyond : Fraction
        Factor of the bound of a run of more steps in which the state stays proper all the same.
    """

    once: Fraction
    per_step: Fraction
    input_rounding: Fraction
    per_normalization: Fraction | None
    shortest: Fraction
    start: Fraction
    proved_steps: int
    beyond: Fraction

    def bound(self, steps: int, normalizations: int = 0, rounded_inputs: bool = False) -> float:
        """Return a bound of the angle after a number of steps, in rad.

        Parameters
        ----------
        steps : int
        normalizations : int, optional
            Number of normalizations among them.
        rounded_inputs : bool, optional
            Whether increments are rounded to their format first.

        Raises
        ------
        ValueError
            If there are normalizations and nothing is proved of them.

        Examples
        --------
        >>> one, unit = Fraction(1), Fraction(1, 1000)
        >>> AngleAccumulation(4 * unit, unit, unit, 2 * unit, one / 2, one, 100, one).bound(10, normalizations=1)
        0.016
        """
        total = self.once + steps * self.per_step
        if rounded_inputs:
            total += steps * self.input_rounding
        if normalizations:
            if self.per_normalization is None:
                raise ValueError("no bound is known of a run with orthonormalizations of a matrix")
            total += normalizations * self.per_normalization
        elif steps > self.proved_steps:
            total *= self.beyond
        return float(total)

    def as_dict(self) -> dict[str, Any]:
        """Return the record as plain JSON data; fractions are text."""
        return {
            name: str(value) if isinstance(value, Fraction) else value for name, value in asdict(self).items()
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> AngleAccumulation:
        """Rebuild the record from `as_dict`."""
        return cls(**{name: Fraction(x) if isinstance(x, str) else x for name, x in data.items()})
