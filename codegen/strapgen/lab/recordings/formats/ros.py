"""ROS bags and MCAP files: numbers at fixed places in messages of the same lengths are read together."""

from __future__ import annotations

import struct
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.lab.recordings.formats.extras import package, refusing
from strapgen.lab.recordings.log_topic import LogColumn, LogTopic
from strapgen.lab.recordings.long_columns import Columns

Array = NDArray[Any]

MAGICS = {b"#ROSBAG V2": "ros1", b"\x89MCAP0\r\n": "mcap", b"SQLite format 3": "ros2"}
_KINDS = {
    "bool": "u1",
    "byte": "u1",
    "char": "u1",
    "octet": "u1",
    **{f"int{8 * size}": f"i{size}" for size in (1, 2, 4, 8)},
    **{f"uint{8 * size}": f"u{size}" for size in (1, 2, 4, 8)},
    "float32": "f4",
    "float64": "f8",
}
_TIMES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
_TIME = "time"
#: Units by type and by the beginning of a name, from ROS's definitions of messages.
_UNITS = {
    "sensor_msgs/msg/Imu": {"angular_velocity.": "rad/s", "linear_acceleration.": "m/s^2"},
    "geometry_msgs/msg/TwistStamped": {"twist.angular.": "rad/s", "twist.linear.": "m/s"},
    "nav_msgs/msg/Odometry": {"twist.twist.angular.": "rad/s", "twist.twist.linear.": "m/s"},
}
#: Elements of an array up to which each is a column, and messages that are read together.
_MOST_ELEMENTS, _TOGETHER = 64, 1 << 12
#: Most bytes of a record.
_MOST_BYTES = 1 << 32
#: When a message came, a column of every topic.
_RECEIVED = "received"


@dataclass
class _Layout:
    """Where the numbers of a message stand, and what the lengths in it are on which that depends."""

    places: dict[str, tuple[int, str]] = field(default_factory=dict)
    lengths: list[tuple[int, int]] = field(default_factory=list)


class _Walk:
    """A walk over a serialized message."""

    def __init__(self, fields_of: Callable[[str], Any], data: bytes, is_cdr: bool) -> None:
        self._fields_of, self._data = fields_of, data
        self._order = ">" if is_cdr and not data[1] & 1 else "<"
        self._origin = self._position = 4 if is_cdr else 0
        #: Numbers stand at multiples of their size, in the second version of CDR of at most 4
        self._most = (4 if data[1] > 5 else 8) if is_cdr else 1
        self.layout = _Layout()

    def of(self, name: str) -> _Layout:
        """Return the layout of a message of a type."""
        self._struct(name, "")
        if self._position > len(self._data):
            raise ValueError("a message is shorter than its type")
        return self.layout

    def _align(self, size: int) -> None:
        size = min(size, self._most)
        self._position += (self._origin - self._position) % size

    def _struct(self, name: str, prefix: str, is_column: bool = True) -> None:
        for label, of in self._fields_of(name):
            self._field(of, f"{prefix}.{label}" if prefix else label, is_column)

    def _field(self, of: Any, name: str, is_column: bool = True) -> None:
        kind, what = int(of[0]), of[1]
        if kind == 2 and what in _TIMES:
            self._number(_TIME, name, is_column)
        elif kind == 2:
            self._struct(what, name, is_column)
        elif kind == 1 and what[0] in _KINDS:
            self._number(_KINDS[what[0]], name, is_column)
        elif kind == 1 and what[0] == "string":
            length = self._length()
            self._position += length
        elif kind == 1:
            raise ValueError(f"{what[0]} is no number")
        else:
            element, count = what
            if kind == 4:
                count = self._length()
            is_column = is_column and kind == 3 and count <= _MOST_ELEMENTS
            if int(element[0]) == 1 and element[1][0] in _KINDS and not is_column:
                size = int(_KINDS[element[1][0]][1])
                if count:
                    self._align(size)
                self._position += count * size
                return
            for index in range(count):
                self._field(element, f"{name}[{index}]", is_column)

    def _number(self, kind: str, name: str, is_column: bool) -> None:
        size = 8 if kind == _TIME else int(kind[1])
        self._align(4 if kind == _TIME else size)
        if is_column:
            self.layout.places[name] = self._position, kind if kind == _TIME else f"{self._order}{kind}"
        self._position += size

    def _length(self) -> int:
        self._align(4)
        (length,) = struct.unpack_from(f"{self._order}I", self._data, self._position)
        self.layout.lengths.append((self._position, length))
        self._position += 4
        if length > len(self._data):
            raise ValueError("a message is shorter than a text or list in it")
        return int(length)


