"""MAT, HDF5, Parquet, Feather, ROS bags and MCAP, written by their libraries."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import strapgen
from strapgen.ir.exceptions import InputError, MissingExtraError
from strapgen.lab.recordings import long_columns
from strapgen.lab.recordings.formats import column_tables, ros
from strapgen.lab.recordings.log_file import LogColumn, open_log

h5py = pytest.importorskip("h5py")
pa = pytest.importorskip("pyarrow")
pytest.importorskip("rosbags")
scipy_io = pytest.importorskip("scipy.io")

from pyarrow import feather, parquet  # noqa: E402
from rosbags.rosbag1 import Writer as Bag1  # noqa: E402
from rosbags.rosbag2 import StoragePlugin, Writer  # noqa: E402
from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: E402

ROWS = 30
STAMPS = np.arange(ROWS) * 5_000_000 + 1_700_000_000_000_000_000
RATES = np.arange(ROWS)[:, None] * [1.0, -0.5, 0.25]


def columns(path: Path, topic: str = "") -> dict[str, list[float]]:
    log = open_log(path)
    of = next(of for of in log.topics if of.name == topic)
    read = log.read(topic, of.names)
    return {name: column.tolist() for name, column in read.items()}


# MAT and HDF5


def mat(path: Path) -> None:
    inner = {"t": STAMPS, "gyr": RATES.T, "note": "text", "once": np.eye(2)}
    scipy_io.savemat(path, {"imu": inner, "fs": 200.0, "other": np.arange(7), "parts": [inner, inner]})


def hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file.attrs["sampling_rate"] = 200.0
        group = file.create_group("imu")
        group["t"] = STAMPS
        group["gyr"] = RATES
        group["gyr"].attrs["units"] = "deg/s"
        group["note"] = "text"
        file["other"] = np.arange(7)
        pairs = np.zeros(ROWS, [("t", "<i8"), ("w", "<f4")])
        pairs["w"] = RATES[:, 0]
        file["pairs"] = pairs


def new_mat(path: Path) -> None:
    """Write the layout of MATLAB 7.3: HDF5 behind 512 bytes, arrays with their axes in reverse."""
    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group("imu")
        group["t"] = STAMPS[None]
        group["gyr"] = RATES.T
        text = group.create_dataset("note", data=np.array([[65], [66]], np.uint16))
        text.attrs["MATLAB_class"] = np.bytes_("char")
        file.create_group("#refs#")["a"] = np.arange(ROWS)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


@pytest.mark.parametrize("write", [mat, hdf5, new_mat])
def test_arrays_that_stand_together_are_a_table(write: Callable[[Path], None], tmp_path):
    path = tmp_path / "x"
    write(path)
    log = open_log(path)
    assert log.format == ("hdf5" if write is hdf5 else "mat")
    topics = {topic.name: topic for topic in log.topics}
    assert topics["imu"].rows == ROWS and set(topics["imu"].names) >= {"t", "gyr[0]", "gyr[1]", "gyr[2]"}
    got = columns(path, "imu")
    assert got["t"] == STAMPS.tolist()
    assert [got[f"gyr[{k}]"] for k in range(3)] == RATES.T.tolist()
    if write is mat:
        assert {*topics} == {
            "",
            *(f"{of}{more}" for of in ("imu", "parts[0]", "parts[1]") for more in ("", ".once")),
        }
        assert log.remarks == ("fs is 200",)
        assert columns(path, "parts[1]")["t"] == STAMPS.tolist()
    if write is hdf5:
        assert {*topics} == {"", "imu", "pairs"} and log.remarks == ("sampling_rate is 200",)
        assert columns(path, "pairs")["w"] == RATES[:, 0].tolist()
        assert LogColumn("gyr[0]", "deg/s") in topics["imu"].columns
    if write is new_mat:
        assert {*topics} == {"imu"}
    assert log.place("imu", 4) == "row 5"


# Parquet and Feather


@pytest.fixture
def table():
    nested = pa.array([{"x": x, "y": [y, z]} for x, y, z in RATES.tolist()])
    gaps = pa.array([None if k == 3 else k for k in range(ROWS)], pa.int32())
    fields = [
        pa.field("t", pa.timestamp("us")),
        pa.field("n", pa.uint64()),
        pa.field("gyro [deg/s]", pa.float32()),
        pa.field("w", nested.type, metadata={"unit": "rad/s"}),
        pa.field("gaps", pa.int32()),
        pa.field("v", pa.list_(pa.float64(), 3)),
        pa.field("note", pa.string()),
    ]
    fixed = pa.FixedSizeListArray.from_arrays(RATES.ravel(), 3)
    values = [STAMPS // 1000, STAMPS, RATES[:, 0], nested, gaps, fixed, ["x"] * ROWS]
    return pa.table(
        [pa.array(v, f.type) for v, f in zip(values, fields, strict=True)], schema=pa.schema(fields)
    )


@pytest.mark.parametrize(
    "write",
    [parquet.write_table, feather.write_feather, lambda t, p: parquet.write_table(t, p, row_group_size=7)],
)
def test_columns_of_parquet_and_feather(write, table, tmp_path, monkeypatch):
    monkeypatch.setattr(column_tables, "PART", 8)
    path = tmp_path / "x"
    write(table, path)
    log = open_log(path)
    assert log.topics[0].rows == ROWS
    assert [(column.name, column.unit) for column in log.topics[0].columns] == [
        ("t", "us"),
        ("n", None),
        ("gyro [deg/s]", "deg/s"),
        ("w.x", "rad/s"),
        ("w.y[0]", "rad/s"),
        ("w.y[1]", "rad/s"),
        ("gaps", None),
        *((f"v[{k}]", None) for k in range(3)),
    ]
    got = columns(path)
    assert got["t"] == (STAMPS // 1000).tolist() and got["n"] == STAMPS.tolist()
    assert [got["w.x"], got["w.y[0]"], got["w.y[1]"]] == RATES.T.tolist()
    assert [got[f"v[{k}]"] for k in range(3)] == RATES.T.tolist()
    assert np.isnan(got["gaps"][3]) and got["gaps"][4] == 4


# Bags


def imu_message(store, k: int, frame: str, *, first: bool = False):
    types = store.types
    vector = types["geometry_msgs/msg/Vector3"]
    seconds, rest = divmod(int(STAMPS[k]), 10**9)
    stamp = types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=rest)
    header = types["std_msgs/msg/Header"]
    header = header(seq=k, stamp=stamp, frame_id=frame) if first else header(stamp=stamp, frame_id=frame)
    nine = np.zeros(9)
    return types["sensor_msgs/msg/Imu"](
        header=header,
        orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=nine,
        angular_velocity=vector(*RATES[k].tolist()),
        angular_velocity_covariance=nine,
        linear_acceleration=vector(0.0, 0.0, 9.75),
        linear_acceleration_covariance=nine,
    )


def frame(k: int) -> str:
    """Return names of frames of several lengths, and of equal ones."""
    return ("imu", "imu_link", "body")[k % 3]


def ros1(path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    with Bag1(path) as bag:
        connection = bag.add_connection("/imu", "sensor_msgs/msg/Imu", typestore=store)
        for k in range(ROWS):
            message = imu_message(store, k, frame(k), first=True)
            bag.write(connection, int(STAMPS[k]), store.serialize_ros1(message, "sensor_msgs/msg/Imu"))


def ros2(path: Path, plugin: StoragePlugin = StoragePlugin.SQLITE3) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(path, version=9, storage_plugin=plugin) as bag:
        connection = bag.add_connection("/imu", "sensor_msgs/msg/Imu", typestore=store)
        text = bag.add_connection("/text", "std_msgs/msg/String", typestore=store)
        for k in range(ROWS):
            message = store.serialize_cdr(
                imu_message(store, k, frame(k)), "sensor_msgs/msg/Imu", little_endian=k % 2 == 0
            )
            bag.write(connection, int(STAMPS[k]), message)
            said = store.types["std_msgs/msg/String"](data="x" * k)
            bag.write(text, int(STAMPS[k]), store.serialize_cdr(said, "std_msgs/msg/String"))


def mcap(path: Path) -> None:
    folder = path.parent / "folder"
    ros2(folder, StoragePlugin.MCAP)
    next(folder.glob("*.mcap")).rename(path)


def chunked(compression: str) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        plain = path.parent / "plain.mcap"
        mcap(plain)
        library = pytest.importorskip("mcap.writer")
        kind = getattr(library.CompressionType, compression)
        with path.open("wb") as file:
            writer = library.Writer(file, chunk_size=1500, compression=kind)
            writer.start()
            channels, schemas = {}, {}
            for code, data in ros._Mcap(plain)._records():
                number = int.from_bytes(data[:2], "little")
                if code == 3:
                    name, encoding, text = ros._texts(data, 2, 3)
                    schemas[number] = writer.register_schema(name, encoding, text.encode())
                elif code == 4:
                    topic, encoding = ros._texts(data, 4, 2)
                    channels[number] = writer.register_channel(
                        topic, encoding, schemas[int.from_bytes(data[2:4], "little")]
                    )
                elif code == 5:
                    stamp = int.from_bytes(data[6:14], "little")
                    writer.add_message(channels[number], stamp, data[22:], stamp)
            writer.finish()

    return write


BAGS = {
    "ros1": (ros1, "x.bag"),
    "ros2": (ros2, "folder"),
    "mcap": (mcap, "x.mcap"),
    "mcap, lz4": (chunked("LZ4"), "x.mcap"),
    "mcap, zstd": (chunked("ZSTD"), "x.mcap"),
}


@pytest.fixture(params=BAGS)
def bag(request, tmp_path) -> Path:
    write, name = BAGS[request.param]
    path = tmp_path / name
    write(path)
    return path


def test_topics_of_bags(bag, monkeypatch):
    monkeypatch.setattr(ros, "_TOGETHER", 7)
    log = open_log(bag)
    assert log.remarks == ()
    of = {topic.name: topic for topic in log.topics}["/imu"]
    assert (of.message, of.rows) == ("sensor_msgs/msg/Imu", ROWS)
    units = {column.name: column.unit for column in of.columns}
    assert (units["header.stamp"], units["angular_velocity.x"]) == ("ns", "rad/s")
    assert (units["linear_acceleration.z"], units["orientation.w"]) == ("m/s^2", None)
    got = columns(bag, "/imu")
    assert got["header.stamp"] == got["received"] == STAMPS.tolist()
    assert [got[f"angular_velocity.{axis}"] for axis in "xyz"] == RATES.T.tolist()
    assert got["orientation.w"] == [1] * ROWS and got["linear_acceleration.z"] == [9.75] * ROWS
    assert log.place("/imu", 16) == "message 17"


def test_messages_of_one_length_with_texts_of_several(tmp_path):
    store, kind, path = get_typestore(Stores.ROS1_NOETIC), "test/msg/Between", tmp_path / "x.bag"
    store.register(get_types_from_msg("string before\nfloat64 number\nstring after\n", kind))
    with Bag1(path) as bag:
        connection = bag.add_connection("/between", kind, typestore=store)
        for k, (before, after) in enumerate([("a", "bbb"), ("aaa", "b"), ("aa", "bb")] * 3):
            message = store.types[kind](before=before, number=k + 0.5, after=after)
            bag.write(connection, k, store.serialize_ros1(message, kind))
    assert columns(path, "/between")["number"] == [k + 0.5 for k in range(9)]


def test_elements_of_lists_are_no_columns_and_what_follows_them_is_read(tmp_path):
    store, kind, path = get_typestore(Stores.ROS1_NOETIC), "test/msg/Listed", tmp_path / "x.bag"
    text = "geometry_msgs/Vector3[] places\nfloat64[] loads\nfloat32[2] pair\nfloat64 number\n"
    store.register(get_types_from_msg(text, kind))
    vector = store.types["geometry_msgs/msg/Vector3"]
    with Bag1(path) as bag:
        connection = bag.add_connection("/listed", kind, typestore=store)
        for k in range(9):
            places = [vector(1.0, 2.0, 3.0)] * (k % 3)
            message = store.types[kind](places, np.zeros(k % 2), np.array([k, -k], np.float32), k + 0.5)
            bag.write(connection, k, store.serialize_ros1(message, kind))
    got = columns(path, "/listed")
    assert [*got] == ["received", "pair[0]", "pair[1]", "number"]
    assert got["number"] == [k + 0.5 for k in range(9)] and got["pair[1]"] == [-k for k in range(9)]


def test_a_bag_is_a_recording_without_more_words(bag):
    """Its covariances are no rates."""
    recording = strapgen.read(bag)
    assert recording.interval == pytest.approx(0.005, rel=1e-9)
    np.testing.assert_allclose(recording.samples[:, 1], RATES[:, 1] * 0.005, rtol=1e-6)


@pytest.mark.parametrize("kind", ["mcap", "mcap, lz4", "mcap, zstd"])
def test_what_is_whole_of_a_truncated_mcap_is_read(kind, tmp_path):
    write, name = BAGS[kind]
    write(tmp_path / name)
    data = (tmp_path / name).read_bytes()
    short = tmp_path / "short.mcap"
    short.write_bytes(data[: len(data) // 2])
    log = open_log(short)
    of = log.topics[0]
    assert of.rows is not None and 5 < of.rows < ROWS
    assert columns(short, "/imu")["header.stamp"] == STAMPS[: of.rows].tolist()
    assert len(log.remarks) == 1 and log.remarks[0].startswith("it ends with")


# What is refused


def truncated(write: Callable[[Path], None], tmp_path: Path) -> Path:
    path = tmp_path / "whole"
    write(path)
    if path.is_dir():
        path = next(path.glob("*.db3"))
    short = tmp_path / f"short{path.suffix}"
    short.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    return short


@pytest.mark.parametrize(
    "write",
    [
        mat,
        hdf5,
        new_mat,
        ros1,
        ros2,
        lambda path: parquet.write_table(pa.table({"x": RATES[:, 0]}), path),
        lambda path: feather.write_feather(pa.table({"x": RATES[:, 0]}), path),
    ],
    ids=["mat", "hdf5", "mat 7.3", "ros1", "ros2", "parquet", "feather"],
)
def test_other_truncated_files_are_refused_in_one_line(write, tmp_path):
    path = truncated(write, tmp_path)
    with pytest.raises(InputError) as refusal:
        log = open_log(path)
        for topic in log.topics:
            log.read(topic.name, topic.names)
    assert str(refusal.value).startswith(str(path)) and "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    "head",
    [
        *(
            b"",
            b"PAR1",
            b"ARROW1",
            b"\x89HDF\r\n\x1a\n",
            b"MATLAB 5.0",
            b"#ROSBAG V2.0\n",
            b"SQLite format 3\0",
        ),
        *(b"\xa3\x95", b"ULog\x01\x12\x35", b"\x89MCAP0\r\n", b"\x1f\x8b", b"BZh", b"\xfd7zXZ\0"),
        *(b"\x28\xb5\x2f\xfd", b"\xff\xfe", b"RIFF"),
    ],
    ids=repr,
)
@pytest.mark.parametrize("rest", [b"", b"\0" * 3000, bytes(range(256)) * 20])
def test_garbage_is_refused_in_one_line_or_has_no_rows(head, rest, tmp_path):
    path = tmp_path / "x.bag"
    path.write_bytes(head + rest)
    try:
        log = open_log(path)
        for topic in log.topics:
            assert all(len(column) == 0 for column in log.read(topic.name, topic.names).values())
    except InputError as error:
        assert str(error).startswith(str(path)) and "\n" not in str(error)


@pytest.mark.parametrize(
    ("name", "write"), [("h5py", hdf5), ("pyarrow", None), ("rosbags", ros1), ("scipy", mat)]
)
def test_a_missing_package_names_the_extra(name, write, tmp_path, monkeypatch):
    path = tmp_path / "x.bag"
    if write is None:
        parquet.write_table(pa.table({"x": [1, 2]}), path)
    else:
        write(path)
    for module in [*sys.modules]:
        if module.partition(".")[0] == name:
            monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=r"^.* need .*: pip install 'strapgen\[logs\]'$"):
        open_log(path)


def test_long_columns_are_on_the_disk(tmp_path, monkeypatch):
    monkeypatch.setattr(long_columns, "_IN_MEMORY", 10)
    path = tmp_path / "x"
    parquet.write_table(pa.table({"x": RATES[:, 0], "n": STAMPS}), path)
    read = open_log(path).read("", ["x", "n"])
    assert all(isinstance(column, np.memmap) for column in read.values())
    assert read["n"].dtype == np.int64 and read["n"].tolist() == STAMPS.tolist()
