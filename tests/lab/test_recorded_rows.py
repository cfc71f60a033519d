"""Rows of recorded files: numpy reads blocks of plain ones, and the result is that of reading each by itself."""

from __future__ import annotations

import tempfile
import tracemalloc
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strapgen.lab.recordings.recorded_header import ColumnLayout, named_layout

from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings import recorded_rows, recording
from strapgen.lab.recordings.recorded_rows import (
    Columns,
    LineNumbers,
    SampleIntervals,
    largest_magnitude,
    parts,
    read_rows,
)

NAMES = ("t", "dx", "dy", "dz")

PLAIN = st.sampled_from(
    ["0", "1.5", "-2e-3", " 3 ", "+4", ".5", "1e400", "1_0", "nan", "", "x", "0x1p3", "٣", '"7"', '"8\n"']
)
ROWS = st.lists(PLAIN, min_size=3, max_size=6).map(",".join) | st.sampled_from(
    ["", " ", "t,dx,dy,dz", "dz,dy,dx,t"]
)

READERS = {
    "increments": recording.read_increments,
    "rates": lambda path: recording.read_rates(path, "deg/s"),
    "resampled": lambda path: recording.read_rates(path, "deg/s", 300),
}

steps = st.floats(1e-300, 1e300) | st.sampled_from([1e-3, 1e-3 * (1 + 1e-15), 2e-3])


def find(header: Sequence[str] | None, width: int) -> ColumnLayout:
    """Return the layout of a file of increments, whose times are in s."""
    layout = named_layout(header, width, NAMES, ("s", "rad", "rad", "rad"))
    return replace(layout, time_unit="s")


def outcome(path: Path) -> object:
    """Return what a file holds, or why it is refused."""
    try:
        rows, _ = read_rows(path, find)
    except InputError as error:
        return str(error)
    count = len(rows.time)
    return rows.time.tolist(), rows.values.tolist(), [rows.lines[k] for k in range(count)]


@given(st.lists(ROWS, max_size=30), st.sampled_from(["\n", "\r\n", "\r"]))
def test_blocks_equal_single_rows(lines, end):
    path = Path(tempfile.gettempdir()) / f"rows-{np.random.default_rng().integers(1 << 60)}.csv"
    good = [f"{k},{k},{k},{k}" for k in range(4)]
    path.write_bytes(end.join([*good, *lines, *good, ""]).encode())
    try:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(recorded_rows, "_BLOCK", 3)
            by_block = outcome(path)
            patch.setattr(recorded_rows._Reading, "_plain", lambda self, block: None)
            assert outcome(path) == by_block
    finally:
        path.unlink()


def test_most_blocks_are_read_by_numpy(tmp_path, monkeypatch):
    monkeypatch.setattr(recorded_rows, "_BLOCK", 10)
    path = tmp_path / "gyro.csv"
    path.write_text("t,dz,dy,dx\n" + "".join(f"{k},3,2,1\n" for k in range(100)))
    plain, taken = recorded_rows._Reading._plain, []
    monkeypatch.setattr(
        recorded_rows._Reading,
        "_plain",
        lambda self, block: taken.append(numbers := plain(self, block)) or numbers,
    )
    rows, _ = read_rows(path, find)
    assert len(taken) == 11 and all(numbers is not None for numbers in taken)
    assert rows.values.tolist() == [[1, 2, 3]] * 100
    assert [rows.lines[k] for k in (0, 8, 9, 99)] == [2, 10, 11, 101]


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
    monkeypatch.setattr(recorded_rows, "_IN_MEMORY", 1000)
    for module in (recorded_rows, recording):
        monkeypatch.setattr(module, "PART", 1000)
    monkeypatch.setattr(recorded_rows, "_BLOCK", 1000)


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


@pytest.mark.long
@pytest.mark.parametrize("hz", [3, 999, 1000, 7777])
def test_resampling_in_parts_gives_the_same_bits(hz, tmp_path, request):
    path = long_file(tmp_path / "gyro.csv", 2_500)
    at_once = recording.read_rates(path, "rad/s", hz).samples
    request.getfixturevalue("on_disk")
    np.testing.assert_array_equal(recording.read_rates(path, "rad/s", hz).samples, at_once)


