"""Predicts the tables of the thesis from error series and sets them beside simulations."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from strapgen import catalogue
from strapgen.analysis.ratios import Claim, claims_text
from strapgen.analysis.series.prediction import Prediction, predict
from strapgen.lab.motions.motions import motion
from strapgen.lab.runs import simulate
from strapgen.results.records import Properties, Record, entry, properties
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.run.backends import backend
from strapgen.thesis.tables_report import repair_notes
from strapgen.thesis.thesis_tables import (
    ALGORITHMS,
    DURATION,
    INTERVAL,
    ORDERS,
    STEP,
    TABLES,
    Table,
    agrees,
    drift_deg,
    printed_number,
)

_COLUMNS = (
    Column("", "<", least=20),
    Column("predicted", spec=".4g", least=9),
    Column("simulated", spec=".4g", least=9),
    Column("ratio", spec=".4g", least=10),
    Column("simulated", spec=".4g", least=9),
    Column("off by", spec="+.2%", least=7),
    Column("thesis", least=8),
    Column("", "<", gap=1),
    Column("scan", least=7, missing=""),
)


@dataclass(frozen=True)
class PredictedEntry(Record):
    """One figure of a table."""

    computed: ClassVar[Properties] = properties(thesis_printed=entry(), deviation=entry())

    table: int
    algorithm: str
    #: Order of the integration
    order: int
    #: Predicted drift in degrees, and its ratio to that of the direction cosine matrix, as in the table
    drift_deg: float
    normalised: float
    #: The same two numbers from a run in numpy
    simulated_deg: float
    simulated: float
    #: The ratio as the thesis prints it
    thesis: str = field(metadata=entry(write=printed_number, kind=float))
    #: Whether `normalised` has the printed digits
    agrees: bool
    #: As for `TableEntry`
    scan: str | None = None
    repairs: tuple[str, ...] = ()

    @property
    def agrees_simulated(self) -> bool:
        """Whether `simulated` has the printed digits."""
        return agrees(self.simulated, self.thesis)

    @property
    def deviation(self) -> float:
        """Relative difference of the predicted ratio from the simulated one."""
        return self.normalised / self.simulated - 1

    @property
    def thesis_printed(self) -> str:
        """The figure as the thesis prints it."""
        return self.thesis


def predicted(tables: Sequence[Table] = TABLES) -> Iterator[PredictedEntry]:
    """Predict tables from two powers of the error rate, and compare them with the simulation."""
    for table in tables:
        profile = motion(table.motion, **table.settings)
        drifts, runs = {}, {}
        for algorithm in ALGORITHMS:
            for order in ORDERS:
                choice = catalogue.choose(algorithm, f"rk{order}", 2)
                expected = predict(choice, profile, STEP, DURATION, INTERVAL, INTERVAL)
                drifts[algorithm, order] = _drift_deg(table, expected)
                stepper = backend(algorithm, f"rk{order}", 2, "numpy")
                runs[algorithm, order] = drift_deg(
                    table, simulate(stepper, profile, STEP, DURATION, INTERVAL, INTERVAL)
                )
                base = ("dcm", order if table.by_order else 1)
                printed = table.printed[algorithm][ORDERS.index(order)]
                normalised = drifts[algorithm, order] / drifts[base]
                yield PredictedEntry(
                    table.number,
                    algorithm,
                    order,
                    drifts[algorithm, order],
                    normalised,
                    runs[algorithm, order],
                    runs[algorithm, order] / runs[base],
                    printed,
                    agrees(normalised, printed),
                    None if (repair := table.repair(algorithm, order)) is None else repair.scan,
                    tuple(each.sentence for each in table.repairs_behind(algorithm, order)),
                )


def _drift_deg(table: Table, expected: Prediction) -> float:
    """Return the drift of a prediction as the table reports it."""
    return math.degrees(expected.mean_drift if table.mean else max(expected.drift_by_axis))


def predicted_text(entries: Sequence[PredictedEntry]) -> str:
    """Return predicted tables as text."""
    lines = []
    for table in TABLES:
        rows = [_cells(entry) for entry in entries if entry.table == table.number]
        if not rows:
            continue
        ratio = "of the same order" if table.by_order else "of first order"
        lines += [
            f"Table {table.number}: {table.title}",
            f"  drift in deg, and its ratio to that of direction cosines {ratio}",
            *TextTable(_COLUMNS, rows).lines("  "),
            *repair_notes(table),
            "",
        ]
    if not all(entry.agrees for entry in entries):
        lines.append("* not the thesis's figure in its printed digits\n")
    return "\n".join(lines)


@dataclass(frozen=True)
class PredictedTablesResult(Result):
    """The tables of the thesis as the series predict them, and the ratios that the thesis reads from them."""

    rows_in = "entries"
    drawn_by: ClassVar[str] = "strapgen.thesis.tables_report:predicted_tables_image"

    entries: Sequence[PredictedEntry]
    ratios: Sequence[Claim]

    def text(self) -> str:
        """Return the tables and the ratios."""
        return f"{predicted_text(self.entries)}\n{claims_text(self.ratios)}"


def _cells(entry: PredictedEntry) -> tuple[str | float | None, ...]:
    return (
        f"{entry.algorithm}, order {entry.order}",
        entry.drift_deg,
        entry.simulated_deg,
        entry.normalised,
        entry.simulated,
        entry.deviation,
        entry.thesis,
        "" if entry.agrees else "*",
        entry.scan,
    )
