"""Properties of an attitude step for back ends: its other kernels, its identity and its orders."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

from strapgen.ir.notebook_display import short_repr

#: Fraction bits to which the root of a square is rounded up.
_ROOT_BITS = 64


@dataclass(frozen=True)
class Truncation:
    """The truncation of the exponential series by which a transition follows from its rotation vector.

    >>> cut = Truncation(12, Fraction(1, 2), "angle_square")
    >>> float(cut.bound(Fraction(1, 4))) < 3e-18, cut.bound(Fraction(0))
    (True, Fraction(0, 1))
    """

    order: int  # the highest power of the rotation vector
    scale: Fraction  # 1/2 for parameters of half the angle, 1 for matrices
    square: str  # name of the value that is the square of the rotation vector's length, in rad^2

    def bound(self, square: Fraction) -> Fraction | None:
        """Return a bound of the error for a squared angle in rad^2; None where the terms do not shrink at once.

        It is the length of a quaternion, or the largest singular value of a matrix.
        """
        # A power of a length that is rounded up: its root is rational again.
        x = self.scale * Fraction(math.isqrt(math.ceil(square * 4**_ROOT_BITS)) + bool(square), 2**_ROOT_BITS)
        if x >= self.order + 2:
            return None
        # The terms that follow shrink at least as fast as a geometric series.
        first = x ** (self.order + 1) / math.factorial(self.order + 1)
        return first / (1 - x / (self.order + 2))


@dataclass(frozen=True)
class AttitudeStep:
    """The kernels and properties of an attitude step that a back end needs in addition to the step itself.

    Parameters
    ----------
    product : str or None
        Kernel that multiplies a state by a transition, and one transition by the next; None for a step that is not
        linear in the state.
    orthonormalize : str or None
        Kernel that restores the norm or the orthogonality of the state; None if nothing has to be restored.
    attitude : str or None
        Kernel that converts the state to a direction cosine matrix; None if the state is one.
    identity : tuple of Fraction
        The state of zero rotation, row-major.
    previous : int
        Number of increments from before the step that it takes in addition to its own.
    isometry : bool
        Whether the exact transition, with what a series leaves out, is a rotation for any increments.
    ahead : int
        Number of increments from after the step that it takes in addition to its own.
    truncation : Truncation or None
        What the transition leaves out of a series; None where it is the exponential itself, or a method of its own.
    nodes : tuple of Fraction
        Of a user's step that takes the rate at nodes, these as fractions of the step; empty for one that takes
        increments.
    """

    product: str | None
    orthonormalize: str | None
    attitude: str | None
    identity: tuple[Fraction, ...]
    previous: int = 0
    isometry: bool = False
    ahead: int = 0
    truncation: Truncation | None = None
    nodes: tuple[Fraction, ...] = ()

    __repr__ = short_repr

    @property
    def beside(self) -> int:
        """Number of increments that the step takes in addition to its own."""
        return self.previous + self.ahead


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
