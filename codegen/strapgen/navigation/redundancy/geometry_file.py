"""Reads the geometry of redundant sensors from a TOML file, and returns all its kernels."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from strapgen.catalogue import toml_files
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.kernel.kernel import Kernel
from strapgen.navigation.redundancy import failure_selection, parity_equations
from strapgen.navigation.redundancy.geometry import geometry
from strapgen.navigation.redundancy.parity_equations import KINDS, SensorSet

#: A longer file is refused.
_MOST_BYTES = 1 << 16
_KEYS = ("name", "sensor", "range", "axes")
_NAME = re.compile(r"[a-z][a-z0-9]{0,7}")


def read(path: str | Path) -> SensorSet:
    """Read a geometry.

    `path`: a TOML file with ``axes``, rows of three numbers each as `geometry` reads them, and if need be
    ``name``, ``sensor``, "gyro" or "accelerometer", and ``range``, the largest increment of a cycle in rad or
    m/s.
    """
    place = checks.path("path", path)
    tables = toml_files.content(path, "a geometry", _MOST_BYTES, str)
    try:
        sensors = _parsed(tables, re.sub(r"[^a-z0-9]", "", place.stem.lower())[:8])
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return replace(sensors, command=f"strapgen redundancy {shlex.quote(place.as_posix())}")


def _parsed(tables: dict[str, Any], name: str) -> SensorSet:
    for key in tables:
        checks.choice("key", key, _KEYS)
    if "axes" not in tables:
        raise InputError("the geometry has no axes; rows of three numbers are needed")
    name = str(tables.get("name", name))
    if not _NAME.fullmatch(name):
        raise InputError(
            f"the name is {name!r}; at most eight small letters and digits are needed, a letter first"
        )
    sensor = checks.choice("sensor", str(tables.get("sensor", "gyro")), KINDS)
    default = Fraction(1, 8) if sensor == "gyro" else Fraction(4)
    if isinstance(tables.get("range"), bool):
        raise InputError("range is true or false; a number is needed")
    largest = checks.number("range", tables.get("range", default), positive=True)
    return SensorSet(name, geometry(tables["axes"]), sensor, largest)


def kernels(sensors: SensorSet) -> Iterator[Kernel]:
    """Yield the kernels of a set of sensors: parity, its bias, the selection, all sensors, and each triad."""
    yield parity_equations.parity(sensors)
    yield parity_equations.parity_rest(sensors)
    yield failure_selection.select(sensors)
    yield parity_equations.all_sensors(sensors)
    for number in range(len(sensors.geometry.triads)):
        yield parity_equations.triad(number, sensors)
