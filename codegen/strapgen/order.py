"""The order of an attitude step: what the method allows, and what the samples allow."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Order:
    """Orders of a step: with the order p, the attitude at a given time is off by the p-th power of the step length.

    Parameters
    ----------
    method : int
        Classical order of the method, for any differential equation.
    attitude : int
        Order of the method on the kinematics at hand, given the rate; for x' = A(t) x it can exceed the classical one.
    extraction : int or None
        Order of the error of an extracted rate at an instant; None for a step that is given rates.
    step : int
        Order of the step as a whole. The integral of an extracted rate over the step is exact, so that its errors
        cancel to one or two orders beyond `extraction`.

    Examples
    --------
    >>> print(Order(6, 6, 3, 4))
    method order 6, rate extraction order 3: the step is of order 4
    """

    method: int
    attitude: int
    extraction: int | None
    step: int

    @property
    def limited(self) -> bool:
        """Whether the samples limit the order, not the method."""
        return self.step < self.attitude

    def __str__(self) -> str:
        own = f"method order {self.method}"
        if self.attitude != self.method:
            own += f" ({self.attitude} on attitude kinematics)"
        if self.extraction is not None:
            own += f", rate extraction order {self.extraction}"
        return f"{own}: the step is of order {self.step}"
