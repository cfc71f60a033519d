"""DataFlash logs of ArduPilot, whose messages FMT, FMTU, UNIT and MULT say what the others hold."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from strapgen.ir.checks import counted
from strapgen.lab.recordings.formats.messages import Field, MessageLog, Messages, known_units, stated

MAGIC = b"\xa3\x95"
_FMT = 128
#: How the letters of a format are stored, and their factor where no unit is stated; texts are skipped.
_KINDS = {
    "b": ("<i1", 1.0),
    "B": ("<u1", 1.0),
    "M": ("<u1", 1.0),
    "h": ("<i2", 1.0),
    "H": ("<u2", 1.0),
    "i": ("<i4", 1.0),
    "I": ("<u4", 1.0),
    "q": ("<i8", 1.0),
    "Q": ("<u8", 1.0),
    "g": ("<f2", 1.0),
    "f": ("<f4", 1.0),
    "d": ("<f8", 1.0),
    "c": ("<i2", 0.01),
    "C": ("<u2", 0.01),
    "e": ("<i4", 0.01),
    "E": ("<u4", 0.01),
    "L": ("<i4", 1e-7),
}
_TEXTS = {"n": 4, "N": 16, "Z": 64, "a": 64}
_AXES = ("X", "Y", "Z")
_IMU = {f"Gyr{axis}": "rad/s" for axis in _AXES} | {f"Acc{axis}": "m/s^2" for axis in _AXES}
_ANGLES = dict.fromkeys(("Roll", "Pitch", "Yaw"), "deg")
#: Units of logs that state none, from ArduPilot's page of log messages.
_UNITS = {
    "": {"TimeUS": "us", "TimeMS": "ms", "SampleUS": "us"},
    **dict.fromkeys(("IMU", "IMU2", "IMU3", "GYR", "ACC"), _IMU),
    **dict.fromkeys(("ATT", "AHR2", "NKF1", "XKF1"), _ANGLES),
}
#: Angles by what they are counted from.
_ANGLE_UNITS = dict.fromkeys(("degheading", "deglatitude", "deglongitude"), "deg")
#: A factor that makes a unit another.
_SCALED = {("s", 1e-6): "us", ("s", 1e-3): "ms", ("s", 1e-9): "ns"}


class DataFlash(MessageLog):
    """A log of ArduPilot; the second instance of a message is named IMU.1."""

    format = "dataflash"

    def scan(self, data: Any) -> Iterator[str]:
        """Note where the messages begin; yield remarks."""
        lengths: dict[int, int] = {_FMT: 89}
        found: dict[int, Messages] = {_FMT: Messages("FMT", ())}
        formats: dict[int, tuple[str, str, list[str]]] = {}
        position, skipped, cut = 0, 0, 0
        while position + 3 <= len(data):
            kind = data[position + 2]
            length = lengths.get(kind, 0)
            if data[position] != 0xA3 or data[position + 1] != 0x95 or not length:
                later = data.find(MAGIC, position + 1)
                later = len(data) if later < 0 else later
                skipped, position = skipped + later - position, later
                continue
            if position + length > len(data):
                cut = len(data) - position
                break
            found[kind].starts.append(position + 3)
            if kind == _FMT:
                new, size = data[position + 3], data[position + 4]
                name, letters, labels = (
                    data[position + 3 + first : position + 3 + last].split(b"\0")[0].decode("latin-1")
                    for first, last in ((2, 6), (6, 22), (22, 86))
                )
                if new != _FMT and size > 3:
                    lengths[new] = size
                    formats[new] = (name, letters, labels.split(","))
                    found.setdefault(new, Messages(name, ()))
            position += length
        names, factors, of_format = self._tables(data, found, formats)
        for kind, (name, letters, labels) in formats.items():
            messages = found[kind]
            messages.fields = list(_fields(name, letters, labels, of_format.get(kind), names, factors))
            if messages.size() <= lengths[kind] - 3:
                self._add(data, name, messages)
        if cut:
            yield f"it ends within a message, and its last {counted(cut, 'byte')} are left out"
        if skipped:
            yield f"{counted(skipped, 'byte')} that are no message are left out"

    @staticmethod
    def _tables(
        data: Any, found: dict[int, Messages], formats: dict[int, tuple[str, str, list[str]]]
    ) -> tuple[dict[int, str], dict[int, float], dict[int, tuple[bytes, bytes]]]:
        """Return units and factors by their letters, and the letters of each format."""
        units: dict[int, str] = {}
        factors: dict[int, float] = {}
        of_format: dict[int, tuple[bytes, bytes]] = {}
        for kind, (name, letters, _) in formats.items():
            for start in found[kind].starts if name in ("UNIT", "MULT", "FMTU") else ():
                if name == "UNIT" and letters == "QbZ":
                    units[data[start + 8]] = data[start + 9 : start + 73].split(b"\0")[0].decode("latin-1")
                elif name == "MULT" and letters == "Qbd":
                    number = float(np.frombuffer(data, "<f8", 1, start + 9)[0])
                    factors[data[start + 8]] = float(f"{number:.6g}")  # it was a float before
                elif name == "FMTU" and letters == "QBNN":
                    of_format[data[start + 8]] = data[start + 9 : start + 25], data[start + 25 : start + 41]
        return units, factors, of_format

    def _add(self, data: Any, name: str, messages: Messages) -> None:
        """Put the messages of each instance into a topic of its own."""
        instance = next((f for f in messages.fields if f.name == "I" and f.kind == "<u1"), None)
        if instance is None or name in ("FMTU", "UNIT", "MULT"):
            self._messages[name] = messages
            return
        for start in messages.starts:
            number = data[start + instance.offset]
            topic = f"{name}.{number}" if number else name
            self._messages.setdefault(topic, Messages(name, messages.fields)).starts.append(start)


def _fields(
    name: str,
    letters: str,
    labels: list[str],
    stated_as: tuple[bytes, bytes] | None,
    units: dict[int, str],
    factors: dict[int, float],
) -> Iterator[Field]:
    offset = 0
    for place, (letter, label) in enumerate(zip(letters, labels, strict=False)):
        if letter in _TEXTS:
            offset += _TEXTS[letter]
            continue
        if letter not in _KINDS:
            return
        kind, factor = _KINDS[letter]
        unit = known_units(_UNITS, name, label)
        if stated_as is not None and place < 16:
            of_unit, of_factor = stated_as[0][place], stated_as[1][place]
            says = units.get(of_unit, "")
            unit = stated(_ANGLE_UNITS.get(says, says.replace("UNKNOWN", ""))) or unit
            factor = factors.get(of_factor, factor) or 1.0
            if (str(unit), factor) in _SCALED:
                unit, factor = _SCALED[str(unit), factor], 1.0
        yield Field(label.strip(), offset, kind, unit, factor)
        offset += np.dtype(kind).itemsize
