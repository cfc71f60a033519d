"""Text files of comma-separated values: read within bounds, and never whole."""

from __future__ import annotations

from itertools import chain
from pathlib import Path

import pytest

from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings import recorded_rows


def read(path: Path) -> list[tuple[int, list[str]]]:
    return [*recorded_rows.csv_rows(path, chain.from_iterable(recorded_rows.line_blocks(path)))]


def test_rows_have_the_numbers_of_the_lines_at_which_they_end(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text('a,b\n\n1,"2\n3"\n,\n \n4\n')
    assert read(path) == [(1, ["a", "b"]), (4, ["1", "2\n3"]), (5, ["", ""]), (7, ["4"])]


def test_what_is_at_the_bounds_is_read(tmp_path, monkeypatch):
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
def test_what_is_beyond_bounds_is_refused_in_one_line(text, said, block, tmp_path, monkeypatch):
    monkeypatch.setattr(recorded_rows, "MOST_ROWS", 3)
    monkeypatch.setattr(recorded_rows, "_BLOCK", block)
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(InputError) as refusal:
        read(path)
    assert str(refusal.value) == said.format(path=path)


@pytest.mark.long
def test_a_line_without_an_end_is_not_read_to_its_end():
    """The device never ends a line, nor itself."""
    with pytest.raises(InputError, match="line 1: over 20000 characters"):
        next(recorded_rows.line_blocks(Path("/dev/zero")))


def test_no_more_is_read_than_is_used(tmp_path, monkeypatch):
    monkeypatch.setattr(recorded_rows, "_BLOCK", 2)
    path = tmp_path / "x.csv"
    path.write_text("1\n2\n3\n4\n5\n")
    blocks = recorded_rows.line_blocks(path)
    assert next(blocks) == ["1\n", "2\n"]
    with path.open("a") as file:
        file.write("6\n")
    assert [*blocks] == [["3\n", "4\n"], ["5\n", "6\n"]]
