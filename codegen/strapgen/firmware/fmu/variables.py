"""The variables of a unit for co-simulation: names, types, shapes, units and start values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from strapgen.ir.exceptions import InputError
from strapgen.ir.interfaces import Argument
from strapgen.ir.signals import Signal
from strapgen.ir.sources import Sources
from strapgen.targets.c_numbers import types_of
from strapgen.targets.contract import argument_text, range_text

#: Units as powers of the base units of FMI. A unit that is not among them has its name alone.
UNITS = {
    "s": {"s": 1},
    "rad": {"rad": 1},
    "rad/s": {"rad": 1, "s": -1},
    "m": {"m": 1},
    "m/s": {"m": 1, "s": -1},
    "m/s^2": {"m": 1, "s": -2},
}
#: How far the squares of lengths may be from 1 where an attitude is needed.
TOLERANCE = Fraction(1, 100)
#: The type in C of a value by its name, and its format in fixed point.
Types = Mapping[str, tuple[str, Argument | None]]


def types(*parts: Sources) -> Types:
    """Return the types of the inputs and outputs of functions."""
    found: dict[str, tuple[str, Argument | None]] = {}
    for part in parts:
        fixed = () if part.fixed is None else (*part.fixed.inputs, *part.fixed.outputs)
        arguments = {argument.signal.name: argument for argument in fixed}
        found |= {name: (kind, arguments.get(name)) for name, kind in types_of(part).items()}
    return found


@dataclass(frozen=True)
class Variable:
    """A variable of a unit; in FMI 2 its elements are variables of their own."""

    name: str
    #: independent, parameter, input or output
    role: str
    #: Type of an element in C
    type: str
    shape: tuple[int, ...]
    meaning: str
    #: "" where it has none, as counts and pure numbers
    unit: str = ""
    #: Elements before the first step; empty for an output
    start: tuple[int | float, ...] = ()
    #: Names of the elements, where they have some
    elements: tuple[str, ...] = ()
    #: Member of the struct in C, and place of an element in it
    member: str = ""
    place: int = 0
    #: "unit" or "rotation" where a start must be one, and the value of 1 in memory
    constraint: str = ""
    scale: Fraction = Fraction(1)

    @property
    def tolerance(self) -> float:
        """How far from 1 lengths of rows may be at the start; rounding to integers is within it."""
        return float(TOLERANCE + (4 * self.scale if self.scale < 1 else 0))

    @property
    def size(self) -> int:
        """Number of elements."""
        return math.prod(self.shape)

    def scalar(self, place: int) -> Variable:
        """Return an element as a variable, whose name has its indices by rows.

        >>> Variable("matrix", "output", "double", (2, 3), "").scalar(4).name
        'matrix[2,2]'
        """
        rest, indices = place, []
        for size in reversed(self.shape):
            rest, index = divmod(rest, size)
            indices.append(str(index + 1))
        name = f"{self.name}[{','.join(reversed(indices))}]" if indices else self.name
        meaning = ": ".join([*self.elements[place : place + 1], self.meaning])
        start = self.start[place : place + 1]
        return replace(self, name=name, shape=(), meaning=meaning, start=start, place=place)


class Variables(list[Variable]):
    """The variables of a unit, which begin with its time."""

    def __init__(self, types: Types, step: Fraction | None, begin: float) -> None:
        self.types = types
        super().__init__([Variable("time", "independent", "double", (), "time", "s", member="time")])
        if step is None:
            meaning = "communication step, over which the inputs are increments; another one is an error"
            self.own("step_size", "double", begin, meaning, "s")

    def own(self, name: str, kind: str, start: float, meaning: str, unit: str = "") -> None:
        """Add a parameter of the unit itself, which is greater than zero."""
        self.append(Variable(name, "parameter", kind, (), meaning, unit, (start,), member=name))

    def add(self, role: str, signal: Signal, start: Sequence[Fraction] = (), **other: Any) -> None:
        """Add the variable of a signal, by default at zero; integers say in words what they stand for."""
        kind, argument = self.types[signal.name]
        about = range_text(signal) if argument is None else argument_text(argument)
        unit = "" if argument is not None or signal.unit == "1" else signal.unit
        name = other.pop("name", signal.name)
        if name in {variable.name for variable in self}:
            raise InputError(f"an FMU has a variable {name} of its own; the algorithm has one too")
        variable = Variable(name, role, kind, signal.shape, f"{signal.meaning or signal.name}; {about}", unit)
        variable = replace(variable, member=name, elements=signal.elements, **other)
        if role != "output":
            values = start or (Fraction(0),) * variable.size
            begin = tuple(float(v) if argument is None else argument.format.nearest(v) for v in values)
            variable = replace(variable, start=begin)
            if start and signal.constraint in ("unit", "rotation"):
                scale = Fraction(1) if argument is None else argument.unit
                variable = replace(variable, constraint=signal.constraint, scale=scale)
        self.append(variable)