@dataclass
class _Channel:
    """A topic: its type, how its messages are serialized, how many there are, and the first one."""

    kind: str
    is_cdr: bool
    count: int
    first: bytes = b""


class RosLog:
    """A bag or an MCAP file."""

    remarks: tuple[str, ...] = ()

    def __init__(self, path: Path, kind: str) -> None:
        self.path, self.format = path, kind
        package("rosbags.highlevel", "ROS bags")
        with refusing(path, "a bag"):
            source = _Mcap(path) if kind == "mcap" else _Bag(path)
            self._source: _Mcap | _Bag = source
            self.remarks = tuple(source.remarks)
            topics = []
            for name, channel in sorted(source.channels.items()):
                try:
                    columns = [*self._layout(channel, channel.first).places] if channel.count else []
                except (ValueError, KeyError, struct.error, IndexError, RecursionError):
                    columns = []  # as of texts and of types that the file does not define
                units = _UNITS.get(channel.kind, {})
                topics.append(
                    LogTopic(
                        name,
                        (
                            LogColumn(_RECEIVED, "ns"),
                            *(LogColumn(label, _unit(label, units)) for label in columns),
                        ),
                        channel.count,
                        channel.kind,
                    )
                )
            self.topics = tuple(topics)

    def _layout(self, channel: _Channel, data: bytes) -> _Layout:
        return _Walk(self._source.fields_of, data, channel.is_cdr).of(channel.kind)

    def read(self, topic: str, columns: Sequence[str]) -> dict[str, Array]:
        """Return columns of a topic by name; stamps are in ns."""
        stores = {name: Columns(1, np.int64) for name in columns}
        channel = self._source.channels[topic]
        with refusing(self.path, "a bag"):
            messages = self._source.messages(topic)
            while part := list(islice(messages, _TOGETHER)):
                for name, numbers in self._numbers(channel, part, columns).items():
                    stores[name].append(numbers)
        return {name: store.array()[:, 0] for name, store in stores.items()}

    def _numbers(
        self, channel: _Channel, part: list[tuple[int, bytes]], columns: Sequence[str]
    ) -> dict[str, Array]:
        data = np.frombuffer(b"".join(message for _, message in part), np.uint8)
        sizes = np.array([len(message) for _, message in part])
        starts = np.cumsum(sizes) - sizes
        result: dict[str, Array] = {}
        rest = np.arange(len(part))
        while len(rest):
            first = part[rest[0]][1]
            layout = self._layout(channel, first)
            alike = sizes[rest] == len(first)
            for place, length in layout.lengths:
                alike[alike] = _gather(data, starts[rest[alike]] + place, "<u4") == _swapped(
                    length, first, channel
                )
            rows, rest = rest[alike], rest[~alike]
            for name in columns:
                if name == _RECEIVED:
                    continue
                place, kind = layout.places[name]
                if kind == _TIME:
                    order = ">" if channel.is_cdr and not first[1] & 1 else "<"
                    seconds = _gather(data, starts[rows] + place, f"{order}i4").astype(np.int64)
                    numbers = seconds * 10**9 + _gather(data, starts[rows] + place + 4, f"{order}u4")
                else:
                    numbers = _gather(data, starts[rows] + place, kind)
                wide = np.int64 if np.issubdtype(numbers.dtype, np.integer) else np.float64
                result.setdefault(name, np.empty(len(part), wide))[rows] = numbers
        if _RECEIVED in columns:
            result[_RECEIVED] = np.array([time for time, _ in part], np.int64)
        return result

    def place(self, topic: str, row: int) -> str:
        """Return the number of a message of its topic, from 1 on."""
        return f"message {row + 1}"


def _gather(data: Array, starts: Array, kind: str) -> Array:
    size = np.dtype(kind).itemsize
    return data[starts[:, None] + np.arange(size)].view(kind)[:, 0]


def _swapped(length: int, data: bytes, channel: _Channel) -> int:
    """Return a length as it is in the bytes of a message, read with the lowest byte first."""
    is_big = channel.is_cdr and not data[1] & 1
    return int.from_bytes(length.to_bytes(4, "big" if is_big else "little"), "little")


def _unit(name: str, units: dict[str, str]) -> str | None:
    if name.endswith("stamp"):
        return "ns"
    return next((unit for begin, unit in units.items() if name.startswith(begin)), None)


