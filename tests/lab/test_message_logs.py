"""ULog, DataFlash and telemetry logs, written here from their published layouts."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings.formats.tlog import checksum
from strapgen.lab.recordings.log_file import LogColumn, open_log

ROWS = 20
STAMPS = [2**53 + 1 + 4000 * k for k in range(ROWS)]


def ulog(*, appended: bool = False) -> bytes:
    """Return a ULog file of a nested topic and of two instances of another one, whose padding is left out."""

    def message(kind: str, data: bytes) -> bytes:
        return struct.pack("<HB", len(data), ord(kind)) + data

    flags = bytearray(40)
    head = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    body = (
        message("F", b"sensor_gyro:uint64_t timestamp;float x;float y;float z;uint8_t[4] _padding0;")
        + message("F", b"offset:int16_t count;")
        + message("F", b"sensor_combined:uint64_t timestamp;float[3] gyro_rad;bool ok;offset[2] of;")
        + message("I", bytes([11]) + b"char[3] sysABC")
        + message("A", struct.pack("<BH", 0, 7) + b"sensor_gyro")
        + message("A", struct.pack("<BH", 1, 8) + b"sensor_gyro")
        + message("A", struct.pack("<BH", 0, 9) + b"sensor_combined")
    )
    for k, stamp in enumerate(STAMPS):
        body += message("D", struct.pack("<HQ3f", 7, stamp, k, 0.5, -k))
        body += message("D", struct.pack("<HQ3f", 8, stamp, -k, 0.5, k))
        body += message("D", struct.pack("<HQ3f?2h", 9, stamp, 0.25 * k, 0, 1, k % 2, k, -k))
        body += message("S", b"\x2f\x73\x13\x20\x25\x0c\xbb\x12") if k % 5 == 4 else b""
    body += message("O", struct.pack("<H", 30))
    if appended:  # the crash began within a message
        flags[8] = 1
        flags[16:24] = struct.pack("<Q", len(head) + 43 + len(body) + 5)
        body += struct.pack("<HBHQ", 30, ord("D"), 7, 0)[:5] + message(
            "D", struct.pack("<HQ3f", 7, 1, 2, 3, 4)
        )
    return head + message("B", bytes(flags)) + body


def dataflash(*, units: bool = True) -> bytes:
    """Return a DataFlash log of two instances of IMU and of an attitude in hundredths of a degree."""

    def form(kind: int, name: str, letters: str, labels: str) -> bytes:
        size = 3 + struct.calcsize("<" + letters.translate(str.maketrans("Zc", "sh")).replace("N", "16s"))
        size += 63 * letters.count("Z")
        return b"\xa3\x95\x80" + struct.pack(
            "<BB4s16s64s", kind, size, name.encode(), letters.encode(), labels.encode()
        )

    log = b"\xa3\x95\x80" + struct.pack(
        "<BB4s16s64s", 128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns"
    )
    log += form(1, "UNIT", "QbZ", "TimeUS,Id,Label") + form(2, "MULT", "Qbd", "TimeUS,Id,Mult")
    log += form(3, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds")
    log += form(4, "IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ")
    log += form(5, "ATT", "QccZ", "TimeUS,Roll,Pitch,Note")
    if units:
        for letter, unit in zip("sEod", ("s", "rad/s", "m/s/s", "deg"), strict=True):
            log += b"\xa3\x95\x01" + struct.pack("<Qb64s", 0, ord(letter), unit.encode())
        for letter, factor in zip("F0B-", (np.float32(1e-6), 1, np.float32(0.01), 0), strict=True):
            log += b"\xa3\x95\x02" + struct.pack("<Qbd", 0, ord(letter), factor)
        log += b"\xa3\x95\x03" + struct.pack("<QB16s16s", 0, 4, b"s#EEEooo", b"F-000000")
        log += b"\xa3\x95\x03" + struct.pack("<QB16s16s", 0, 5, b"sdd-", b"FBB-")
    for k, stamp in enumerate(STAMPS):
        for instance in (0, 1):
            log += b"\xa3\x95\x04" + struct.pack("<QB6f", stamp, instance, k, instance, 0.5, 0, 0, -9.75)
        log += b"\xa3\x95\x05" + struct.pack("<Qhh64s", stamp, 100 * k, -50, b"")
    return log


def tlog() -> bytes:
    """Return a telemetry log with both versions of MAVLink, of two vehicles."""

    def packet(version: int, number: int, extra: int, source: int, payload: bytes) -> bytes:
        if version == 2:
            payload = payload.rstrip(b"\0")
            head = struct.pack("<BBBBBB", len(payload), 0, 0, 0, source, 1) + number.to_bytes(3, "little")
        else:
            head = struct.pack("<BBBBB", len(payload), 0, source, 1, number)
        data = head + payload
        mark = {1: b"\xfe", 2: b"\xfd"}[version]
        return mark + data + struct.pack("<H", checksum(data + bytes([extra])))

    log = b""
    for k, stamp in enumerate(STAMPS):
        for source in (1, 2):
            attitude = struct.pack("<I6f", k, 0.5 * source, 0, 0, 0.25, 0, 0)
            log += struct.pack(">Q", stamp) + packet(1 + k % 2, 30, 39, source, attitude)
        scaled = struct.pack("<I10h", k, 0, 0, -1000, 7, -8, 9, 1, 2, 3, 0)
        log += struct.pack(">Q", stamp) + packet(2, 26, 170, 1, scaled)
        log += struct.pack(">Q", stamp) + packet(2, 4, 237, 1, b"another message\1")
    return log


FORMATS = {
    "ulog": (ulog, "flight.ulg"),
    "dataflash": (dataflash, "flight.bin"),
    "tlog": (tlog, "flight.tlog"),
}


@pytest.fixture(params=FORMATS)
def whole(request, tmp_path: Path) -> Path:
    write, name = FORMATS[request.param]
    path = tmp_path / name
    path.write_bytes(write())
    return path


def columns(path: Path, topic: str) -> dict[str, list[float]]:
    log = open_log(path)
    of = next(of for of in log.topics if of.name == topic)
    read = log.read(topic, of.names)
    assert {len(column) for column in read.values()} == {of.rows}
    return {name: column.tolist() for name, column in read.items()}


def test_topics_of_ulog(tmp_path):
    path = tmp_path / "flight.ulg"
    path.write_bytes(ulog())
    log = open_log(path)
    assert log.format == "ulog" and log.remarks == ("the logger lost data 1 time, 30 ms in all",)
    assert [topic.name for topic in log.topics] == ["sensor_combined", "sensor_gyro", "sensor_gyro.1"]
    combined = log.topics[0]
    assert combined.columns[:2] == (LogColumn("timestamp", "us"), LogColumn("gyro_rad[0]", "rad/s"))
    assert combined.names[4:] == ("ok", "of[0].count", "of[1].count")
    got = columns(path, "sensor_combined")
    assert got["timestamp"] == STAMPS
    assert got["gyro_rad[0]"] == [0.25 * k for k in range(ROWS)]
    assert got["ok"] == [k % 2 for k in range(ROWS)] and got["of[1].count"] == [-k for k in range(ROWS)]
    second = columns(path, "sensor_gyro.1")
    assert [*second] == ["timestamp", "x", "y", "z"] and second["z"] == [*range(ROWS)]
    assert log.place("sensor_gyro", 16) == "message 17"


def test_data_appended_after_a_break(tmp_path):
    path = tmp_path / "flight.ulg"
    path.write_bytes(ulog(appended=True))
    assert columns(path, "sensor_gyro")["timestamp"] == [*STAMPS, 1]
    assert open_log(path).remarks[0] == "1 damaged piece left out"


def test_a_damaged_piece_is_left_out_up_to_the_next_mark(tmp_path):
    path = tmp_path / "flight.ulg"
    data = ulog()
    mark = data.index(b"\x2f\x73\x13\x20")
    path.write_bytes(data[: mark - 40] + b"\xff" * 30 + data[mark - 10 :])
    assert columns(path, "sensor_gyro")["timestamp"][5:] == STAMPS[5:]
    assert "1 damaged piece left out" in open_log(path).remarks


@pytest.mark.parametrize("units", [True, False])
def test_topics_of_dataflash(units, tmp_path):
    path = tmp_path / "flight.bin"
    path.write_bytes(dataflash(units=units))
    log = open_log(path)
    assert log.format == "dataflash" and log.remarks == ()
    of = {topic.name: topic for topic in log.topics}
    assert {"IMU", "IMU.1", "ATT"} <= {*of}
    assert [column.unit for column in of["IMU"].columns] == ["us", None, *["rad/s"] * 3, *["m/s^2"] * 3]
    assert [column.unit for column in of["ATT"].columns] == ["us", "deg", "deg"]
    assert columns(path, "IMU.1")["GyrY"] == [1.0] * ROWS
    got = columns(path, "ATT")
    assert got == {"TimeUS": STAMPS, "Roll": [*range(ROWS)], "Pitch": [-0.5] * ROWS}
    assert log.read("IMU", ["TimeUS"])["TimeUS"].dtype == np.int64


def test_topics_of_a_telemetry_log(tmp_path):
    path = tmp_path / "flight.tlog"
    path.write_bytes(tlog())
    log = open_log(path)
    assert log.format == "tlog" and log.remarks == ()
    assert [topic.name for topic in log.topics] == ["ATTITUDE", "ATTITUDE.2.1", "SCALED_IMU"]
    attitude = columns(path, "ATTITUDE.2.1")
    assert attitude["received"] == STAMPS and attitude["time_boot_ms"] == [*range(ROWS)]
    assert attitude["roll"] == [1] * ROWS and attitude["rollspeed"] == [0.25] * ROWS
    scaled = columns(path, "SCALED_IMU")
    assert [scaled[name][3] for name in ("zacc", "xgyro", "ygyro", "zgyro")] == [-1000, 7, -8, 9]
    units = {column.name: column.unit for column in log.topics[2].columns}
    assert (units["zacc"], units["xgyro"], units["time_boot_ms"]) == ("mg", "mrad/s", "ms")


def test_packets_with_a_wrong_check_sum_are_left_out(tmp_path):
    path = tmp_path / "flight.tlog"
    data = bytearray(tlog())
    data[8 + 6 + 5] ^= 1
    path.write_bytes(data)
    with pytest.raises(InputError, match="no text file"):
        open_log(path)  # nothing says that it is one
    path.write_bytes(tlog() + data)
    assert len(columns(path, "ATTITUDE")["roll"]) == 2 * ROWS - 1
    assert open_log(path).remarks == ("44 bytes that are no packet are left out",)


def test_what_is_whole_of_a_truncated_file_is_read(whole, tmp_path):
    data = whole.read_bytes()
    size = {topic.name: topic.rows for topic in open_log(whole).topics}
    for cut in (len(data) - 1, len(data) - 11, len(data) * 3 // 4):
        short = tmp_path / f"short{whole.suffix}"
        short.write_bytes(data[:cut])
        log = open_log(short)
        assert any(remark.startswith("it ends within a") for remark in log.remarks)
        for topic in log.topics:
            assert topic.rows is not None and 0 < topic.rows <= size[topic.name]
            whole_columns, got = columns(whole, topic.name), columns(short, topic.name)
            assert all(whole_columns[name][: topic.rows] == got[name] for name in got)
    assert sum(topic.rows or 0 for topic in log.topics) < sum(size.values()) * 0.8


def test_files_with_any_byte_changed_are_read_or_refused(whole, tmp_path):
    data = whole.read_bytes()
    path = tmp_path / f"changed{whole.suffix}"
    rng = np.random.default_rng(1)
    for place in rng.integers(0, len(data), 150):
        path.write_bytes(data[:place] + bytes([data[place] ^ int(rng.integers(1, 256))]) + data[place + 1 :])
        try:
            log = open_log(path)
            for topic in log.topics:
                log.read(topic.name, topic.names)
        except InputError as error:
            assert str(error).startswith(str(path)) and "\n" not in str(error)
