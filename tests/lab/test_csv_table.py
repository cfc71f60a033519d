"""Tables of text: numpy reads blocks of plain rows, and the result is that of reading each cell by itself."""

from __future__ import annotations

import bz2
import gzip
import lzma
import math
import tempfile
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings import long_columns, recording
from strapgen.lab.recordings.formats import csv_table
from strapgen.lab.recordings.formats.csv_table import CsvTable, LineNumbers
from strapgen.lab.recordings.formats.decimals import Marks
from strapgen.lab.recordings.log_file import LogColumn, open_log
from strapgen.lab.recordings.long_columns import Columns, SideBySide, largest_magnitude, parts

PLAIN = st.sampled_from(
    ["0", "1.5", "-2e-3", " 3 ", "+4", ".5", "1e400", "1_0", "nan", "", "x", "0x1p3", "٣", '"7"', '"8\n"']
)
ROWS = st.lists(PLAIN, min_size=3, max_size=6).map(",".join) | st.sampled_from(
    ["", " ", "t,dx,dy,dz", "dz,dy,dx,t", "# 1", "#1,2,3,4"]
)

READERS = {
    "increments": recording.read_increments,
    "rates": lambda path: recording.read_rates(path, "deg/s"),
    "summed": lambda path: recording.read(path, rate_unit="deg/s", every=3),
}


def outcome(path: Path) -> str:
    """Return what a file holds, or why it is refused."""
    try:
        log = open_log(path)
        columns = log.read("", log.topics[0].names)
    except InputError as error:
        return str(error)
    values = {name: (column.dtype, column.tolist()) for name, column in columns.items()}
    count = len(columns["1"])
    return repr((values, [log.place("", row) for row in range(count)]))


@given(st.lists(ROWS, max_size=12), st.sampled_from(["\n", "\r\n", "\r"]), st.sampled_from([16, 50, 1000]))
@settings(deadline=None)
def test_blocks_equal_single_cells(lines, end, block):
    path = Path(tempfile.gettempdir()) / f"rows-{np.random.default_rng().integers(1 << 60)}.csv"
    good = [f"{k},{k},{k},{k}" for k in range(20)]
    path.write_bytes(end.join([*good, *lines, *good, ""]).encode())
    try:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(csv_table, "_SAMPLE", 4)
            patch.setattr(csv_table, "_BLOCK", 100)
            whole = outcome(path)
            patch.setattr(csv_table, "_arrow", lambda: None)
            assert outcome(path) == whole
            patch.setattr(CsvTable, "_plain", lambda self, block, places: None)
            assert outcome(path) == whole
            patch.undo()
            patch.setattr(csv_table, "_SAMPLE", 4)
            patch.setattr(csv_table, "_BLOCK", block)
            assert outcome(path) == whole
    finally:
        path.unlink()


def test_most_blocks_are_read_by_numpy(tmp_path, monkeypatch):
    monkeypatch.setattr(csv_table, "_BLOCK", 80)
    path = tmp_path / "gyro.csv"
    path.write_text("t,dz,dy,dx\n" + "".join(f"{k},3,2,1\n" for k in range(10, 110)))
    monkeypatch.setattr(csv_table, "csv_rows", lambda *_: pytest.fail("row by row"))
    log = open_log(path)
    columns = log.read("", ["t", "dx", "dz"])
    assert [columns[name].tolist() for name in columns] == [[*range(10, 110)], [1] * 100, [3] * 100]
    assert [log.place("", row) for row in (0, 8, 9, 99)] == ["line 2", "line 10", "line 11", "line 101"]


decimal = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.floats(-10, 10).map("{:.18e}".format),
    st.floats(-1e5, 1e5).map("{:.6f}".format),
    st.integers(-(2**64), 2**64).map(str),
    st.from_regex(r"\A[-+]?[0-9]{0,20}[.]?[0-9]{0,20}([eE][-+]?[0-9]{0,4})?\Z"),
    st.text("0123456789.eE+- x", max_size=12),
)


