"""A geometry of redundant sensors as a result: parity equations, triads with their noise, failures that they tell."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from strapgen.catalogue.coefficients import Number
from strapgen.navigation.redundancy.failure_tables import FailureTable
from strapgen.navigation.redundancy.parity_equations import SensorSet, equation_label, gain_text
from strapgen.results.records import INTERNAL, entry
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable

_TRIADS = (
    Column("triad"),
    Column("sensors", "<"),
    Column("|det|", "<"),
    Column("condition", spec=".4g"),
    Column("noise x, y, z", "<"),
    Column("noise", spec=".6f"),
)


def _texts(rows: Sequence[Sequence[Number]]) -> list[list[str]]:
    return [list(map(str, row)) for row in rows]


@dataclass(frozen=True)
class TriadData:
    """Three sensors as a triad; numbers of the field of the axes are text, exact."""

    sensors: tuple[int, ...]
    determinant: Number = field(metadata=entry(kind=str))
    #: Condition of its axes
    condition: float
    inverse: Sequence[Sequence[Number]] = field(metadata=entry(kind=list[list[str]]))
    #: Squared noise in x, y and z by that of a sensor
    squared_noise: Sequence[Number] = field(metadata=entry(kind=list[str]))


@dataclass(frozen=True)
class StatusVerdict:
    """What a status of the equations says."""

    #: A 1 for each equation that fails, and a 0 for the others
    status: str
    #: The failed sensor
    failed: int | None
    #: The triad that is selected
    triad: int | None
    points: int


@dataclass(frozen=True)
class TableData:
    """The verdicts with some sensors removed."""

    removed: tuple[int, ...]
    equations: tuple[int, ...]
    verdicts: list[StatusVerdict]

    @staticmethod
    def of(table: FailureTable) -> TableData:
        """Return a table."""
        verdicts = [
            StatusVerdict(status_text(status), one.failed, one.triad, one.points)
            for status, one in table.verdicts.items()
        ]
        return TableData(tuple(table.removed), tuple(table.equations), verdicts)


@dataclass(frozen=True)
class GeometryResult(Result):
    """What redundant sensors tell of their failures; numbers of the field of the axes are text, exact."""

    sensor_set: SensorSet = field(metadata=INTERNAL)
    failure_tables: Sequence[FailureTable] = field(metadata=INTERNAL)
    name: str
    sensor: str
    range: str
    axes: Sequence[Sequence[Number]] = field(metadata=entry(write=_texts, kind=list[list[str]]))
    lengths: Sequence[Number] = field(
        metadata=entry(write=lambda lengths: list(map(str, lengths)), kind=list[str])
    )
    #: Parity equations
    equations: Sequence[Sequence[Number]] = field(metadata=entry(kind=list[list[int | str]]))
    triads: list[TriadData]
    #: The solution of all sensors by least squares
    least_squares: Sequence[Sequence[Number]] = field(metadata=entry(write=_texts, kind=list[list[str]]))
    #: Number of failures that are isolated, whichever sensors fail
    fail_operate: int
    #: Whether one more is detected
    next_is_detected: bool
    tables: list[TableData]
    #: Files that were written
    files: Sequence[Path]

    @staticmethod
    def of(sensors: SensorSet, tables: Sequence[FailureTable], files: Sequence[Path] = ()) -> GeometryResult:
        """Return the geometry of a set of sensors, and what its tables say."""
        geometry = sensors.geometry
        triads = [
            TriadData(
                tuple(triad.sensors),
                triad.determinant,
                condition,
                [list(map(str, row)) for row in triad.inverse],
                list(map(str, triad.squared_gains)),
            )
            for triad, condition in zip(geometry.triads, conditions(sensors), strict=True)
        ]
        return GeometryResult(
            sensor_set=sensors,
            failure_tables=tables,
            name=sensors.name,
            sensor=sensors.sensor,
            range=str(sensors.range),
            axes=geometry.axes,
            lengths=geometry.lengths,
            equations=geometry.equations,
            triads=triads,
            least_squares=geometry.least_squares,
            fail_operate=geometry.fail_operate,
            next_is_detected=geometry.fail_safe,
            tables=list(map(TableData.of, tables)),
            files=files,
        )

    def text(self) -> str:
        """Return equations, triads and failures for a reader."""
        return "\n".join(
            [*_lines(self.sensor_set, self.failure_tables), *(f"  {path}" for path in self.files)]
        )


def conditions(sensors: SensorSet) -> list[float]:
    """Return the condition of the axes of each triad."""
    import numpy as np

    axes = np.array(sensors.geometry.axes, float)
    return [float(np.linalg.cond(axes[list(triad.sensors)])) for triad in sensors.geometry.triads]


def _lines(sensors: SensorSet, tables: Sequence[FailureTable]) -> Iterator[str]:
    geometry = sensors.geometry
    yield f"{sensors.name}: {geometry.count} sensors, {sensors.sensor}"
    for number, axis in enumerate(geometry.axes):
        yield f"  {number}  {', '.join(map(str, axis))}"
    for number, length in enumerate(geometry.lengths):
        if length != 1:
            yield f"axis {number} stands as it is: its length {_short(length)} is not in the field of the axes"
    yield ""
    yield f"{len(geometry.equations)} parity equations"
    for equation in geometry.equations:
        numbers = [f"{value:3}" if isinstance(value, int) else f" {value}" for value in equation]
        yield f"  {equation_label(equation):4}  {' '.join(numbers)}"
    yield ""
    yield TextTable(_TRIADS, _triad_rows(sensors)).as_text()
    yield ""
    gains = ", ".join(f"{float(sum(x * x for x in row)) ** 0.5:.6f}" for row in geometry.least_squares)
    yield f"all sensors, least squares: noise {gains} in x, y, z"
    yield _failures(sensors)
    statuses = sum(len(table.verdicts) for table in tables)
    yield f"tables: {len(tables)} states of the sensors, {statuses} statuses of the equations"


def _short(length: Number) -> str:
    """Return a length exactly if that is short, else with nine digits."""
    text = str(length)
    return text if len(text) <= 24 else f"{float(length):.9g}"


def _triad_rows(sensors: SensorSet) -> list[list[Any]]:
    return [
        [
            number,
            "".join(map(str, triad.sensors)),
            str(abs(triad.determinant)),
            condition,
            gain_text(triad),
            float(triad.squared_gain) ** 0.5,
        ]
        for number, (triad, condition) in enumerate(
            zip(sensors.geometry.triads, conditions(sensors), strict=True)
        )
    ]


def _failures(sensors: SensorSet) -> str:
    """Return in words which failures the geometry tells."""
    geometry = sensors.geometry
    operate = {0: "no failure is", 1: "one failure is"}.get(
        geometry.fail_operate, f"{geometry.fail_operate} failures are"
    )
    more = "is detected" if geometry.fail_safe else "may go undetected"
    return f"{operate} isolated, whichever sensors fail; one more {more}"


def status_text(status: Sequence[bool]) -> str:
    """Return a status as a 1 for each equation that fails and a 0 for the others, the first equation first."""
    return "".join("01"[fails] for fails in status)


def tables_csv(sensors: SensorSet, tables: Sequence[FailureTable]) -> str:
    """Return the tables as comma-separated values: removed sensors, equations, status, failed sensor, triad, points."""
    rows = []
    for table in tables:
        labels = " ".join(equation_label(sensors.geometry.equations[k]) for k in table.equations)
        removed = " ".join(map(str, table.removed))
        rows += [
            [removed, labels, status_text(status), verdict.failed, verdict.triad, verdict.points]
            for status, verdict in table.verdicts.items()
        ]
    headers = ("removed", "equations", "status", "failed", "triad", "points")
    return TextTable([Column(header) for header in headers], rows).as_csv()
