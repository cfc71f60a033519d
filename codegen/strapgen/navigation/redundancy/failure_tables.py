"""Makes the tables of detection and selection of redundant sensors, from a scan of their parity space."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.exceptions import InputError
from strapgen.navigation.redundancy.geometry import SensorGeometry

Array = NDArray[np.float64]
#: Points of a scan, about, and how far it reaches along every axis, in trip levels.
_POINTS, _REACH = 70_000, 8.0
#: Alignments that differ by less are equal.
_EQUAL = 1e-9


@dataclass(frozen=True)
class FailureVerdict:
    """What a table says of one status of the parity equations."""

    #: The sensor that is declared failed: its failure direction is the most aligned for most of the points
    failed: int | None
    #: Number of the triad whose failure directions are the least aligned, in `SensorGeometry.triads`
    triad: int
    #: Points of the scan with this status
    points: int


@dataclass(frozen=True)
class FailureTable:
    """The tables for one state of the sensors."""

    #: Sensors that no longer count
    removed: tuple[int, ...]
    #: Numbers of the parity equations that need none of them; a status has a bit for each
    equations: tuple[int, ...]
    #: By status: whether each of these equations fails
    verdicts: Mapping[tuple[bool, ...], FailureVerdict]


def failure_directions(geometry: SensorGeometry) -> Array:
    """Return the directions of failures in parity space, one for each sensor, of the length that a failure of 1 has.

    Returns (N - 3, N): in orthonormal coordinates of the space that the independent parity equations span.
    """
    basis = np.array(geometry.parity_basis, float)
    directions: Array = np.linalg.qr(basis.T)[0].T
    return directions


def failure_table(geometry: SensorGeometry, removed: tuple[int, ...] = ()) -> FailureTable:
    """Scan the parity space point by point, and return what each status of the equations stands for.

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
    alignment = np.abs(space.T @ points.T) / np.linalg.norm(space, axis=0)[:, None]
    alignment = alignment / np.linalg.norm(points, axis=1)
    statuses, place = _different(fails)
    verdicts = {}
    for number, status in enumerate(statuses):
        here = alignment[:, place == number]
        verdicts[tuple(map(bool, status))] = FailureVerdict(
            _failed(here, valid) if status.any() else None,
            _selected(geometry, dict(zip(valid, here.mean(axis=1), strict=True)))
            if status.any()
            else _best(geometry, valid),
            here.shape[1],
        )
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
    grid = grid[np.any(grid != 0, axis=1)]
    along = (space * np.linspace(0.1, _REACH, 80)[:, None, None]).transpose(0, 2, 1).reshape(-1, size)
    points: Array = np.concatenate([grid, along])
    return points


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
