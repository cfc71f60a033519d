"""A geometry of redundant sensors as a result: parity equations, triads with noise, detectable failures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.catalogue.coefficients import Number
from strapgen.ir.exceptions import InputError
from strapgen.navigation.redundancy.geometry import SensorGeometry
from strapgen.navigation.redundancy.redundancy_kernels import SensorSet, equation_label, gain_text
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
class GeometryResult(Result):
    """Parity equations, triads and detectable failures of redundant sensors; exact numbers are text."""

    sensor_set: SensorSet = field(metadata=INTERNAL)
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
    #: Sensors in no equation, whose failures are not detected
    in_no_equation: Sequence[int]
    tables: Sequence[FailureTable]
    #: Files that were written
    files: Sequence[Path]

    @staticmethod
    def of(sensors: SensorSet, tables: Sequence[FailureTable], files: Sequence[Path] = ()) -> GeometryResult:
        """Return the geometry of a set of sensors with its tables of failures."""
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
            in_no_equation=geometry.undetected(),
            tables=tables,
            files=files,
        )

    def text(self) -> str:
        """Return equations, triads and failures for a reader."""
        return "\n".join([*_lines(self.sensor_set, self.tables), *(f"  {path}" for path in self.files)])


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
    """Return in words which failures are detected and isolated."""
    geometry = sensors.geometry
    operate = {0: "no failure is", 1: "one failure is"}.get(
        geometry.fail_operate, f"{geometry.fail_operate} failures are"
    )
    more = "is detected" if geometry.fail_safe else "may go undetected"
    text = f"{operate} isolated, whichever sensors fail; one more {more}"
    if single := geometry.undetected():
        text += f"\nin no equation, so that no failure is detected: {', '.join(map(str, single))}"
    return text


def tables_csv(sensors: SensorSet, tables: Sequence[FailureTable]) -> str:
    """Return the tables as comma-separated values: removed sensors, equations, status, failed sensor, triad, points."""
    rows = []
    for table in tables:
        labels = " ".join(equation_label(sensors.geometry.equations[k]) for k in table.equations)
        removed = " ".join(map(str, table.removed))
        rows += [
            [removed, labels, verdict.status, verdict.failed, verdict.triad, verdict.points]
            for verdict in table.verdicts.values()
        ]
    headers = ("removed", "equations", "status", "failed", "triad", "points")
    return TextTable([Column(header) for header in headers], rows).as_csv()


Array = NDArray[np.float64]
#: Points of a scan, about, and how far it reaches along every axis, in trip levels.
_POINTS, _REACH = 70_000, 8.0
#: Alignments that differ by less are equal.
_EQUAL = 1e-9


@dataclass(frozen=True)
class FailureVerdict:
    """The verdict of a table for one status of the parity equations."""

    #: A 1 for each equation that fails, and a 0 for the others
    status: str
    #: The sensor that is declared failed: its failure direction is the most aligned for most of the points
    failed: int | None
    #: Number of the selected triad, whose failure directions are the least aligned
    triad: int
    #: Points of the scan with this status
    points: int


@dataclass(frozen=True)
class FailureTable:
    """The verdicts with some sensors removed."""

    #: Sensors that no longer count
    removed: tuple[int, ...]
    #: Numbers of the parity equations that need none of them; a status has a bit for each
    equations: tuple[int, ...]
    #: By status: whether each of these equations fails
    verdicts: Mapping[tuple[bool, ...], FailureVerdict] = field(
        metadata=entry(write=lambda verdicts: list(verdicts.values()), kind=list[FailureVerdict])
    )


def failure_table(geometry: SensorGeometry, removed: tuple[int, ...] = ()) -> FailureTable:
    """Scan the parity space point by point, and return the verdict for each status of the equations.

    An equation, divided by the length of its vector, fails from the trip level 1 on.

    >>> from strapgen.navigation.redundancy.geometry import HEXAD
    >>> table = failure_table(HEXAD, (0,))
    >>> len(table.equations), [table.verdicts[status].failed for status in table.verdicts if sum(status) == 4][:2]
    (5, [5, 4])
    """
    numbers = tuple(k for k, e in enumerate(geometry.equations) if not any(e[sensor] for sensor in removed))
    if not numbers:
        raise InputError(f"without the sensors {removed} no parity equation is left")
    valid = [sensor for sensor in range(geometry.count) if sensor not in removed]
    vectors = np.array([geometry.equations[k] for k in numbers], float)[:, valid]
    space = np.linalg.svd(vectors)[2][: np.linalg.matrix_rank(vectors)]
    points = _scan(space)
    lengths = np.linalg.norm(vectors, axis=1)[:, None]
    fails = np.abs(vectors @ space.T @ points.T) >= lengths * (1 - _EQUAL)
    directions = np.linalg.norm(space, axis=0)[:, None]
    # A sensor in no equation has no failure direction: nothing is aligned with it.
    alignment = np.abs(space.T @ points.T) / np.where(directions > _EQUAL, directions, np.inf)
    alignment = alignment / np.linalg.norm(points, axis=1)
    statuses, place = _different(fails)
    verdicts = {}
    for number, status in enumerate(statuses):
        here = alignment[:, place == number]
        if status.any():
            failed = _failed(here, valid)
            triad = _selected(geometry, dict(zip(valid, here.mean(axis=1), strict=True)))
        else:
            failed, triad = None, _best(geometry, valid)
        text = "".join("01"[int(fails)] for fails in status)
        verdicts[tuple(map(bool, status))] = FailureVerdict(text, failed, triad, here.shape[1])
    return FailureTable(removed, numbers, verdicts)


def _different(fails: Array) -> tuple[Array, Array]:
    """Return the different statuses of points in their order, a row each, and the number of that of every point."""
    place = np.zeros(fails.shape[1], int)
    first = place[:1]
    # As numbers, a byte at a time: to compare two rows of many equations takes longer.
    for byte in np.packbits(fails.astype(bool), axis=0):
        _, first, place = np.unique(256 * place + byte, return_index=True, return_inverse=True)
    return fails.T[first], place.reshape(-1)


def _scan(space: Array) -> Array:
    """Return the points of a grid over the space, and points along every failure direction."""
    size = len(space)
    count = max(3, int(_POINTS ** (1 / size)) | 1)
    axis = np.linspace(-_REACH, _REACH, min(count, 4001))
    grid = np.stack(np.meshgrid(*[axis] * size, indexing="ij"), -1).reshape(-1, size)
    along = (space * np.linspace(0.1, _REACH, 80)[:, None, None]).transpose(0, 2, 1).reshape(-1, size)
    points = np.concatenate([grid, along])
    away: Array = points[np.linalg.norm(points, axis=1) > _EQUAL]
    return away


def _failed(alignment: Array, valid: list[int]) -> int | None:
    """Return the sensor whose failure direction is the most aligned alone for most of the points."""
    most = alignment.max(axis=0)
    is_most = alignment >= most - _EQUAL
    alone = is_most[:, is_most.sum(axis=0) == 1]
    counts = alone.sum(axis=1)
    best = int(counts.argmax())
    return valid[best] if 2 * counts[best] > alignment.shape[1] else None


def _selected(geometry: SensorGeometry, alignment: Mapping[int, float]) -> int:
    """Return the number of the triad of least alignment; the first has the least noise."""
    sums = [
        sum(alignment[sensor] for sensor in triad.sensors) if {*triad.sensors} <= {*alignment} else np.inf
        for triad in geometry.triads
    ]
    least = min(sums)
    return next(number for number, value in enumerate(sums) if value <= least + _EQUAL)


def _best(geometry: SensorGeometry, valid: list[int]) -> int:
    return next(k for k, triad in enumerate(geometry.triads) if {*triad.sensors} <= {*valid})


def failure_tables(geometry: SensorGeometry) -> list[FailureTable]:
    """Return the tables for all states of the sensors that have a parity equation left, all sensors first."""
    states = [
        removed
        for failures in range(geometry.fail_operate + 1)
        for removed in combinations(range(geometry.count), failures)
        if geometry.without(removed)
    ]
    return [failure_table(geometry, removed) for removed in states]
