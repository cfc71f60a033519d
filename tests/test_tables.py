"""The five tables against the thesis and against the figures that its formulas give."""

from __future__ import annotations

import numpy as np
import pytest

from strapgen.tables import TABLES, agrees, entries

# What an independent program computed from the thesis's equations, in double precision: orders 1, 2, 4.
REPRODUCED = {
    1: {"dcm": (1, 0.5, 1.190e-5), "euler": (0.25, 0.125, 7.439e-7)},
    2: {"dcm": (1, 0.5, 3.572e-5), "euler": (0.25, 0.125, 2.233e-6)},
    3: {"dcm": (1, 1, 1), "euler": (1, 0.25, 0.0625)},
    4: {"dcm": (1, 7.16e-3, 3.07e-9), "euler": (1, 2.75e-3, 1.66e-10)},
    5: {"dcm": (1, 0.436, 1.87e-5), "euler": (0.662, 0.156, 2.30e-7)},
}
BASE_DEG = {1: 0.2855, 2: 0.856, 4: 6.251e-2, 5: 1.026}
ORDERS = (1, 2, 4)

# Two figures stand nearer to the round-off of double precision than the rest.
LOOSER = {(4, "dcm", 4): 0.03, (4, "euler", 4): 0.15, (1, "dcm", 4): 0.03, (1, "euler", 4): 0.03}


@pytest.mark.parametrize("table", TABLES, ids=lambda table: f"table-{table.number}")
def test_tables(table, backend_name, make):
    rows = list(entries(table, backend_name))
    assert [(row.algorithm, row.order) for row in rows] == [(a, o) for a in ("dcm", "euler") for o in ORDERS]
    double = make("dcm").dtype == np.float64
    for row in rows:
        wanted = REPRODUCED[row.table][row.algorithm][ORDERS.index(row.order)]
        tolerance = LOOSER.get((row.table, row.algorithm, row.order), 0.005)
        if double:
            assert row.normalised == pytest.approx(wanted, rel=tolerance)
            assert row.agrees
        elif row.order == 4 and not (table.number == 3 and row.algorithm == "dcm"):
            # The thesis's claim about single precision: round-off takes over where truncation is small.
            assert not row.agrees
            assert row.normalised > 1.5 * wanted
    if table.number in BASE_DEG:
        # First order is far above round-off even in single precision.
        assert rows[0].drift_deg == pytest.approx(BASE_DEG[table.number], rel=0.001)


def test_the_contradiction_of_table_2_is_told(backend_name):
    noted = [row for row in entries(TABLES[1], backend_name) if "2.391" in (row.note or "")]
    assert [(row.algorithm, row.order) for row in noted] == [("dcm", 1)]
    assert "2.391" in noted[0].note
    assert noted[0].note.count("2.391") == 2, "the run without orthonormalization gives the printed figure"
    assert "0.856" in noted[0].note


@pytest.mark.parametrize(
    ("value", "printed", "same"),
    [
        (0.4356, ".44", True),
        (0.449, ".44", True),
        (0.4349, ".44", False),
        (0.4501, ".44", False),
        (0.662, ".66", True),
        (1.0026, "1", True),
        (0.98, "1", False),
        (0.25002, "1/4", True),
        (0.26, "1/4", False),
        (7.43e-7, ".75e-6", True),
        (8.2e-7, ".75e-6", False),
        (2.233e-6, ".225e-5", True),
        (2.4e-6, ".225e-5", False),
    ],
)
def test_agreement_in_the_printed_digits(value, printed, same):
    assert agrees(value, printed) is same
