"""Tables: one layout as text, comma-separated values, Markdown, LaTeX and HTML."""

from __future__ import annotations

import csv

import pytest

from strapgen.results.table import ANGLE, ERROR, Column, TextTable

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


def test_latex_has_rules_powers_of_ten_and_no_characters_that_it_reads_otherwise():
    rows = [("a_b & 50%", -0.5, 1e-12, "x < y"), ("c", None, 2, "")]
    assert TextTable(COLUMNS, rows).as_latex().splitlines() == [
        r"\begin{tabular}{lrrl}",
        r"\hline",
        r"name & drift, deg & error & most from \\",
        r"\hline",
        r"a\_b \& 50\% & $-0.5$ & $1.000 \cdot 10^{-12}$ & x $<$ y \\",
        r"c & - & $2.000 \cdot 10^{0}$ &  \\",
        r"\hline",
        r"\end{tabular}",
    ]


def test_latex_has_a_second_table_for_columns_that_a_page_does_not_hold():
    columns = [Column("name", "<"), *(Column(f"a long column {k}") for k in range(8))]
    text = TextTable(columns, [("x", *range(8))]).as_latex()
    assert text.count(r"\begin{tabular}") == 3
    assert text.count("name &") == 3 and text.count("a long column 7") == 1


def test_latex_has_another_table_for_rows_that_a_page_does_not_hold():
    text = TextTable([Column("name", "<"), Column("n")], [("x", n) for n in range(100)]).as_latex()
    assert text.count(r"\begin{tabular}{lr}") == 3 and text.count("name & n") == 3
    assert all(f"x & {n} " in text for n in range(100))


def test_html_says_what_the_cells_say():
    text = TextTable(COLUMNS, [("<b>", 0.5, 1e-12, "")]).as_html("a caption & more")
    assert "&lt;b&gt;" in text and "<b>" not in text and "a caption &amp; more" in text
    assert '<td style="text-align:right">1.000e-12</td>' in text
    assert text.count("<th ") == 4
