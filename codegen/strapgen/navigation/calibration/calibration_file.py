"""Reads a scheme of positions, and what was measured in them, from a TOML file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import sympy as sp

from strapgen.catalogue import toml_files
from strapgen.catalogue.methods import coefficients
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.navigation.calibration.calibration import QUANTITIES, Scheme

_MOST_BYTES, _MOST_POSITIONS = 1 << 20, 2000
#: Units of the quantities, as keys end.
UNITS = {"rate": "deg_h", "acceleration": "micro_g"}
_KEYS = (
    "name",
    "positions",
    *(f"{quantity}_sigma_{unit}" for quantity, unit in UNITS.items()),
    *(f"{quantity}_errors_{unit}" for quantity, unit in UNITS.items()),
)
#: By how much the length of a position may differ from 1.
_LENGTH = 1e-6


@dataclass(frozen=True)
class CalibrationFile:
    """A scheme, the noise of its measurements, and the errors that were measured."""

    scheme: Scheme
    #: Standard deviation of a measurement by quantity, in `UNITS`; 1 where the file has none
    sigma: dict[str, float]
    #: Rows of three errors, indicated less true, by quantity, in `UNITS`; of those that were measured
    errors: dict[str, list[list[float]]]


def read(path: str | Path) -> CalibrationFile:
    """Read a scheme.

    `path`: a TOML file with ``positions``, rows of three exact numbers such as "sqrt(2)/2", the specific force
    in body axes in the unit of gravity; and, if need be, ``name``, ``rate_sigma_deg_h``,
    ``acceleration_sigma_micro_g``, ``rate_errors_deg_h`` and ``acceleration_errors_micro_g``.
    """
    data = toml_files.content(path, "a scheme of positions", _MOST_BYTES, parse_float=str)
    try:
        for key in data:
            checks.choice("key", key, _KEYS)
        positions = _positions(data.get("positions"))
        name = checks.text("name", data.get("name", Path(path).stem))
        sigma = {quantity: _sigma(data, f"{quantity}_sigma_{unit}") for quantity, unit in UNITS.items()}
        errors = {
            quantity: _errors(data, f"{quantity}_errors_{UNITS[quantity]}", len(positions))
            for quantity in QUANTITIES
            if f"{quantity}_errors_{UNITS[quantity]}" in data
        }
        return CalibrationFile(Scheme(name, positions), sigma, errors)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _positions(value: Any) -> tuple[tuple[sp.Expr, ...], ...]:
    """Return positions of length 1."""
    if not isinstance(value, list) or not value:
        raise InputError("positions are missing; rows of three exact numbers are needed")
    if len(value) > _MOST_POSITIONS:
        raise InputError(f"{len(value)} positions are there; at most {_MOST_POSITIONS} are allowed")
    rows = []
    for number, row in enumerate(value, 1):
        if not isinstance(row, list) or len(row) != 3:
            raise InputError(f"position {number} is {row!r}; three numbers are needed")
        elements = [sp.sympify(coefficients.number(f"position {number}", element)) for element in row]
        length = math.hypot(*map(float, elements))
        if abs(length - 1) > _LENGTH:
            raise InputError(
                f"position {number} has the length {length:.6g}; 1 is needed, the unit of gravity"
            )
        rows.append(tuple(elements))
    return tuple(rows)


def _sigma(data: Mapping[str, Any], key: str) -> float:
    return float(checks.number(key, data[key], positive=True)) if key in data else 1.0


def _errors(data: Mapping[str, Any], key: str, count: int) -> list[list[float]]:
    """Return the errors that were measured, a row for each position."""
    rows = data[key]
    if not isinstance(rows, list) or len(rows) != count:
        there = len(rows) if isinstance(rows, list) else 0
        raise InputError(f"{key} has {there} rows; one for each of {count} positions is needed")
    numbers = []
    for number, row in enumerate(rows, 1):
        if not isinstance(row, list) or len(row) != 3:
            raise InputError(f"{key}, row {number} is {row!r}; three numbers are needed")
        numbers.append([float(checks.number(f"{key}, row {number}", element)) for element in row])
    return numbers
