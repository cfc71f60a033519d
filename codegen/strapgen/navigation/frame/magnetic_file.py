"""Reads the coefficients of a magnetic field from the text of the World Magnetic Model: degree, order, g, h, rates."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

from strapgen.catalogue.methods.coefficient_files import slug
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.storage import streams

#: The highest degree of a model: code grows with its square.
HIGHEST_DEGREE = 15
#: Characters that a file may have, and the largest coefficient in nT, and rate in nT a year.
_MOST_CHARACTERS, _LARGEST = 40_000, 100_000
#: Coefficients of a row by name.
_NAMES = ("g", "h", "rate of g", "rate of h")
_HEADER = "the epoch in years and the name of the model"
_ROW = "degree, order, g and h in nT, and their rates in nT a year"
#: The last lines of a file.
_END = re.compile(r"9+")


@dataclass(frozen=True)
class Harmonic:
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
    if len(data) > _MOST_CHARACTERS:
        raise InputError(
            f"{path} is over {_MOST_CHARACTERS} bytes long; coefficients to degree {HIGHEST_DEGREE} are shorter"
        )
    lines = [
        (number, line.split())
        for number, line in enumerate(data.decode("ascii", "replace").splitlines(), 1)
        if line.strip()
    ]
    rows = [row for row in lines[1:] if not all(map(_END.fullmatch, row[1]))]
    try:
        header = lines[0][1] if lines else []
        if len(header) < 2:
            raise InputError(f"line 1 is no heading; {_HEADER} are needed")
        epoch, title = checks.number("line 1: epoch", header[0]), header[1]
        name = slug(title)
        harmonics: dict[tuple[int, int], Harmonic] = {}
        order = ((n, m) for n in range(1, HIGHEST_DEGREE + 1) for m in range(n + 1))
        for number, words in rows:
            place, values = _row(f"line {number}", words)
            if place != (due := next(order, None)):
                shown = f"degree {due[0]}, order {due[1]}" if due else f"no degree above {HIGHEST_DEGREE}"
                raise InputError(f"line {number} has degree {place[0]}, order {place[1]}; {shown} is next")
            harmonics[place] = values
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    if not harmonics or (last := next(reversed(harmonics)))[0] != last[1]:
        ends = f"ends at degree {last[0]}, order {last[1]}" if harmonics else "has no coefficients"
        raise InputError(f"{path} {ends}; all orders of degree 1 and of each further degree are needed")
    if not any(value for one in harmonics.values() for value in (one.g, one.h)):
        raise InputError(f"{path} has coefficients that are all 0")
    return MagneticModel(name, title, epoch, harmonics, str(path))


def _row(where: str, words: list[str]) -> tuple[tuple[int, int], Harmonic]:
    """Return degree and order of a row, and its coefficients."""
    if len(words) != 6:
        raise InputError(f"{where} has {checks.counted(len(words), 'entry', 'entries')}; {_ROW} are needed")
    degree, order = (
        checks.whole(f"{where}: {name}", word) for name, word in zip(("degree", "order"), words, strict=False)
    )
    values = {
        name: checks.number(f"{where}: {name}", word) for name, word in zip(_NAMES, words[2:], strict=True)
    }
    for name, value in values.items():
        if abs(value) > _LARGEST:
            raise InputError(
                f"{where}: {name} is {float(value):g}; at most {_LARGEST} in magnitude is allowed"
            )
        if value and not order and "h" in name.split():
            raise InputError(f"{where}: {name} is {float(value):g}; of order 0 it is 0")
    return (degree, order), Harmonic(*values.values())
