"""Reads files that describe a layout: the torquer axes of three gyros, their mass unbalances and a sign."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from strapgen.catalogue import toml_files
from strapgen.catalogue.methods import coefficient_files, coefficients
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.catalogue.methods.coefficients import Number

#: Keys of a file and of a gyro in it.
KEYS = ("name", "source", "sign", "gyros")
GYRO_KEYS = ("x", "y", "spin", "turn_deg", "unbalance")
#: A longer file is refused.
MOST_BYTES = 20_000
GYROS = 3

#: A multiple of a symbol, which stands once: after a product and before a quotient, if they are there.
_MULTIPLE = re.compile(r"(.*\*|[ +-]*)\s*(?P<symbol>B[0-9]?)\s*(/.*)?")


class Unbalance(NamedTuple):
    """A mass unbalance in rad/s per m/s^2: a multiple of a symbol, or a number where the symbol is empty."""

    factor: Number
    symbol: str = ""


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


def read(path: str | Path) -> Layout:
    """Read a layout from a file and check its axes exactly.

    `path`: a TOML file with the keys `KEYS` and three tables ``[[gyros]]`` with keys of `GYRO_KEYS`. Every
    number is a whole number or a string, see `coefficients.number`. An axis has three, in body axes. A gyro has
    its torquer axis ``x`` and either ``y`` or its ``spin`` axis, x cross y; ``turn_deg``, by default 0, turns
    both torquer axes about the spin axis by an angle in deg. The unbalance is a number in rad/s per m/s^2 or a
    multiple of a symbol, such as ``"-B"`` or ``"B2/3"``.
    """
    data = toml_files.content(path, "a layout", MOST_BYTES)
    try:
        coefficient_files.check_keys(data, KEYS, ())
        tables = coefficient_files.entries("gyros", data["gyros"])
        if len(tables) != GYROS:
            raise InputError(f"the layout has {len(tables)} gyros; three are needed")
        sign = data["sign"]
        if isinstance(sign, bool) or sign not in (-1, 1):
            raise InputError(f"sign is {sign!r}; 1 or -1 is needed, s of M = W + s B A")
        gyros = tuple(_gyro(f"gyro {number}", table) for number, table in enumerate(tables, 1))
        name = coefficient_files.slug(data["name"])
        layout = Layout(name, data["name"], data["source"], int(sign), gyros)
        return replace(layout, file=checks.text("the name of the file", str(path)))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _gyro(what: str, table: Any) -> GyroDescription:
    """Return the gyro of a table."""
    if not isinstance(table, dict):
        raise InputError(f"{what} is of type {type(table).__name__}; a table is needed")
    try:
        coefficient_files.check_keys(table, GYRO_KEYS, ("y", "spin", "turn_deg"))
    except InputError as error:
        raise InputError(f"{what}: {error}") from None
    if ("y" in table) == ("spin" in table):
        present = "both y and spin" if "y" in table else "neither y nor spin"
        raise InputError(f"{what} has {present}; one of them is needed")
    second = "y" if "y" in table else "spin"
    x, other = (_axis(f"{what}: axis {key}", table[key]) for key in ("x", second))
    if _total(zip(x, other, strict=True)) != 0:
        raise InputError(f"{what}: axes x and {second} are not perpendicular, as they must be")
    y = other if second == "y" else _cross(other, x)
    turn = coefficients.number(f"{what}: turn_deg", table.get("turn_deg", 0))
    if not isinstance(turn, Fraction):
        raise InputError(f"{what}: turn_deg is {table['turn_deg']!r}; a rational number is needed")
    return GyroDescription(x, y, turn, _unbalance(f"{what}: unbalance", table["unbalance"]))


def _axis(what: str, value: Any) -> tuple[Number, ...]:
    """Return an axis of length 1."""
    elements = coefficient_files.entries(what, value)
    if len(elements) != 3:
        raise InputError(f"{what} has {len(elements)} elements; three are needed")
    axis = tuple(coefficients.number(what, element) for element in elements)
    square = _total(zip(axis, axis, strict=True))
    if square != 1:
        shown = ", ".join(map(str, elements))
        raise InputError(f"{what} is [{shown}], of length sqrt({square}); length 1 is needed")
    return axis


def _unbalance(what: str, value: Any) -> Unbalance:
    """Return a mass unbalance: a number, or a multiple of a symbol."""
    match = _MULTIPLE.fullmatch(value) if isinstance(value, str) else None
    if match is None:
        try:
            return Unbalance(coefficients.number(what, value))
        except InputError as error:
            raise InputError(f'{error}, or a multiple of B or of B0 to B9, such as "-B" or "B2/3"') from None
    start, end = match.span("symbol")
    at_zero, factor = (coefficients.number(what, f"{value[:start]}{x}{value[end:]}") for x in "01")
    if at_zero != 0:
        raise InputError(f"{what} is {value!r}; a number or a multiple of a symbol is needed, without a sum")
    return Unbalance(factor, match["symbol"] if factor != 0 else "")


def _total(products: Any) -> Number:
    """Return the sum of products of two numbers, exactly."""
    terms = [f"({one})*({other})" for one, other in products]
    return coefficients.number("product", "+".join(terms))


def _cross(a: tuple[Number, ...], b: tuple[Number, ...]) -> tuple[Number, ...]:
    """Return the cross product of two vectors."""
    return tuple(
        _total([(a[(i + 1) % 3], b[(i + 2) % 3]), (-a[(i + 2) % 3], b[(i + 1) % 3])]) for i in range(3)
    )