class _Bag:
    """A bag of ROS 1, or of ROS 2 in SQLite, as rosbags reads it."""

    def __init__(self, path: Path) -> None:
        self.remarks: list[str] = []
        stores = package("rosbags.typesys", "ROS bags")
        reader = package("rosbags.highlevel", "ROS bags").AnyReader
        default = stores.get_typestore(stores.Stores.LATEST)
        self._reader = reader([path], default_typestore=default)
        self._reader.open()
        self.channels = {}
        for name, topic in self._reader.topics.items():
            channel = _Channel(
                topic.msgtype or topic.connections[0].msgtype, self._reader.is2, topic.msgcount
            )
            self.channels[name] = channel
            channel.first = next((data for _, data in self.messages(name)), b"")

    def fields_of(self, name: str) -> Any:
        """Return the fields of a type."""
        return self._reader.typestore.fielddefs[name][1]

    def messages(self, topic: str) -> Iterator[tuple[int, bytes]]:
        """Yield when each message came, in ns, and its bytes."""
        connections = [of for of in self._reader.connections if of.topic == topic]
        for _, time, data in self._reader.messages(connections=connections):
            yield time, data


class _Mcap:
    """An MCAP file, read from its beginning to its end, or to where it is broken off: https://mcap.dev/spec."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.remarks: list[str] = []
        self.channels: dict[str, _Channel] = {}
        self._numbers: dict[int, str] = {}
        stores = package("rosbags.typesys", "ROS bags")
        self._fields = dict(stores.get_typestore(stores.Stores.EMPTY).fielddefs)
        schemas: dict[int, tuple[str, str, str]] = {}
        for code, data in self._records():
            if code == 3:
                (number,) = struct.unpack_from("<H", data)
                name, encoding, text = _texts(data, 2, 3)
                schemas[number] = name, encoding, text
            elif code == 4:
                number, schema = struct.unpack_from("<HH", data)
                topic, encoding = _texts(data, 4, 2)
                name, of, text = schemas.get(schema, ("", "", ""))
                if encoding in ("cdr", "ros1") and of in ("ros1msg", "ros2msg", "ros2idl"):
                    read = stores.get_types_from_idl if of == "ros2idl" else stores.get_types_from_msg
                    self._fields |= read(text) if of == "ros2idl" else read(text, name)
                kind = name if "/msg/" in name else name.replace("/", "/msg/", 1)
                self._numbers[number] = topic
                self.channels.setdefault(topic, _Channel(kind, encoding == "cdr", 0))
            elif code == 5:
                channel = self.channels[self._numbers[struct.unpack_from("<H", data)[0]]]
                channel.first = channel.first or data[22:]
                channel.count += 1

    def fields_of(self, name: str) -> Any:
        """Return the fields of a type."""
        return self._fields[name][1]

    def messages(self, topic: str) -> Iterator[tuple[int, bytes]]:
        """Yield when each message came, in ns, and its bytes."""
        numbers = {number for number, of in self._numbers.items() if of == topic}
        for code, data in self._records():
            if code == 5 and int.from_bytes(data[:2], "little") in numbers:
                yield int.from_bytes(data[6:14], "little"), data[22:]

    def _records(self) -> Iterator[tuple[int, bytes]]:
        """Yield the kind of each record and its bytes, those in chunks too."""
        self.remarks.clear()
        with self._path.open("rb") as file:
            file.seek(8)
            while head := file.read(9):
                size = int.from_bytes(head[1:], "little")
                data = file.read(min(size, _MOST_BYTES)) if len(head) == 9 else b""
                is_whole = len(head) == 9 and len(data) == size
                if is_whole and head[0] in (2, 15):  # the end of the data
                    return
                if head[0] == 6 and len(data) > 40:
                    chunk = BytesIO(_expanded(data))
                    while len(inner := chunk.read(9)) == 9:
                        length = int.from_bytes(inner[1:], "little")
                        record = chunk.read(min(length, _MOST_BYTES))
                        if len(record) == length:
                            yield inner[0], record
                elif is_whole:
                    yield head[0], data
                if not is_whole:
                    self.remarks.append("it ends within a record, of which what is whole is read")
                    return
        self.remarks.append("it ends without its index, as a recording that was broken off")


def _texts(data: bytes, position: int, count: int) -> list[str]:
    texts = []
    for _ in range(count):
        (size,) = struct.unpack_from("<I", data, position)
        texts.append(data[position + 4 : position + 4 + size].decode())
        position += 4 + size
    return texts


def _expanded(data: bytes) -> bytes:
    """Return the records of a chunk."""
    (name,) = _texts(data, 28, 1)
    records = data[28 + 4 + len(name) + 8 :]
    if not name:
        return records
    if name == "lz4":
        return bytes(package("lz4.frame", "MCAP files").LZ4FrameDecompressor().decompress(records))
    if name != "zstd":
        raise ValueError(f"its chunks are compressed by {name!r}; lz4 and zstd are read")
    zstd = package("compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd", "MCAP files")
    return bytes(zstd.ZstdDecompressor().decompress(records))
