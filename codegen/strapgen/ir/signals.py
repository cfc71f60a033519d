"""Signals are the typed inputs and outputs of kernels, programs and generated functions."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from fractions import Fraction
from typing import Any

from strapgen.ir import checks
from strapgen.ir.notebook_display import short_repr

#: Frames that the components of a signal can be in.
FRAMES = {
    "b": "body",
    "n": "navigation",
    "e": "earth-fixed",
    "i": "inertial",
    "g": "geographic: north, east and down",
}

#: What stands for the unit or the frame of a signal that takes those of whatever is wired to it.
ANY = "any"

#: The value of `Signal.over` of an increment.
CYCLE = "cycle"


@dataclass(frozen=True)
class Signal:
    """A named array with a shape, a unit, a frame and a range.

    Parameters
    ----------
    name : str
        Name of the argument in generated code.
    shape : tuple of int
        Shape of one sample; () for a scalar.
    elements : tuple of str
        Name of every element, in row-major order.
    unit : str
        Unit, "1" for a pure number; "any" for that of the signal that is wired to it, which all signals of a kernel
        with the unit "any" share.
    meaning : str
        Description in the terms of the field, with the frame.
    bound : Fraction or None
        Largest magnitude of an element in proper use; None if the algorithm sets no limit.
    constraint : str
        Relation between the elements in proper use: "unit" (a vector of length 1), "rotation" (a rotation
        matrix), "covariance" (a triangle of one, which fixed point does not take), or "" if there is none.
    frame : str
        Frame of the components, a key of `FRAMES`; of an attitude "b to n", which turns components in the first frame
        into those in the second; "any" as for the unit; "" for scalars and for what has no frame.
    over : str
        "cycle" for an increment: a change over the cycle of the stage that the signal is part of, which must not be
        sampled at another rate. "" for a value at an instant; a sum that a slower stage resets is one.
    limit : Fraction or None
        Largest magnitude of an element that code in floating point takes, where a user has declared one.

    Raises
    ------
    ValueError
        If the shape does not have as many elements as are named.
    InputError
        If the frame is not known, or `over` is neither "cycle" nor "".

    Examples
    --------
    >>> Signal.vector("rate", "w", unit="rad/s", meaning="body rate").elements
    ('w_x', 'w_y', 'w_z')
    """

    name: str
    shape: tuple[int, ...]
    elements: tuple[str, ...]
    unit: str = "1"
    meaning: str = ""
    bound: Fraction | None = None
    constraint: str = ""
    frame: str = ""
    over: str = ""
    limit: Fraction | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        if math.prod(self.shape) != len(self.elements):
            raise ValueError(f"signal {self.name!r}: shape {self.shape} with {len(self.elements)} elements")
        if not set(self.frame.split(" to ", maxsplit=1)) <= set(FRAMES) and self.frame not in ("", ANY):
            checks.choice(f"frame of {self.name}", self.frame, [*FRAMES, ANY], "an attitude such as 'b to n'")
        if self.over:
            checks.choice(f"over of {self.name}", self.over, [CYCLE], "nothing")

    @classmethod
    def labelled(cls, name: str, prefix: str, labels: Iterable[str], **rest: Any) -> Signal:
        """Return a one-dimensional signal whose elements are named ``prefix_label`` for each of `labels`."""
        elements = tuple(f"{prefix}_{label}" for label in labels)
        return cls(name, (len(elements),), elements, **rest)

    @classmethod
    def scalar(cls, name: str, **rest: Any) -> Signal:
        """Return a scalar signal."""
        return cls(name, (), (name,), **rest)

    @classmethod
    def vector(cls, name: str, prefix: str, **rest: Any) -> Signal:
        """Return a 3-vector with elements x, y, z."""
        return cls.labelled(name, prefix, "xyz", **rest)

    @classmethod
    def matrix(cls, name: str, prefix: str, **rest: Any) -> Signal:
        """Return a 3 x 3 matrix with elements 11 to 33."""
        elements = tuple(f"{prefix}_{row}{column}" for row in "123" for column in "123")
        return cls(name, (3, 3), elements, **rest)

    @property
    def size(self) -> int:
        """Number of elements."""
        return len(self.elements)

    @property
    def is_angle_increment(self) -> bool:
        """Whether it is the measurement of a gyro: an angle increment of the cycle in body axes."""
        return (self.unit, self.frame, self.over) == ("rad", "b", CYCLE)

    @property
    def identity(self) -> tuple[Fraction, ...] | None:
        """The elements for no rotation; None for what is no attitude with the labels of one.

        Examples
        --------
        >>> parameters = Signal.labelled("state", "a", "sxyz", constraint="unit")
        >>> list(map(str, parameters.identity)), Signal.vector("row", "r", constraint="unit").identity
        (['1', '0', '0', '0'], None)
        """
        if self.constraint == "rotation" and self.shape == (3, 3):
            return tuple(Fraction(k % 4 == 0) for k in range(9))
        labels = [element.rpartition("_")[2] for element in self.elements]
        if self.constraint == "unit" and sorted(labels) == ["s", "x", "y", "z"]:
            return tuple(Fraction(label == "s") for label in labels)
        return None

    def as_dict(self) -> dict[str, Any]:
        """Return the signal as plain JSON data."""
        limit = {} if self.limit is None else {"limit": str(self.limit)}
        data = asdict(self) | {"bound": None if self.bound is None else str(self.bound)}
        return {name: value for name, value in data.items() if name != "limit"} | limit


def after(signal: Signal) -> Signal:
    """Return the signal of a state after a call, whose names begin with ``next_``.

    >>> after(Signal.vector("sum", "s")).elements
    ('next_s_x', 'next_s_y', 'next_s_z')
    """
    return replace(
        signal,
        name=f"next_{signal.name}",
        elements=tuple(f"next_{element}" for element in signal.elements),
        meaning=f"{signal.meaning.partition(';')[0]}, after the call",
    )
