"""Messages of many types one after the other in a file, each with numbers at fixed places."""

from __future__ import annotations

import mmap
from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import units
from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings.log_topic import LogColumn, LogTopic
from strapgen.lab.recordings.long_columns import PART, Columns

Array = NDArray[Any]


@dataclass(frozen=True)
class Field:
    """A number in a message: where it begins, how it is stored, its unit, and the factor to that unit."""

    name: str
    offset: int
    kind: str
    unit: str | None = None
    factor: float = 1.0


@dataclass
class Messages:
    """Messages of one topic: their type, their fields, and where each begins in the file."""

    message: str
    fields: Sequence[Field]
    starts: array[int] = field(default_factory=lambda: array("q"))

    def size(self) -> int:
        """Return the bytes of a message."""
        return max((f.offset + np.dtype(f.kind).itemsize for f in self.fields), default=0)


class MessageLog:
    """A file of messages, by topic."""

    format = ""
    remarks: tuple[str, ...] = ()

    def __init__(self, path: Path) -> None:
        self.path = path
        self._data: Any = mapped(path)
        self._messages: dict[str, Messages] = {}
        self.remarks = tuple(self.scan(self._data))
        self._messages = {name: of for name, of in self._messages.items() if len(of.starts)}
        self._bytes = np.frombuffer(self._data, np.uint8)
        self.topics: tuple[LogTopic, ...] = tuple(
            LogTopic(name, tuple(LogColumn(f.name, f.unit) for f in of.fields), len(of.starts), of.message)
            for name, of in sorted(self._messages.items())
        )

    def scan(self, data: Any) -> Iterable[str]:
        """Note where the messages begin; yield remarks."""
        raise NotImplementedError

    def read(self, topic: str, columns: Sequence[str]) -> dict[str, Array]:
        """Return columns of a topic by name."""
        messages = self._messages[topic]
        fields = {f.name: f for f in messages.fields}
        starts = np.frombuffer(messages.starts, np.int64) if messages.starts else np.zeros(0, np.int64)
        return {name: self._column(starts, fields[name]) for name in columns}

    def _column(self, starts: Array, of: Field) -> Array:
        kind = np.dtype(of.kind)
        column = Columns(1, np.int64 if kind.kind in "biu" and of.factor == 1 else np.float64)
        for first in range(0, len(starts), PART):
            places = (starts[first : first + PART] + of.offset)[:, None] + np.arange(kind.itemsize)
            numbers = self._bytes[places].view(kind)[:, 0]
            column.append(numbers.astype(np.int64) if column.is_integer else numbers * of.factor)
        return column.array()[:, 0]

    def place(self, topic: str, row: int) -> str:
        """Return the number of a message of its topic, from 1 on."""
        return f"message {row + 1}"


def mapped(path: Path) -> Any:
    """Return the bytes of a file."""
    try:
        with path.open("rb") as file:
            return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read ({getattr(error, 'strerror', None) or error})") from None


def stated(unit: str | None) -> str | None:
    """Return a unit in the spelling of `units`."""
    return units.spelled(unit) if unit else None


def known_units(table: Mapping[str, Mapping[str, str]], message: str, name: str) -> str | None:
    """Return the unit that the definition of a message gives a field, whose index does not matter."""
    return table.get(message, {}).get(name.split("[")[0]) or table.get("", {}).get(name)
