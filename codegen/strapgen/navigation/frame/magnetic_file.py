"""Reads the coefficients of a magnetic field from the text of the World Magnetic Model: degree, order, g, h, rates."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

from strapgen.catalogue.methods.coefficient_files import slug
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.storage import streams

#: The highest degree of a model: code grows with its square.
HIGHEST_DEGREE = 15
#: Characters that a file may have, and the largest coefficient in nT, and rate in nT a year.
_MOST_CHARACTERS, _LARGEST = 40_000, 100_000
#: The last lines of a file.
_END = re.compile(r"9+")


class Harmonic(NamedTuple):
    """Gauss coefficients of a degree and an order in nT, Schmidt semi-normalised, and their rates in nT a year."""

    g: Fraction
    h: Fraction
    g_rate: Fraction
    h_rate: Fraction


@dataclass(frozen=True)
class MagneticModel:
    """A magnetic field by its coefficients, as a file describes it."""

    #: Name in those of kernels, and in the file
    name: str
    title: str
    #: Time of the coefficients, in years
    epoch: Fraction
    #: By degree from 1 and order from 0
    harmonics: dict[tuple[int, int], Harmonic] = field(hash=False)
    #: Path of the file
    file: str = field(default="", compare=False, repr=False)

    @property
    def degree(self) -> int:
        """The highest degree."""
        return max(degree for degree, _ in self.harmonics)

    @property
    def option(self) -> str:
        """The option that chooses it on the command line."""
        return f"--field {shlex.quote(self.file)}"


def read(path: str | Path) -> MagneticModel:
    """Read a file of coefficients: a heading, and a row for each degree and order."""
    try:
        with streams.opened(checks.path("path", path)) as file:
            data = file.read(_MOST_CHARACTERS + 1)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from None
    try:
        if len(data) > _MOST_CHARACTERS:
            raise InputError(
                f"over {_MOST_CHARACTERS} bytes; coefficients to degree {HIGHEST_DEGREE} are shorter"
            )
        lines = enumerate(data.decode("ascii", "replace").splitlines(), 1)
        (_, heading), *rows = [(n, line.split()) for n, line in lines if line.strip()] or [(1, [])]
        if len(heading) < 2:
            raise InputError("line 1 is no heading; the epoch in years and the name of the model are needed")
        epoch, name = checks.number("line 1: epoch", heading[0]), slug(heading[1])
        harmonics = _harmonics([row for row in rows if not all(map(_END.fullmatch, row[1]))])
        return MagneticModel(name, heading[1], epoch, harmonics, str(path))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _harmonics(rows: list[tuple[int, list[str]]]) -> dict[tuple[int, int], Harmonic]:
    """Return the coefficients of rows with their numbers, all orders of each degree."""
    harmonics: dict[tuple[int, int], Harmonic] = {}
    places = ((n, m) for n in range(1, HIGHEST_DEGREE + 1) for m in range(n + 1))
    for number, words in rows:
        where = f"line {number}"
        place, values = _row(where, words)
        if place != (due := next(places, None)):
            shown = f"degree {due[0]}, order {due[1]}" if due else f"no degree above {HIGHEST_DEGREE}"
            raise InputError(f"{where} has degree {place[0]}, order {place[1]}; {shown} is next")
        harmonics[place] = values
    degree, order = next(reversed(harmonics), (0, 0))
    if degree != order or not degree:
        raise InputError(
            f"the last row has degree {degree}, order {order}; all orders of a degree are needed"
        )
    if not any(value for one in harmonics.values() for value in (one.g, one.h)):
        raise InputError("the coefficients are all 0")
    return harmonics


def _row(where: str, words: list[str]) -> tuple[tuple[int, int], Harmonic]:
    """Return degree and order of a row, and its coefficients."""
    if len(words) != 6:
        found = checks.counted(len(words), "entry", "entries")
        raise InputError(
            f"{where} has {found}; degree, order, g and h in nT, and their rates in nT a year are needed"
        )
    degree, order = (
        checks.whole(f"{where}: {name}", x) for name, x in zip(("degree", "order"), words, strict=False)
    )
    values = {n: checks.number(f"{where}: {n}", x) for n, x in zip(Harmonic._fields, words[2:], strict=True)}
    for name, value in values.items():
        if abs(value) > _LARGEST:
            raise InputError(
                f"{where}: {name} is {float(value):g}; at most {_LARGEST} in magnitude is allowed"
            )
        if value and not order and name.startswith("h"):
            raise InputError(f"{where}: {name} is {float(value):g}; of order 0 it is 0")
    return (degree, order), Harmonic(**values)
