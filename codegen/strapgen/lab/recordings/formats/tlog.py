"""Telemetry logs: packets of MAVLink, versions 1 and 2, each behind the time at which it came."""

from __future__ import annotations

import binascii
from collections.abc import Iterator
from typing import Any

import numpy as np

from strapgen.ir.checks import counted
from strapgen.lab.recordings.formats.messages import Field, MessageLog, Messages

#: Where a payload begins behind the first byte of a packet, by that byte: versions 1 and 2.
_BEGINS = {0xFE: 6, 0xFD: 10}
_KINDS = {"b": "<i1", "B": "<u1", "h": "<i2", "H": "<u2", "I": "<u4", "Q": "<u8", "f": "<f4"}
_GYRO, _ACCELEROMETER, _MAGNETOMETER = (
    [f"{axis}{what}" for axis in "xyz"] for what in ("gyro", "acc", "mag")
)
_SPEEDS = ["rollspeed", "pitchspeed", "yawspeed"]


def _fields(*groups: tuple[str, list[str], str | None]) -> tuple[Field, ...]:
    """Return fields one behind the other; each group has a kind, names and a unit."""
    fields, offset = [], 0
    for letter, names, unit in groups:
        for name in names:
            fields.append(Field(name, offset, _KINDS[letter], unit))
            offset += np.dtype(_KINDS[letter]).itemsize
    return tuple(fields)


_SCALED_IMU = _fields(
    ("I", ["time_boot_ms"], "ms"),
    ("h", _ACCELEROMETER, "mg"),
    ("h", _GYRO, "mrad/s"),
    ("h", _MAGNETOMETER, "mgauss"),
    ("h", ["temperature"], None),
)
#: Messages by their number: name, the byte that their check sums take in, and fields, from MAVLink's common.xml.
_MESSAGES = {
    26: ("SCALED_IMU", 170, _SCALED_IMU),
    116: ("SCALED_IMU2", 76, _SCALED_IMU),
    129: ("SCALED_IMU3", 46, _SCALED_IMU),
    27: (
        "RAW_IMU",
        144,
        _fields(
            ("Q", ["time_usec"], "us"),
            ("h", [*_ACCELEROMETER, *_GYRO, *_MAGNETOMETER], None),
            ("B", ["id"], None),
            ("h", ["temperature"], None),
        ),
    ),
    30: (
        "ATTITUDE",
        39,
        _fields(
            ("I", ["time_boot_ms"], "ms"), ("f", ["roll", "pitch", "yaw"], "rad"), ("f", _SPEEDS, "rad/s")
        ),
    ),
    31: (
        "ATTITUDE_QUATERNION",
        246,
        _fields(
            ("I", ["time_boot_ms"], "ms"), ("f", ["q1", "q2", "q3", "q4"], None), ("f", _SPEEDS, "rad/s")
        ),
    ),
    105: (
        "HIGHRES_IMU",
        93,
        _fields(
            ("Q", ["time_usec"], "us"),
            ("f", _ACCELEROMETER, "m/s^2"),
            ("f", _GYRO, "rad/s"),
            ("f", _MAGNETOMETER, "gauss"),
            ("f", ["abs_pressure", "diff_pressure", "pressure_alt", "temperature"], None),
            ("H", ["fields_updated"], None),
            ("B", ["id"], None),
        ),
    ),
}
_RECEIVED = "received"
#: The bits of a byte in reverse, for a check sum that begins with the lowest bit.
_REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))


def checksum(data: bytes) -> int:
    """Return the check sum CRC-16/MCRF4XX."""
    value = binascii.crc_hqx(data.translate(_REVERSED), 0xFFFF)
    return _REVERSED[value >> 8] | _REVERSED[value & 0xFF] << 8


def is_tlog(head: bytes) -> bool:
    """Return whether a file begins with a packet behind its time, and another one behind that."""
    packet = _packet(head, 0)
    return packet is not None and (packet[0] == len(head) or _begins(head, packet[0]))


def _begins(data: Any, position: int) -> bool:
    return position + 8 >= len(data) or data[position + 8] in _BEGINS


def _packet(data: Any, position: int) -> tuple[int, int, int, int] | None:
    """Return where a packet ends that begins with its time, its number, where its payload begins, and its size."""
    first = position + 8
    if first + 12 > len(data) or data[first] not in _BEGINS:
        return None
    size, begin = data[first + 1], first + _BEGINS[data[first]]
    if data[first] == 0xFE:
        number, end = data[first + 5], begin + size + 2
    else:
        number = int.from_bytes(data[first + 7 : first + 10], "little")
        end = begin + size + 2 + 13 * (data[first + 2] & 1)
    if end > len(data):
        return None
    if number in _MESSAGES:
        extra = bytes([_MESSAGES[number][1]])
        stated = int.from_bytes(data[begin + size : begin + size + 2], "little")
        if checksum(data[first + 1 : begin + size] + extra) != stated:
            return None
    return end, number, begin, size


class TLog(MessageLog):
    """A telemetry log; messages of a second vehicle or component are named ATTITUDE.2.1 by its numbers."""

    format = "tlog"

    def scan(self, data: Any) -> Iterator[str]:
        """Note where the messages begin; yield remarks."""
        sources: dict[str, tuple[int, int]] = {}
        payloads: list[bytes] = []
        position, last, skipped, length = 0, 0, 0, 0
        while position < len(data):
            packet = _packet(data, position)
            if packet is None or not _begins(data, packet[0]):
                position += 1
                continue
            skipped, last = skipped + position - last, packet[0]
            end, number, begin, size = packet
            if number in _MESSAGES:
                name, _, fields = _MESSAGES[number]
                first = position + 8
                source = (
                    (data[first + 3], data[first + 4])
                    if data[first] == 0xFE
                    else (data[first + 5], data[first + 6])
                )
                topic = (
                    name if sources.setdefault(name, source) == source else f"{name}.{source[0]}.{source[1]}"
                )
                if topic not in self._messages:
                    moved = [Field(f.name, f.offset + 8, f.kind, f.unit) for f in fields]
                    self._messages[topic] = Messages(name, [Field(_RECEIVED, 0, ">u8", "us"), *moved])
                messages = self._messages[topic]
                # Version 2 leaves zeros at the end of a payload out.
                whole = data[position : position + 8] + data[begin : begin + size]
                whole = whole[: messages.size()] + bytes(max(0, messages.size() - len(whole)))
                messages.starts.append(length)
                payloads.append(whole)
                length += len(whole)
            position = end
        self._data = b"".join(payloads)
        if last < len(data):
            yield f"it ends within a packet, and its last {counted(len(data) - last, 'byte')} are left out"
        if skipped:
            yield f"{counted(skipped, 'byte')} that are no packet are left out"
