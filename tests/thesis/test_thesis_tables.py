"""The five tables against the thesis and against the figures that its formulas give."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from languages import OTHERS, cases
from tolerances import roundoff

import strapgen
from strapgen.run.backends import BACKENDS
from strapgen.thesis import thesis_tables
from strapgen.thesis.predicted_tables import predicted, predicted_text
from strapgen.thesis.tables_report import thesis_table_text
from strapgen.thesis.thesis_tables import (
    ALGORITHMS,
    ORDERS,
    TABLES,
    TableEntry,
    agrees,
    build_all,
    entries,
    table_settings,
)

# What an independent program computed from the thesis's equations, in double precision: orders 1, 2, 4.
REPRODUCED = {
    1: {"dcm": (1, 0.5, 1.190e-5), "euler": (0.25, 0.125, 7.439e-7)},
    2: {"dcm": (1, 0.5, 3.572e-5), "euler": (0.25, 0.125, 2.233e-6)},
    3: {"dcm": (1, 1, 1), "euler": (1, 0.25, 0.0625)},
    4: {"dcm": (1, 7.16e-3, 3.07e-9), "euler": (1, 2.75e-3, 1.66e-10)},
    5: {"dcm": (1, 0.436, 1.87e-5), "euler": (0.662, 0.156, 2.30e-7)},
}
BASE_DEG = {1: 0.2855, 2: 0.856, 4: 6.251e-2, 5: 1.026}

#: A table takes arithmetic of 40 digits a quarter of a minute.
LONG_RUNS = [
    *cases(name for name in BACKENDS if name not in (*OTHERS, "exact")),
    pytest.param("exact", marks=pytest.mark.long),
]

# Two figures stand nearer to the round-off of double precision than the rest.
LOOSER = {(4, "dcm", 4): 0.03, (4, "euler", 4): 0.15, (1, "dcm", 4): 0.03, (1, "euler", 4): 0.03}

TABLE = TABLES[0]


def certify(table, rows, backend_name):
    """Hold the rows of a fixed-point back end against those in double, by the certified bound of its rounding."""
    for row, double in zip(rows, entries(table, "numpy"), strict=True):
        assert (row.algorithm, row.order) == (double.algorithm, double.order)
        settings = table_settings(table, backend_name, None)
        backend = strapgen.backend(row.algorithm, f"rk{row.order}", 2, backend_name, settings=settings)
        # The drift is half the difference of two elements of the error matrix, which is off by twice as much as the
        # state; a mean drift is the length of three.
        allowed = math.degrees(2 * math.sqrt(3) * roundoff(backend, 1440, 36))
        apart = abs(row.drift_deg - double.drift_deg)
        assert apart <= allowed
        assert row.roundoff_dominates == (apart > double.drift_deg / 2)
        if backend_name != "c-fixed16" and row.order < 4:
            assert not row.roundoff_dominates and row.agrees


@pytest.mark.parametrize("backend_name", LONG_RUNS, indirect=True)
@pytest.mark.parametrize("table", TABLES, ids=lambda table: f"table-{table.number}")
def test_tables(table, backend_name, make):
    rows = list(entries(table, backend_name))
    if BACKENDS[backend_name].fixed:
        certify(table, rows, backend_name)
        return
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


@pytest.mark.parametrize("backend_name", LONG_RUNS, indirect=True)
def test_the_contradiction_of_table_2_is_noted(backend_name):
    noted = [row for row in entries(TABLES[1], backend_name) if "2.391" in (row.note or "")]
    assert [(row.algorithm, row.order) for row in noted] == [("dcm", 1)]
    assert "2.391" in noted[0].note
    if BACKENDS[backend_name].fixed:
        assert "not in this format" in noted[0].note, "the matrix grows to more than twice its size"
        return
    assert noted[0].note.count("2.391") == 2, "the run without orthonormalization gives the printed figure"
    assert "0.856" in noted[0].note


def test_every_repair_of_the_scan_is_disclosed():
    repaired = {
        (table.number, each.figure): each.scan for table in TABLES for each in table.repairs if each.algorithm
    }
    assert repaired == {
        (1, ".75e-6"): ".75e-?",
        (2, ".36e-4"): ".26e-4",
        (2, ".225e-5"): ".225e-?",
        (4, ".30e-8"): ".30e-3",
        (5, ".23e-6"): ".23e-?",
    }
    for table in TABLES:
        for repair in table.repairs:
            if repair.algorithm:
                assert table.printed[repair.algorithm][ORDERS.index(repair.order)] == repair.figure
    motions = {
        table.number: [repair.scan for repair in table.repairs if not repair.algorithm] for table in TABLES
    }
    assert motions == {1: [], 2: [], 3: [], 4: ["b = .1", "-a sin bt"], 5: ["-a sin bt"]}


def test_a_figure_that_is_not_reproduced_is_marked():
    """The scan of table 4 reads .30e-3 where .30e-8 comes out; the figures beside it agree."""
    table = TABLES[3]
    first, second, _ = table.printed["dcm"]
    scanned = replace(table, printed=table.printed | {"dcm": (first, second, ".30e-3")})
    told = {(row.algorithm, row.order): row.agrees for row in entries(scanned, "numpy")}
    assert [place for place, agreed in told.items() if not agreed] == [("dcm", 4)]


@pytest.mark.parametrize("table", [TABLES[1], TABLES[3]], ids=lambda table: f"table-{table.number}")
def test_entries_have_the_text_of_the_scan(table):
    rows = list(entries(table, "numpy"))
    assert {row.thesis: row.scan for row in rows if row.scan} == {
        each.figure: each.scan for each in table.repairs if each.algorithm
    }
    behind = sum(not each.algorithm for each in table.repairs)
    assert all(len(row.repairs) == behind + bool(row.scan) for row in rows)
    assert all(row.as_dict()["scan"] == row.scan for row in rows)


@pytest.mark.parametrize(
    ("repaired", "unrepaired"),
    [
        ({"a_deg_s": 1, "b_deg_s": 1, "g_deg_s": 1}, {"b_deg_s": 0.1}),
        ({"a_deg_s": 1, "b_deg_s": 1, "g_deg_s": 1}, {"b_deg_s": -1}),
    ],
    ids=["rate", "sign"],
)
def test_the_scanned_settings_of_table_4_are_not_reproduced(repaired, unrepaired):
    backend = strapgen.backend("dcm", "rk1", 2)
    base, other = (
        math.degrees(strapgen.simulate(backend, strapgen.motion("coning", **s), "1/8", 180, 5, 5).mean_drift)
        for s in (repaired, repaired | unrepaired)
    )
    assert base == pytest.approx(0.0625, abs=5e-5)
    assert other == pytest.approx({0.1: 0.00942, -1: 0.140}[unrepaired["b_deg_s"]], rel=0.01)


def test_ten_seconds_between_orthonormalizations_agree_too():
    rows = [row for table in TABLES for row in entries(table, "numpy", interval=Fraction(10))]
    assert all(row.agrees for row in rows), "the tables cannot decide between 5 s and 10 s"
    last = {(row.algorithm, row.order): row.normalised for row in rows if row.table == 5}
    wanted = {("dcm", 2): 0.4355, ("dcm", 4): 1.869e-5, ("euler", 1): 0.6619, ("euler", 2): 0.1557}
    for place, value in (wanted | {("euler", 4): 2.258e-7}).items():
        assert last[place] == pytest.approx(value, rel=5e-4)


@pytest.mark.parametrize(
    ("table", "base"), [(TABLES[0], 0.288), (TABLES[4], 1.064)], ids=["one-axis", "coning"]
)
def test_records_between_orthonormalizations_are_not_reproduced(table, base):
    backend = strapgen.backend("dcm", "rk1", 2)
    motion = strapgen.motion(table.motion, **table.settings)
    between = strapgen.simulate(backend, motion, "1/8", 180, 5)
    drift = thesis_tables.drift_deg(table, between)
    assert drift == pytest.approx(base, abs=5e-4)
    assert not -5e-4 <= drift - float(table.base) < 1e-3


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


def test_the_kernels_of_a_back_end_are_compiled_together(monkeypatch):
    calls = []
    monkeypatch.setattr(thesis_tables, "compile_together", lambda many: calls.append(list(many)))
    kernels = [f"{algorithm}-rk{order}-2" for algorithm in ("dcm", "euler") for order in ORDERS]
    assert list(build_all(("c", "c-fixed32"), tables=TABLES[4:])) == kernels * 2
    beside = {"dcm-orthonormalize", "euler-normalize"}
    for sources, target in zip(calls, ("c", "c-fixed"), strict=True):
        assert {each.kernel for each in sources} == {*kernels, *beside}
        assert {each.target for each in sources} == {target}
        assert len({name for each in sources for name in each.files}) == 4 * 8  # no name twice: one module


def made(backend: str, **rest: object) -> list[TableEntry]:
    return [
        TableEntry(
            TABLE.number, backend, algorithm, order, 0.125 / order, 0.5, "0.5", **{"agrees": True, **rest}
        )
        for algorithm in ALGORITHMS
        for order in ORDERS
    ]


@pytest.mark.parametrize("backend", ["c", "fixed-model", "a-back-end-of-a-long-name"])
def test_figures_end_under_their_heads_and_orders(backend):
    lines = thesis_table_text(TABLE, made(backend)).splitlines()
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
    text = thesis_table_text(TABLE, made("c"))
    assert "not the thesis's figure" not in text
    assert "round-off" not in text
    text = thesis_table_text(TABLE, [*made("c", agrees=False), *made("d", roundoff_dominates=True)])
    assert "0.5*" in text
    assert "0.5r" in text
    assert "* not the thesis's figure in its printed digits" in text
    assert "r round-off dominates" in text


def test_note_appears_once_for_all_back_ends():
    both = [*made("c", note="A repaired figure."), *made("d", note="A repaired figure of d.")]
    text = thesis_table_text(TABLE, both)
    assert text.count("A repaired figure.") == len(ALGORITHMS) * len(ORDERS)
    assert "figure of d" not in text


def test_a_repaired_figure_has_the_text_of_the_scan_below_it_and_the_reason():
    lines = thesis_table_text(TABLE, made("c")).splitlines()
    (place,) = (k for k, line in enumerate(lines) if line.split()[:1] == ["scan"])
    assert lines[place].split()[1:] == [".75e-?"]
    assert lines[place - 1].split() == ["thesis", ".25", ".125", ".75e-6"]
    assert lines[place].index(".75e-?") == lines[place - 1].index(".75e-6")
    assert ".75e-6 is repaired, the scan reads .75e-?" in "\n".join(lines)
    unrepaired = thesis_table_text(TABLES[2], [])
    assert "scan" not in unrepaired


@pytest.mark.long
@pytest.mark.parametrize("table", TABLES, ids=lambda table: str(table.number))
def test_every_figure_is_predicted(table):
    """Within 0.3 % of the simulation, where 1 % and 3 % are asked for; the thesis's digits too."""
    found = list(predicted([table]))
    for entry in found:
        assert abs(entry.deviation) < 3e-3, entry
        assert abs(entry.drift_deg / entry.simulated_deg - 1) < 3e-3, entry
        assert entry.agrees, entry
    assert f"Table {table.number}" in predicted_text(found)
