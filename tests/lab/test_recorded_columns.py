"""Columns of numbers: what is on the disk is what would be in memory."""

from __future__ import annotations

import tempfile

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings import recorded_rows
from strapgen.lab.recordings.recorded_rows import Columns, SampleIntervals, largest_magnitude, parts


@pytest.fixture
def on_disk(monkeypatch, tmp_path):
    """Keep all but the shortest columns on the disk, and work on few rows together."""
    monkeypatch.setattr(recorded_rows, "_IN_MEMORY", 10)
    monkeypatch.setattr(recorded_rows, "PART", 4)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


@pytest.mark.parametrize("sizes", [[1, 2], [5], [2, 1, 9, 0, 3], [0]])
def test_rows_come_back_in_order(on_disk, sizes, rng):
    rows = [rng.normal(size=(size, 3)) for size in sizes]
    columns = Columns(3)
    for part in rows:
        columns.append(part)
    array = columns.array()
    assert isinstance(array, np.memmap) == (sum(sizes) * 3 > 10)
    np.testing.assert_array_equal(array, np.concatenate(rows))
    assert [*on_disk.iterdir()] == [], "the file has no name, and is gone with the process"


@pytest.mark.parametrize("overlap", [0, 1])
@pytest.mark.parametrize("count", [2, 4, 5, 8, 9, 13])
def test_parts_cover_all_rows(on_disk, overlap, count, rng):
    columns = Columns(2)
    columns.append(rows := rng.normal(size=(count, 2)))
    seen = [*parts(columns.array(), overlap)]
    assert (
        np.concatenate([part[: len(part) - overlap] for _, part in seen]).tolist()
        == rows[: count - overlap].tolist()
    )
    assert all(np.array_equal(part, rows[first : first + len(part)]) for first, part in seen)
    assert largest_magnitude(columns.array()) == np.abs(rows).max()


def test_a_full_disk_is_told_in_one_line(on_disk, monkeypatch):
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda **_: open("/dev/full", "wb"))  # noqa: SIM115, PTH123
    columns = Columns(1)
    with pytest.raises(
        InputError, match=r"^the temporary folder .* does not hold so long a recording \(No space left"
    ):
        for _ in range(10_000):
            columns.append(np.zeros((100, 1)))


steps = st.floats(1e-300, 1e300) | st.sampled_from([1e-3, 1e-3 * (1 + 1e-15), 2e-3])


@given(st.lists(steps, min_size=1, max_size=40))
def test_the_median_of_a_long_row_is_that_of_numpy(numbers):
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
