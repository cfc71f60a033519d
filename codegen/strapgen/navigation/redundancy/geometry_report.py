"""Reports a geometry of redundant sensors: parity equations, triads with their noise, and failures that they tell."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from strapgen.catalogue.coefficients import Number
from strapgen.navigation.redundancy.failure_tables import FailureTable
from strapgen.navigation.redundancy.parity_equations import SensorSet, equation_label, gain_text
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable

_TRIADS = (
    Column("triad"),
    Column("sensors", "<"),
    Column("|det|", "<"),
    Column("condition", spec=".4g"),
    Column("noise x, y, z", "<"),
    Column("noise", spec=".6f"),
)


def geometry_report(sensors: SensorSet, tables: Sequence[FailureTable], files: Sequence[str] = ()) -> Report:
    """Return a geometry as a report."""
    return Report(
        lambda: "\n".join([*_lines(sensors, tables), *(f"  {name}" for name in files)]) + "\n",
        lambda: {**_data(sensors, tables), "files": list(files)},
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


def _data(sensors: SensorSet, tables: Sequence[FailureTable]) -> dict[str, Any]:
    geometry = sensors.geometry
    return {
        "name": sensors.name,
        "sensor": sensors.sensor,
        "range": str(sensors.range),
        "axes": [list(map(str, axis)) for axis in geometry.axes],
        "lengths": list(map(str, geometry.lengths)),
        "equations": [[x if isinstance(x, int) else str(x) for x in row] for row in geometry.equations],
        "triads": [
            {
                "sensors": list(triad.sensors),
                "determinant": str(triad.determinant),
                "condition": condition,
                "inverse": [list(map(str, row)) for row in triad.inverse],
                "squared_noise": list(map(str, triad.squared_gains)),
            }
            for triad, condition in zip(geometry.triads, conditions(sensors), strict=True)
        ],
        "least_squares": [list(map(str, row)) for row in geometry.least_squares],
        "fail_operate": geometry.fail_operate,
        "next_is_detected": geometry.fail_safe,
        "tables": [_table_data(table) for table in tables],
    }


def _table_data(table: FailureTable) -> dict[str, Any]:
    return {
        "removed": list(table.removed),
        "equations": list(table.equations),
        "verdicts": [
            {
                "status": status_text(status),
                "failed": verdict.failed,
                "triad": verdict.triad,
                "points": verdict.points,
            }
            for status, verdict in table.verdicts.items()
        ],
    }


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