@given(st.lists(st.tuples(decimal, decimal), min_size=1, max_size=20))
def test_decimals_are_rounded_as_python_rounds_them(rows):
    marks = Marks("".join(f"{x};{y}\n" for x, y in rows).encode(), b";", 2)
    assert marks.is_plain and marks.rows == len(rows)
    for place, cells in enumerate(zip(*rows, strict=True)):
        doubles, integers, is_read, are_integers = marks.numbers(place)
        for cell, double, integer, good in zip(cells, doubles, integers, is_read, strict=True):
            if good:  # others are left to Python
                assert math.copysign(1, double) == math.copysign(1, float(cell)) and double == float(cell)
                assert not are_integers or integer == int(cell)


@pytest.mark.parametrize(
    "cell",
    ["0", "-0", "12", "-7.25", "3.141592653589793", "1e-3", "-2.5E+03", "1403636579758555392", "+.5", "5."],
)
def test_usual_decimals_are_not_left_to_python(cell):
    assert Marks(f"{cell}\n".encode(), b",", 1).numbers(0)[2].all()


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("t,x\n0,1\n1,2\n", "t,x"),
        ("0,1\n1,2\n", "1,2"),
        ("# log of today\n# t;x\n0;1\n1;2\n", "t,x"),
        ("t|x\n0|1\n1|2\n", "t,x"),
        ("t\tx\n0\t1\n1\t2\n", "t,x"),
        ("t  x \n 0  1\n 1  2\n", "t,x"),
        ("t;x\n0,0;1,0\n1,0;2,0\n", "t,x"),
        ("0,0 1,0\n1,0 2,0\n", "1,2"),
        ('"t","x"\n"0","1"\n"1","2"\n', "t,x"),
        ("t,x,\n0,1,\n1,2,\n", "t,x"),
        ("t,x\n0,1,\n1,2,\n", "t,x"),
        ("Logger 7\nRate,100,Hz\n\nt,x\ns,deg/s\n0,1\n\n1,2\n", "t,x"),
        ("x,x\n0,1\n1,2\n", "x,x.2"),
        (",x\n0,1\n1,2\n", "1,x"),
        ("t,x\n0,1\n# a break\n1,2\n", "t,x"),
    ],
)
def test_tables_as_loggers_write_them(text, names, tmp_path):
    path = tmp_path / "gyro.csv"
    path.write_text(text)
    log = open_log(path)
    assert log.topics[0].names == tuple(names.split(","))
    assert [column.tolist() for column in log.read("", names.split(",")).values()] == [[0, 1], [1, 2]]


def test_units_in_brackets_or_below_the_header(tmp_path):
    path = tmp_path / "gyro.csv"
    path.write_text("#timestamp [ns],w_RS_S_x [rad s^-1],gyro[2],T (°C)\n1,2,3,4\n", encoding="latin-1")
    units = [column.unit for column in open_log(path).topics[0].columns]
    assert units == ["ns", "rad/s", None, "°C"]
    path.write_text("Time,GyroX,Label\n(s),(deg/s),\n1,2,3\n")
    assert open_log(path).topics[0].columns == (
        LogColumn("Time", "s"),
        LogColumn("GyroX", "deg/s"),
        LogColumn("Label"),
    )


def test_stamps_keep_their_digits(tmp_path):
    path = tmp_path / "gyro.csv"
    stamps = [2**63 - 1, 1403636579758555392, -(2**53) - 1]
    path.write_text("".join(f"{stamp},0.5\n" for stamp in stamps))
    column = open_log(path).read("", ["1"])["1"]
    assert column.dtype == np.int64 and column.tolist() == stamps
    path.write_text("".join(f"{stamp},0.5\n" for stamp in [*stamps, 2**63]))
    column = open_log(path).read("", ["1"])["1"]
    assert column.dtype == np.float64 and column.tolist() == [float(stamp) for stamp in [*stamps, 2**63]]


@pytest.mark.parametrize("compress", [gzip.compress, bz2.compress, lzma.compress])
def test_compressed_tables(compress, tmp_path):
    path = tmp_path / "gyro.csv"
    whole = compress("".join(f"{k},{k * k}\n" for k in range(5000)).encode())
    path.write_bytes(whole)
    assert open_log(path).read("", ["2"])["2"].tolist() == [k * k for k in range(5000)]
    path.write_bytes(whole[:-20])
    with pytest.raises(InputError, match=r"^.*gyro.csv cannot be read \("):
        open_log(path).read("", ["2"])


