"""ULog files, by https://docs.px4.io/main/en/dev_log/ulog_file_format.html."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from itertools import islice
from typing import Any

import numpy as np

from strapgen.ir.checks import counted
from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings.formats.messages import Field, MessageLog, Messages, known_units

MAGIC = b"ULog\x01\x12\x35"
_SYNC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
_HEADER = struct.Struct("<HB")
#: Most numbers of a message, whose size is stated in 16 bits.
_MOST_FIELDS = 1 << 16
_TYPES = b"ABCDFILMOPQRS"
_KINDS = {
    "int8_t": "<i1",
    "uint8_t": "<u1",
    "int16_t": "<i2",
    "uint16_t": "<u2",
    "int32_t": "<i4",
    "uint32_t": "<u4",
    "int64_t": "<i8",
    "uint64_t": "<u8",
    "float": "<f4",
    "double": "<f8",
    "bool": "<u1",
    "char": "<u1",
}
_RATES = {axis: "rad/s" for axis in "xyz"} | {"xyz": "rad/s"}
_FORCES = {axis: "m/s^2" for axis in "xyz"} | {"xyz": "m/s^2"}
#: Units of PX4's topics, from their definitions in its folder msg.
_UNITS = {
    "": {"timestamp": "us", "timestamp_sample": "us"},
    "sensor_combined": {"gyro_rad": "rad/s", "accelerometer_m_s2": "m/s^2", "gyro_integral_dt": "us"},
    "sensor_gyro": _RATES,
    "sensor_accel": _FORCES,
    "vehicle_angular_velocity": _RATES,
    "vehicle_acceleration": _FORCES,
    "vehicle_imu": {
        "delta_angle": "rad",
        "delta_velocity": "m/s",
        "delta_angle_dt": "us",
        "delta_velocity_dt": "us",
    },
    "vehicle_attitude": {"rollspeed": "rad/s", "pitchspeed": "rad/s", "yawspeed": "rad/s"},
}


class ULog(MessageLog):
    """A log of PX4; a topic's second instance is named sensor_gyro.1."""

    format = "ulog"

    def scan(self, data: Any) -> Iterator[str]:
        """Note where the messages begin; yield remarks."""
        self._formats: dict[str, list[tuple[str, int, str]]] = {}
        self._of: dict[int, tuple[Messages, int]] = {}
        position, ends = 16, [len(data)]
        dropouts, lost, damaged = 0, 0, 0
        while position < len(data):
            if position + 3 > ends[0]:
                size, kind = 0, 0
            else:
                size, kind = _HEADER.unpack_from(data, position)
            begin, end = position + 3, position + 3 + size
            if end > ends[0] or kind not in _TYPES:
                cut = ends[0] - position
                if len(ends) > 1:  # data that was appended after a break
                    position = ends.pop(0)
                elif (sync := data.find(_SYNC, begin)) > 0:
                    cut, position = sync - position, sync + len(_SYNC)
                else:
                    yield f"it ends within a message, and its last {counted(cut, 'byte')} are left out"
                    break
                damaged += 1
                continue
            position = end
            if kind == 68:  # D
                of = self._of.get(data[begin] + 256 * data[begin + 1]) if size > 2 else None
                if of is not None and size - 2 >= of[1]:
                    of[0].starts.append(begin + 2)
                else:
                    damaged += 1
            elif kind in (70, 65):  # F, A
                try:
                    (self._add_format if kind == 70 else self._subscribe)(data[begin:end])
                except (ValueError, KeyError, IndexError, RecursionError):
                    damaged += 1
            elif kind == 79:  # O
                dropouts, lost = dropouts + 1, lost + int.from_bytes(data[begin:end], "little")
            elif kind == 66:  # B
                if any(data[begin + 9 : begin + 16]) or data[begin + 8] > 1:
                    raise InputError(f"{self.path} is a ULog file with what no reader of today knows of")
                offsets = (
                    struct.unpack_from("<3Q", data, begin + 16) if data[begin + 8] and size >= 40 else ()
                )
                ends = [*(offset for offset in offsets if position < offset < len(data)), *ends]
            if position == ends[0] and len(ends) > 1:
                ends.pop(0)
        if damaged:
            yield f"{counted(damaged, 'damaged piece')} left out"
        if dropouts:
            yield f"the logger lost data {counted(dropouts, 'time')}, {lost} ms in all"

    def _add_format(self, data: bytes) -> None:
        name, _, fields = data.decode().partition(":")
        self._formats[name] = []
        for part in filter(None, fields.split(";")):
            kind, _, label = part.strip().partition(" ")
            kind, _, count = kind.partition("[")
            self._formats[name].append((kind, int(count.rstrip("]")) if count else 0, label))

    def _subscribe(self, data: bytes) -> None:
        instance, number, name = data[0], data[1] + 256 * data[2], data[3:].decode()
        fields = list(islice(self._fields(name, name, "", 0), _MOST_FIELDS + 1))
        if len(fields) > _MOST_FIELDS:
            raise ValueError(name)
        while fields and fields[-1].name.startswith("_padding"):
            fields.pop()  # it may be missing in the message
        messages = Messages(name, fields)
        messages = self._messages.setdefault(f"{name}.{instance}" if instance else name, messages)
        size = messages.size()
        messages.fields = [f for f in fields if "_padding" not in f.name]
        self._of[number] = messages, size

    def _fields(self, topic: str, name: str, prefix: str, offset: int) -> Iterator[Field]:
        for kind, count, label in self._formats[name]:
            for index in range(max(count, 1)):
                place = f"{prefix}{label}[{index}]" if count else f"{prefix}{label}"
                if kind in _KINDS:
                    yield Field(place, offset, _KINDS[kind], known_units(_UNITS, topic, place))
                    offset += np.dtype(_KINDS[kind]).itemsize
                else:
                    yield from self._fields(topic, kind, f"{place}.", offset)
                    offset += self._size(kind)

    def _size(self, name: str) -> int:
        return sum(
            max(count, 1) * (np.dtype(_KINDS[kind]).itemsize if kind in _KINDS else self._size(kind))
            for kind, count, _ in self._formats[name]
        )
