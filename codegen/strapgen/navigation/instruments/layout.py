"""Reads files that describe a layout: the torquer axes of three gyros, their mass unbalances and a sign."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple

from strapgen.catalogue import coefficients
from strapgen.catalogue.coefficients import Number
from strapgen.catalogue.methods.coefficient_files import Source, Title, slug
from strapgen.catalogue.toml_models import Key, UserFile, algebraic, refused
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

#: A multiple of a symbol, which stands once: after a product and before a quotient, if they are there.
_MULTIPLE = re.compile(r"(.*\*|[ +-]*)\s*(?P<symbol>B[0-9]?)\s*(/.*)?")


@dataclass(frozen=True)
class Unbalance:
    """A mass unbalance in rad/s per m/s^2: a multiple of a symbol, or a number where the symbol is empty."""

    factor: Number
    symbol: str = ""

    WORDS: ClassVar = 'a number, or a multiple of B or of B0 to B9, such as "-B" or "B2/3",'
    SCHEMA: ClassVar = {"type": ["number", "string"]}

    @classmethod
    def from_toml(cls, where: str, value: Any) -> Unbalance:
        """Return the unbalance of an entry."""
        match = _MULTIPLE.fullmatch(value) if isinstance(value, str) else None
        if match is None:
            try:
                return cls(algebraic(where, value))
            except InputError as error:
                raise InputError(f"{error}; {cls.WORDS} is needed") from None
        start, end = match.span("symbol")
        at_zero, factor = (algebraic(where, f"{value[:start]}{x}{value[end:]}") for x in "01")
        if at_zero != 0:
            raise refused(where, value, f"{cls.WORDS} without a sum")
        return cls(factor, match["symbol"] if factor != 0 else "")


class GyroDescription(NamedTuple):
    """Torquer axes in body axes, the angle in deg by which both are turned about the spin axis, and an unbalance."""

    x: tuple[Number, ...]
    y: tuple[Number, ...]
    turn_deg: Fraction
    unbalance: Unbalance


@dataclass(frozen=True)
class Layout:
    """Three gyros with torquer axes and mass unbalances, as a file describes them."""

    #: Name in those of kernels, name in the file, where the layout comes from
    name: str
    title: str
    source: str
    #: s of M = W + s B A: 1 or -1
    sign: int
    #: Axes as exact numbers in body axes
    gyros: tuple[GyroDescription, ...]
    #: Path of the file
    file: str = field(default="", compare=False, repr=False)

    @property
    def option(self) -> str:
        """The option that chooses it on the command line."""
        return f"--layout {shlex.quote(self.file)}"


Axis = tuple[Number, Number, Number]


@dataclass(frozen=True)
class GyroFile:
    """A gyro of two torquer axes x and y, of length 1 and perpendicular, and its spin axis x cross y."""

    x: Annotated[Axis, Key("Torquer axis in body axes", "1")]
    unbalance: Annotated[
        Unbalance, Key("Mass unbalance: a number, or a multiple of a symbol", "rad/s per m/s^2")
    ]
    y: Annotated[Axis | None, Key("The other torquer axis", "1")] = None
    spin: Annotated[Axis | None, Key("The spin axis, in place of y", "1")] = None
    turn_deg: Annotated[
        Fraction, Key("Angle by which the torquer axes are turned about the spin axis", "deg")
    ] = Fraction(0)

    def __post_init__(self) -> None:
        if (self.y is None) == (self.spin is None):
            raise InputError(
                f"{'neither y nor spin is' if self.y is None else 'y and spin are'} there; one is needed"
            )
        for name in ("x", "y", "spin"):
            axis = getattr(self, name)
            if axis is not None and (square := _dot(axis, axis)) != 1:
                raise InputError(
                    f"{name} is [{', '.join(map(str, axis))}], of length sqrt({square}); length 1 is needed"
                )
        if _dot(self.x, self._other) != 0:
            raise InputError(
                f"x and {'spin' if self.y is None else 'y'} are not perpendicular, as they must be"
            )

    @property
    def _other(self) -> Axis:
        axis = self.spin if self.y is None else self.y
        assert axis is not None, "one of them is there"
        return axis

    def description(self) -> GyroDescription:
        """Return the gyro with both torquer axes."""
        y = self._other if self.spin is None else _cross(self.spin, self.x)
        return GyroDescription(self.x, y, self.turn_deg, self.unbalance)


@dataclass(frozen=True)
class LayoutFile:
    """Three gyros with torquer axes and mass unbalances."""

    name: Title
    source: Source
    sign: Annotated[
        int, Key("s of the measurement M = W + s B A of rate W and acceleration A", choices=(1, -1))
    ]
    gyros: Annotated[tuple[GyroFile, GyroFile, GyroFile], Key("The gyros")]


LAYOUT = UserFile("a layout", LayoutFile, 20_000)


def read(path: str | Path) -> Layout:
    """Read a layout from a file and check its axes exactly."""

    def layout(file: LayoutFile) -> Layout:
        name, gyros = slug(file.name), tuple(one.description() for one in file.gyros)
        return Layout(
            name, file.name, file.source, file.sign, gyros, checks.text("the name of the file", str(path))
        )

    return LAYOUT.convert(path, layout)


def _dot(a: Axis, b: Axis) -> Number:
    return _total(zip(a, b, strict=True))


def _total(products: Any) -> Number:
    """Return the sum of products of two numbers, exactly."""
    terms = [f"({one})*({other})" for one, other in products]
    return coefficients.number("product", "+".join(terms))


def _cross(a: Axis, b: Axis) -> Axis:
    """Return the cross product of two vectors."""
    x, y, z = (
        _total([(a[(i + 1) % 3], b[(i + 2) % 3]), (-a[(i + 2) % 3], b[(i + 1) % 3])]) for i in range(3)
    )
    return x, y, z