def test_grid_points_at_part_boundaries_give_the_same_bits(rng, tmp_path, monkeypatch):
    """The sum of whole intervals rounds otherwise than a piece up to a row: the part that begins there has it."""
    path = tmp_path / "gyro.csv"
    rates = rng.normal(size=(200, 3)).tolist()
    path.write_text("".join(f"{k / 64},{x},{y},{z}\n" for k, (x, y, z) in enumerate(rates)))
    at_once = recording.read_rates(path, "rad/s", 64).samples
    for module in (recorded_rows, recording):
        monkeypatch.setattr(module, "PART", 4)
    np.testing.assert_array_equal(recording.read_rates(path, "rad/s", 64).samples, at_once)


@pytest.fixture
def few_on_disk(monkeypatch, tmp_path):
    """Keep all but the shortest columns on the disk, and work on few rows together."""
    monkeypatch.setattr(recorded_rows, "_IN_MEMORY", 10)
    monkeypatch.setattr(recorded_rows, "PART", 4)
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


def test_a_full_disk_is_reported(few_on_disk, monkeypatch):
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda **_: open("/dev/full", "wb"))  # noqa: SIM115, PTH123
    columns = Columns(1)
    with pytest.raises(
        InputError, match=r"^the temporary folder .* does not hold so long a recording \(No space left"
    ):
        for _ in range(10_000):
            columns.append(np.zeros((100, 1)))


@given(st.lists(steps, min_size=1, max_size=40))
def test_interval_statistics_agree_with_numpy(numbers):
    time = np.cumsum([0.0, *numbers])
    exact = np.diff(time)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recorded_rows, "PART", 3)
        intervals = SampleIntervals(time)
        if intervals.shortest[0] <= 0:
            return  # refused before it is used
        assert intervals.median() == np.median(exact)
        assert intervals.shortest == (exact.min(), exact.argmin())
        assert intervals.longest == (exact.max(), exact.argmax())
        departures = np.abs(exact - 1e-3)
        assert intervals.farthest(1e-3) == (departures.max(), departures.argmax())


def read(path: Path) -> list[tuple[int, list[str]]]:
    return [*recorded_rows.csv_rows(path, chain.from_iterable(recorded_rows.line_blocks(path)))]


def test_rows_have_the_numbers_of_the_lines_at_which_they_end(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text('a,b\n\n1,"2\n3"\n,\n \n4\n')
    assert read(path) == [(1, ["a", "b"]), (4, ["1", "2\n3"]), (5, ["", ""]), (7, ["4"])]


def test_rows_at_the_limits_are_read(tmp_path, monkeypatch):
    monkeypatch.setattr(recorded_rows, "MOST_ROWS", 3)
    path = tmp_path / "x.csv"
    path.write_text(
        "1\n" + "x" * (recorded_rows.MOST_CHARACTERS - 1) + "\n" + "," * (recorded_rows.MOST_CELLS - 1) + "\n"
    )
    assert [len(cells) for _, cells in read(path)] == [1, 1, recorded_rows.MOST_CELLS]


@pytest.mark.parametrize("block", [1, 2, 8192])
@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1\n2\n3\n4\n", "{path} has over 3 lines; that is too many"),
        (
            "1\n" + "x" * recorded_rows.MOST_CHARACTERS + "\n",
            "{path}, line 2: over 20000 characters, which no line may have",
        ),
        ("1\n2\n" + "," * 1000, "{path}, line 3: 1001 cells; at most 1000 are allowed"),
    ],
)
def test_rows_beyond_the_limits_are_refused(text, said, block, tmp_path, monkeypatch):
    monkeypatch.setattr(recorded_rows, "MOST_ROWS", 3)
    monkeypatch.setattr(recorded_rows, "_BLOCK", block)
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(InputError) as refusal:
        read(path)
    assert str(refusal.value) == said.format(path=path)


@pytest.mark.long
def test_an_endless_line_is_refused():
    """The device never ends a line, nor itself."""
    with pytest.raises(InputError, match="line 1: over 20000 characters"):
        next(recorded_rows.line_blocks(Path("/dev/zero")))


def test_blocks_are_read_lazily(tmp_path, monkeypatch):
    monkeypatch.setattr(recorded_rows, "_BLOCK", 2)
    path = tmp_path / "x.csv"
    path.write_text("1\n2\n3\n4\n5\n")
    blocks = recorded_rows.line_blocks(path)
    assert next(blocks) == ["1\n", "2\n"]
    with path.open("a") as file:
        file.write("6\n")
    assert [*blocks] == [["3\n", "4\n"], ["5\n", "6\n"]]
