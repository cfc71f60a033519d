"""The thesis's tables as text: figures stand under their orders, whatever the back end is called."""

from __future__ import annotations

import re

import pytest

from strapgen.thesis.tables_report import thesis_table_text
from strapgen.thesis.thesis_tables import ALGORITHMS, ORDERS, TABLES, TableEntry

TABLE = TABLES[0]


def entries(backend: str, **rest: object) -> list[TableEntry]:
    return [
        TableEntry(
            TABLE.number, backend, algorithm, order, 0.125 / order, 0.5, "0.5", **{"agrees": True, **rest}
        )
        for algorithm in ALGORITHMS
        for order in ORDERS
    ]


@pytest.mark.parametrize("backend", ["c", "fixed-model", "a-back-end-of-a-long-name"])
def test_figures_end_under_their_heads_and_orders(backend):
    lines = thesis_table_text(TABLE, entries(backend)).splitlines()
    orders, heads = lines[2:4]
    ends = [match.end() for match in re.finditer("drift|ratio", heads)]
    assert len(ends) == 2 * len(ORDERS)
    rows = [line for line in lines if line.strip().startswith(backend)]
    assert len(rows) == len(ALGORITHMS)
    for row in rows:
        assert [match.end() for match in re.finditer(r"\S+", row)][1:] == ends
    for k, match in enumerate(re.finditer(r"order \d", orders)):
        assert ends[2 * k] < match.end() < ends[2 * k + 1]


def test_marks_are_explained_where_they_stand():
    text = thesis_table_text(TABLE, entries("c"))
    assert "not the thesis's figure" not in text
    assert "round-off" not in text
    text = thesis_table_text(TABLE, [*entries("c", agrees=False), *entries("d", roundoff_dominates=True)])
    assert "0.5*" in text
    assert "0.5r" in text
    assert "* not the thesis's figure in its printed digits" in text
    assert "r round-off dominates" in text


def test_a_note_stands_once_for_all_back_ends():
    both = [*entries("c", note="A repaired figure."), *entries("d", note="A repaired figure of d.")]
    text = thesis_table_text(TABLE, both)
    assert text.count("A repaired figure.") == len(ALGORITHMS) * len(ORDERS)
    assert "figure of d" not in text


def test_a_repaired_figure_has_the_text_of_the_scan_below_it_and_the_reason():
    lines = thesis_table_text(TABLE, entries("c")).splitlines()
    (place,) = (k for k, line in enumerate(lines) if line.split()[:1] == ["scan"])
    assert lines[place].split()[1:] == [".75e-?"]
    assert lines[place - 1].split() == ["thesis", ".25", ".125", ".75e-6"]
    assert lines[place].index(".75e-?") == lines[place - 1].index(".75e-6")
    assert ".75e-6 is repaired, the scan reads .75e-?" in "\n".join(lines)
    unrepaired = thesis_table_text(TABLES[2], [])
    assert "scan" not in unrepaired
