"""Metadata of a kernel, which all stages keep: names, source, orders, recursion, kernels of an attitude step."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from fractions import Fraction
from typing import Any, NamedTuple, Protocol

from strapgen.ir.notebook_display import short_repr
from strapgen.ir.renamed import renamed


@dataclass(frozen=True)
class KernelInfo:
    """The names, source, orders and recursion of a kernel: the `info` of the kernel, its programs and its sources.

    Parameters
    ----------
    name : str
        Name on the command line, lower case with hyphens.
    title : str
        One line that says what it computes.
    source : str
        Where the algorithm comes from, with the equation's number.
    arguments : str
        Name and options on the command line; by default the name alone. A whole command, such as
        ``strapgen redundancy FILE``, where another than ``strapgen generate`` generates it.
    notes : tuple of str
        Remarks for the reader of generated code: domain, conventions.
    attitude_step : AttitudeStep or None
        The kernels of an attitude step; None for every other kernel.
    order : Order or None
        Order of an attitude step.
    recursion : Recursion or None
        The pairs of an output and the input that it becomes in the next call.

    Examples
    --------
    >>> from strapgen import algorithm
    >>> algorithm("euler").program().info.name
    'euler-rk4-2'
    """

    name: str
    title: str
    source: str
    _: KW_ONLY
    arguments: str = ""
    notes: tuple[str, ...] = ()
    attitude_step: AttitudeStep | None = None
    order: Order | None = None
    recursion: Recursion | None = None

    __repr__ = short_repr

    @property
    def identifier(self) -> str:
        """The name in generated code."""
        return self.name.replace("-", "_")


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


@renamed(beside="extra_increments")
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

    Examples
    --------
    >>> from strapgen import derive
    >>> derive("euler").attitude_step.orthonormalize
    'euler-normalize'
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
    def extra_increments(self) -> int:
        """Number of increments before and after the step that it also takes."""
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


@renamed(kept="retained", begun_anew="reset")
@dataclass(frozen=True)
class Recursion:
    """The feedback pairs of a kernel: the values that it carries from call to call.

    Parameters
    ----------
    states : tuple of (str, str)
        Pairs of names: an input, and the output that takes its place in the next call.
    retained : tuple of str
        Inputs of these pairs that continue over the end of a cycle of the slower loop; the others are reset to zero.

    Examples
    --------
    >>> Recursion((("sum", "next_sum"), ("previous", "next_previous")), retained=("previous",)).reset
    ('sum',)
    """

    states: tuple[tuple[str, str], ...]
    retained: tuple[str, ...] = ()

    __repr__ = short_repr

    @property
    def reset(self) -> tuple[str, ...]:
        """The inputs that are reset to zero at the start of each cycle of the slower loop."""
        return tuple(name for name, _ in self.states if name not in self.retained)

    @property
    def inputs(self) -> dict[str, str]:
        """The input that each output becomes in the next call, by the name of the output."""
        return {output: name for name, output in self.states}


class Description(Protocol):
    """The description of a kernel in a file: a frozen dataclass with a name, a title and the path of the file."""

    @property
    def name(self) -> str:
        """Name in that of the kernel."""

    @property
    def title(self) -> str:
        """Name in the file."""

    @property
    def file(self) -> str:
        """Path of the file."""


class Recipe(NamedTuple):
    """A kernel that takes no method: the module, the function and its arguments that derive it.

    A kernel of a description in a file has a `reader`, "module:function", which returns what the file describes, a
    `Description`. It is the only argument of the function.
    """

    title: str
    module: str
    function: str
    arguments: tuple[Any, ...] = ()
    standard: bool = True
    reader: str = ""
