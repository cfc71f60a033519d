"""The order of an attitude step, which the method or the samples limit."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Order:
    """The orders of a step; with the order p, the error at a fixed time is proportional to the p-th power of the step.

    Parameters
    ----------
    method : int
        Classical order of the method, which holds for any differential equation.
    attitude : int
        Order of the method on attitude kinematics with a known rate; for x' = A(t) x it can exceed the classical one.
    extraction : int or None
        Order of the error of an extracted rate at an instant; None for a step that takes rates.
    step : int
        Order of the whole step. It exceeds `extraction` by one or two, because the integral of an extracted rate over
        the step is exact and most of the errors cancel.

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
        """Whether the samples, and not the method, limit the order."""
        return self.step < self.attitude

    def __str__(self) -> str:
        text = f"method order {self.method}"
        if self.attitude != self.method:
            text += f" ({self.attitude} on attitude kinematics)"
        if self.extraction is not None:
            text += f", rate extraction order {self.extraction}"
        return f"{text}: the step is of order {self.step}"
