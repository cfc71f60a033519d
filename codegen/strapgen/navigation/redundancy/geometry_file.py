"""Reads the geometry of redundant sensors from a TOML file, and returns all its kernels."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Annotated

from strapgen.catalogue import toml_models
from strapgen.catalogue.toml_models import Key, UserFile
from strapgen.ir import checks
from strapgen.kernel.kernel import Kernel
from strapgen.navigation.redundancy import failure_selection, parity_equations
from strapgen.navigation.redundancy.geometry import Axes, of_rows
from strapgen.navigation.redundancy.parity_equations import KINDS, SensorSet

_NAME = Key(
    "Ending of the names of kernels; by default that of the file",
    pattern="[a-z][a-z0-9]{0,7}",
    form="at most eight small letters and digits, a letter first,",
)


@dataclass(frozen=True)
class GeometryFile:
    """Redundant sensors: their axes, their kind, and what they measure."""

    axes: Axes
    name: Annotated[str, _NAME] = ""
    sensor: Annotated[str, Key("Kind of the sensors", choices=tuple(KINDS))] = "gyro"
    range: Annotated[
        Fraction | None,
        Key("Largest increment of a cycle; by default 1/8 rad or 4 m/s", "rad or m/s", above=0),
    ] = None


GEOMETRY = UserFile("a geometry", GeometryFile, 1 << 16)


def read(path: str | Path) -> SensorSet:
    """Read the geometry of sensors; a row of axes is read as by `geometry`."""
    place = checks.path("path", path)
    stem = re.sub(r"[^a-z0-9]", "", place.stem.lower())[:8]

    def sensors(file: GeometryFile) -> SensorSet:
        largest = file.range or (Fraction(1, 8) if file.sensor == "gyro" else Fraction(4))
        name = file.name or toml_models.parse(Annotated[str, _NAME], stem, "name")
        command = f"strapgen redundancy {shlex.quote(place.as_posix())}"
        return SensorSet(name, of_rows(file.axes), file.sensor, largest, command)

    return GEOMETRY.convert(path, sensors)


def kernels(sensors: SensorSet) -> Iterator[Kernel]:
    """Yield the kernels of a set of sensors: parity, its bias, the selection, all sensors, and each triad."""
    yield parity_equations.parity(sensors)
    yield parity_equations.parity_rest(sensors)
    yield failure_selection.select(sensors)
    yield parity_equations.all_sensors(sensors)
    for number in range(len(sensors.geometry.triads)):
        yield parity_equations.triad(number, sensors)
