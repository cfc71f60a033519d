"""Reads a scheme of positions, and what was measured in them, from a TOML file."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import sympy as sp

from strapgen.catalogue.coefficients import Number
from strapgen.catalogue.toml_models import Key, UserFile
from strapgen.ir.exceptions import InputError
from strapgen.navigation.calibration.calibration import QUANTITIES, Scheme

#: Units of the quantities, as keys end.
UNITS = {"rate": "deg_h", "acceleration": "micro_g"}
#: By how much the length of a position may differ from 1.
_LENGTH = 1e-6

Rows = tuple[tuple[float, float, float], ...]


@dataclass(frozen=True)
class PositionsFile:
    """Positions of a unit at rest, and what was measured in them."""

    positions: Annotated[
        tuple[tuple[Number, Number, Number], ...],
        Key("Specific force in body axes, of length 1", "g", least=1, most=2000),
    ]
    name: Annotated[str, Key("Name of the scheme; by default that of the file")] = ""
    rate_sigma_deg_h: Annotated[float, Key("Standard deviation of a measured rate", "deg/h", above=0)] = 1.0
    acceleration_sigma_micro_g: Annotated[
        float, Key("Standard deviation of a measured acceleration", "micro-g", above=0)
    ] = 1.0
    rate_errors_deg_h: Annotated[
        Rows | None, Key("Error of the rate in each position, indicated less true", "deg/h")
    ] = None
    acceleration_errors_micro_g: Annotated[
        Rows | None, Key("Error of the acceleration in each position, indicated less true", "micro-g")
    ] = None

    def __post_init__(self) -> None:
        for number, position in enumerate(self.positions, 1):
            length = math.hypot(*map(float, position))
            if abs(length - 1) > _LENGTH:
                raise InputError(
                    f"positions[{number}] has the length {length:.6g}; 1 is needed, the unit of gravity"
                )
        for quantity, unit in UNITS.items():
            rows = getattr(self, key := f"{quantity}_errors_{unit}")
            if rows is not None and len(rows) != len(self.positions):
                raise InputError(
                    f"{key} has {len(rows)} rows; one for each of {len(self.positions)} positions is needed"
                )


@dataclass(frozen=True)
class CalibrationFile:
    """A scheme, the noise of its measurements, and the errors that were measured."""

    scheme: Scheme
    #: Standard deviation of a measurement by quantity, in `UNITS`
    sigma: dict[str, float]
    #: Rows of three errors, indicated less true, by quantity, in `UNITS`; of those that were measured
    errors: dict[str, Rows]


POSITIONS = UserFile("a scheme of positions", PositionsFile, 1 << 20)


def read(path: str | Path) -> CalibrationFile:
    """Read a scheme of positions."""
    file = POSITIONS.read(path)
    positions = tuple(tuple(map(sp.sympify, row)) for row in file.positions)
    sigma = {quantity: getattr(file, f"{quantity}_sigma_{unit}") for quantity, unit in UNITS.items()}
    errors = {quantity: getattr(file, f"{quantity}_errors_{UNITS[quantity]}") for quantity in QUANTITIES}
    stated = {quantity: rows for quantity, rows in errors.items() if rows is not None}
    return CalibrationFile(Scheme(file.name or Path(path).stem, positions), sigma, stated)
