"""Tables: one layout as text, comma-separated values and Markdown."""

from __future__ import annotations

import csv

import pytest

from strapgen.reports.table import ANGLE, ERROR, Column, TextTable

COLUMNS = (
    Column("name", "<"),
    Column("drift, deg", spec=ANGLE),
    Column("error", spec=ERROR, gap=4),
    Column("most from", "<"),
)
ROWS = (("euler", 0.123456, 1e-12, "rounding"), ("two-speed", None, 2, ""))


def test_columns_are_as_wide_as_their_widest_cell():
    assert TextTable(COLUMNS, ROWS).lines() == [
        "name       drift, deg        error  most from",
        "euler           0.123    1.000e-12  rounding",
        "two-speed           -    2.000e+00",
    ]


def test_no_line_ends_in_spaces_and_all_have_the_indent():
    text = TextTable(COLUMNS, ROWS).as_text("  ")
    assert all(line == "  " + line.strip() for line in text.splitlines())


def test_a_table_without_headers_has_rows_alone():
    rows = [("a", 1), ("long", 20)]
    assert TextTable([Column(align="<"), Column()], rows).lines() == ["a      1", "long  20"]
    assert TextTable([Column(align="<"), Column()], []).lines() == []


def test_a_wide_cell_widens_its_column_in_every_row_and_under_its_title():
    columns = [
        Column("s", spec=".0f", least=2, group="t"),
        *(Column(a, least=3, gap=gap, group="rate") for a, gap in (("x", 2), ("y", 1))),
    ]
    assert TextTable(columns, [(1, 2, 3)]).lines() == [" t   rate", " s    x   y", " 1    2   3"]
    assert TextTable(columns, [(1, 2, 3), (1000, 2, 3)]).lines() == [
        "   t   rate",
        "   s    x   y",
        "   1    2   3",
        "1000    2   3",
    ]


def test_csv_has_numbers_in_full_and_an_empty_cell_for_none():
    read = list(csv.reader(TextTable(COLUMNS, ROWS).as_csv().splitlines()))
    assert read == [
        ["name", "drift, deg", "error", "most from"],
        ["euler", "0.123456", "1e-12", "rounding"],
        ["two-speed", "", "2", ""],
    ]


def test_markdown_has_the_cells_of_the_text_and_their_alignment():
    lines = (
        TextTable((*COLUMNS, Column("x", "^", group="rate")), [(*ROWS[0], "a|b")]).as_markdown().splitlines()
    )
    assert lines == [
        "| name | drift, deg | error | most from | rate x |",
        "| :-- | --: | --: | :-- | :-: |",
        r"| euler | 0.123 | 1.000e-12 | rounding | a\|b |",
    ]


@pytest.mark.parametrize("row", [("euler",), ("euler", 1, 2, "rounding", "more")])
def test_a_row_that_does_not_fit_its_columns_is_refused(row):
    with pytest.raises(ValueError, match=r"zip"):
        TextTable(COLUMNS, [row]).lines()