@given(st.lists(st.tuples(st.booleans(), st.lists(st.integers(1, 3), min_size=1, max_size=5)), max_size=8))
def test_line_numbers_come_back(blocks):
    lines, expected = LineNumbers(), []
    for is_range, gaps in blocks:
        first = expected[-1] + 1 if expected else 1
        block = (
            range(first, first + len(gaps)) if is_range else [first + sum(gaps[:k]) for k in range(len(gaps))]
        )
        lines.add(len(expected), block)
        expected += block
    assert [lines[k] for k in range(len(expected))] == expected


@pytest.fixture
def on_disk(monkeypatch):
    monkeypatch.setattr(long_columns, "_IN_MEMORY", 1000)
    monkeypatch.setattr(long_columns, "PART", 1000)
    monkeypatch.setattr(csv_table, "_BLOCK", 10_000)


def long_file(path: Path, count: int) -> Path:
    path.write_text("".join(f"{k * 1e-3:.3f},{k % 7},{k % 5},{k % 3}\n" for k in range(count)))
    return path


@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_memory_does_not_grow_with_the_file(read, on_disk, tmp_path):
    """Row by row in Python a row took some 350 bytes; on the disk it takes none."""
    peaks = []
    read(long_file(tmp_path / "warm.csv", 3000))
    for count in (5_000, 25_000):
        path = long_file(tmp_path / "gyro.csv", count)
        tracemalloc.start()
        data = read(path)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert isinstance(data.samples, np.memmap)
    # The greatest part of a block may be a little larger; a byte for each row more would be 20 kB.
    assert peaks[1] - peaks[0] < 20_000, peaks


@pytest.mark.long
@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_recordings_on_disk_and_in_memory_are_equal(read, tmp_path, request):
    path = long_file(tmp_path / "gyro.csv", 5_000)
    in_memory = read(path)
    request.getfixturevalue("on_disk")
    data = read(path)
    assert isinstance(data.samples, np.memmap) and not isinstance(in_memory.samples, np.memmap)
    assert (data.start, data.interval, data.largest) == (
        in_memory.start,
        in_memory.interval,
        in_memory.largest,
    )
    np.testing.assert_array_equal(data.samples, in_memory.samples)


@pytest.mark.parametrize("kind", ["rates", "instants"])
@pytest.mark.parametrize("every", [1, 3, 7])
def test_sums_over_part_boundaries_give_the_same_bits(kind, every, tmp_path, request):
    path = long_file(tmp_path / "gyro.csv", 2_500)
    at_once = recording.read(path, rate_unit="rad/s", input=kind, every=every).samples
    request.getfixturevalue("on_disk")
    in_parts = recording.read(path, rate_unit="rad/s", input=kind, every=every).samples
    np.testing.assert_array_equal(in_parts, at_once)


@pytest.fixture
def few_on_disk(monkeypatch, tmp_path):
    """Keep all but the shortest columns on the disk, and work on few rows together."""
    monkeypatch.setattr(long_columns, "_IN_MEMORY", 10)
    monkeypatch.setattr(long_columns, "PART", 4)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


@pytest.mark.parametrize("sizes", [[1, 2], [5], [2, 1, 9, 0, 3], [0]])
def test_rows_come_back_in_order(few_on_disk, sizes, rng):
    rows = [rng.normal(size=(size, 3)) for size in sizes]
    columns = Columns(3)
    for part in rows:
        columns.append(part)
    array = columns.array()
    assert isinstance(array, np.memmap) == (sum(sizes) * 3 > 10)
    np.testing.assert_array_equal(array, np.concatenate(rows))
    assert [*few_on_disk.iterdir()] == [], "the file has no name, and is gone with the process"


