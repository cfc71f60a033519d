"""Rows of recorded files: numpy reads blocks of plain ones, and the result is that of reading each by itself."""

from __future__ import annotations

import tempfile
import tracemalloc
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings import recorded_rows, recording
from strapgen.lab.recordings.recorded_header import ColumnLayout, named_layout
from strapgen.lab.recordings.recorded_rows import LineNumbers, read_rows

NAMES = ("t", "dx", "dy", "dz")


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


PLAIN = st.sampled_from(
    ["0", "1.5", "-2e-3", " 3 ", "+4", ".5", "1e400", "1_0", "nan", "", "x", "0x1p3", "٣", '"7"', '"8\n"']
)
ROWS = st.lists(PLAIN, min_size=3, max_size=6).map(",".join) | st.sampled_from(
    ["", " ", "t,dx,dy,dz", "dz,dy,dx,t"]
)


@given(st.lists(ROWS, max_size=30), st.sampled_from(["\n", "\r\n", "\r"]))
def test_a_block_is_read_as_its_rows_are(lines, end):
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


READERS = {
    "increments": recording.read_increments,
    "rates": lambda path: recording.read_rates(path, "deg/s"),
    "resampled": lambda path: recording.read_rates(path, "deg/s", 300),
}


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
        assert isinstance(data.increments, np.memmap)
    # The greatest part of a block may be a little larger; a byte for each row more would be 20 kB.
    assert peaks[1] - peaks[0] < 20_000, peaks


@pytest.mark.long
@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_a_recording_on_the_disk_has_the_bits_of_one_in_memory(read, tmp_path, request):
    path = long_file(tmp_path / "gyro.csv", 5_000)
    in_memory = read(path)
    request.getfixturevalue("on_disk")
    data = read(path)
    assert isinstance(data.increments, np.memmap) and not isinstance(in_memory.increments, np.memmap)
    assert (data.start, data.interval, data.largest) == (
        in_memory.start,
        in_memory.interval,
        in_memory.largest,
    )
    np.testing.assert_array_equal(data.increments, in_memory.increments)


@pytest.mark.long
@pytest.mark.parametrize("hz", [3, 999, 1000, 7777])
def test_resampling_in_parts_has_the_bits_of_all_at_once(hz, tmp_path, request):
    path = long_file(tmp_path / "gyro.csv", 2_500)
    at_once = recording.read_rates(path, "rad/s", hz).increments
    request.getfixturevalue("on_disk")
    np.testing.assert_array_equal(recording.read_rates(path, "rad/s", hz).increments, at_once)


def test_points_of_the_grid_on_last_rows_of_parts_have_the_bits_of_all_at_once(rng, tmp_path, monkeypatch):
    """The sum of whole intervals rounds otherwise than a piece up to a row: the part that begins there has it."""
    path = tmp_path / "gyro.csv"
    rates = rng.normal(size=(200, 3)).tolist()
    path.write_text("".join(f"{k / 64},{x},{y},{z}\n" for k, (x, y, z) in enumerate(rates)))
    at_once = recording.read_rates(path, "rad/s", 64).increments
    for module in (recorded_rows, recording):
        monkeypatch.setattr(module, "PART", 4)
    np.testing.assert_array_equal(recording.read_rates(path, "rad/s", 64).increments, at_once)
