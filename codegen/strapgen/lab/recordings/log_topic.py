"""What a log file says of the tables in it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from strapgen.ir import units


@dataclass(frozen=True)
class LogColumn:
    """A column of numbers: its name, and its unit as the file states it, in the spelling of `ir.units`."""

    name: str
    unit: str | None = None


@dataclass(frozen=True)
class LogTopic:
    """A table: one of several, or the only one, whose name is empty."""

    name: str
    columns: tuple[LogColumn, ...]
    #: None where it is not known without reading
    rows: int | None
    #: The type of its messages: "sensor_combined", "sensor_msgs/msg/Imu", "IMU", "HIGHRES_IMU"
    message: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(column.name for column in self.columns)


def unit_of(name: str, stated: str = "") -> str | None:
    """Return the unit that is stated, or that stands in brackets behind a name."""
    match = re.fullmatch(r".*[\[(]([^\])]*)[\])]\s*", name)
    text = stated.strip("[]() ") or ("" if match is None or match[1].strip().isdigit() else match[1])
    return units.spelled(text) if text else None


def split_topic(text: str) -> tuple[Path, str]:
    """Return the file and the topic of FILE or FILE:TOPIC; the topic is empty where a file has the whole name."""
    path, (name, colon, topic) = Path(text), text.rpartition(":")
    return (Path(name), topic) if colon and not path.exists() and Path(name).exists() else (path, "")