@pytest.mark.parametrize("overlap", [0, 1])
@pytest.mark.parametrize("count", [2, 4, 5, 8, 9, 13])
def test_parts_cover_all_rows(few_on_disk, overlap, count, rng):
    columns = Columns(2)
    columns.append(rows := rng.normal(size=(count, 2)))
    seen = [*parts(columns.array(), overlap)]
    assert (
        np.concatenate([part[: len(part) - overlap] for _, part in seen]).tolist()
        == rows[: count - overlap].tolist()
    )
    assert all(np.array_equal(part, rows[first : first + len(part)]) for first, part in seen)
    assert largest_magnitude(columns.array()) == np.abs(rows).max()


def test_columns_side_by_side_are_as_their_table(rng):
    table = rng.normal(size=(9, 4))
    lazy = SideBySide([*table.T])
    assert (len(lazy), lazy.shape, lazy.ndim) == (9, (9, 4), 2)
    keys = (slice(2, 7), slice(None), 3, -1, np.array([4, 0]), table[:, 0] > 0, (3, 1), (slice(1, 5), 2))
    for key in (
        *keys,
        (slice(None), slice(None, 3)),
        (slice(3, 1), slice(1, 3)),
        (np.array([1, 2]), slice(None, 2)),
    ):
        np.testing.assert_array_equal(np.asarray(lazy[key]), table[key])
    assert [(first, part.tolist()) for first, part in parts(lazy)] == [(0, table.tolist())]


def test_a_full_disk_is_reported(few_on_disk, full_device, monkeypatch):
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda **_: full_device.open("wb"))
    columns = Columns(1)
    with pytest.raises(
        InputError, match=r"^the temporary folder .* does not hold so long a recording \(No space left"
    ):
        for _ in range(10_000):
            columns.append(np.zeros((100, 1)))


def read(path: Path) -> list[tuple[int, list[str]]]:
    return [*csv_table.csv_rows(path, csv_table.line_blocks(path))]


def test_rows_have_the_numbers_of_the_lines_at_which_they_end(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text('a,b\n\n1,"2\n3"\n,\n \n4\n')
    assert read(path) == [(1, ["a", "b"]), (4, ["1", "2\n3"]), (5, ["", ""]), (7, ["4"])]


def test_rows_at_the_limits_are_read(tmp_path, monkeypatch):
    monkeypatch.setattr(csv_table, "MOST_ROWS", 3)
    path = tmp_path / "x.csv"
    path.write_text(
        "1\n" + "x" * (csv_table.MOST_CHARACTERS - 1) + "\n" + "," * (csv_table.MOST_CELLS - 1) + "\n"
    )
    assert [len(cells) for _, cells in read(path)] == [1, 1, csv_table.MOST_CELLS]


@pytest.mark.parametrize("block", [8, 3000, 1 << 20])
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1\n2\n3\n4\n", "{path} has over 3 lines; that is too many"),
        (
            "1\n" + "x" * (csv_table.MOST_CHARACTERS + 1) + "\n",
            "{path}, line 2: over 20000 characters, which no line may have",
        ),
        ("1\n2\n" + "," * 1000, "{path}, line 3: 1001 cells; at most 1000 are allowed"),
    ],
)
def test_rows_beyond_the_limits_are_refused(text, said, block, tmp_path, monkeypatch):
    monkeypatch.setattr(csv_table, "MOST_ROWS", 3)
    monkeypatch.setattr(csv_table, "_BLOCK", block)
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(InputError) as refusal:
        read(path)
    assert str(refusal.value) == said.format(path=path)


@pytest.mark.long
def test_an_endless_line_is_refused():
    """The device never ends a line, nor itself."""
    with pytest.raises(InputError, match="zero bytes"):
        next(csv_table.line_blocks(Path("/dev/zero")))


def test_blocks_are_read_lazily(tmp_path, monkeypatch):
    monkeypatch.setattr(csv_table, "_BLOCK", 5)
    path = tmp_path / "x.csv"
    path.write_text("1\n2\n3\n4\n5\n")
    blocks = csv_table.line_blocks(path)
    assert next(blocks) == (1, 2, b"1\n2\n")
    with path.open("a") as file:
        file.write("6")
    assert [*blocks] == [(3, 3, b"3\n4\n5\n"), (6, 1, b"6\n")]
