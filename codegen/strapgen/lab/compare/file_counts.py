"""The gyro on whose counts all back ends run that are compared with generated files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    from strapgen.ir.fixed_settings import Settings


def counted(settings: Settings | None, files: Mapping[Path, Settings | None]) -> Settings | None:
    """Return settings with the gyro whose counts the files take: all back ends then run on its counts."""
    from strapgen.ir.fixed_settings import Settings

    gyros = {} if settings is None or settings.sensor is None else {settings.sensor: "the command"}
    for path, stated in files.items():
        if stated is not None and stated.sensor is not None:
            gyros.setdefault(stated.sensor, str(path))
    if len(gyros) > 1:
        both = " and ".join(f"{sensor.stated} of {place}" for sensor, place in gyros.items())
        raise InputError(f"{both} are different gyros; one run has the counts of one")
    counting = next((stated for stated in files.values() if stated and stated.sensor), None)
    if counting is None or (settings is not None and settings.sensor is not None):
        return settings
    return replace(settings or Settings(), sensor=counting.sensor, input_bits=counting.input_bits)
