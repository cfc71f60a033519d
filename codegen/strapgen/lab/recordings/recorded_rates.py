"""Integrates recorded rates over their own intervals or an even grid, and leaves out repeated rows."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import checks
from strapgen.ir.checks import counted
from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings.recorded_columns import PART, Columns, parts, release
from strapgen.lab.recordings.recorded_rows import LineNumbers, RecordedRows

Array = NDArray[np.float64]

#: From this multiple of the median on, an interval is a gap in which the motion is not known.
GAP = 10


def without_repeated(path: Path, rows: RecordedRows, remarks: list[str]) -> RecordedRows:
    """Return rows without those whose time is that of the row before."""
    is_new = np.concatenate([[True], np.diff(rows.time) != 0])
    dropped = int(len(is_new) - is_new.sum())
    if not dropped:
        return rows
    first = rows.lines[int(np.argmin(is_new))]
    remarks.append(
        f"{counted(dropped, 'row')} with the time of the row before left out, the first in line {first}"
    )
    lines = LineNumbers()
    for place, row in enumerate(np.flatnonzero(is_new)):
        lines.add(place, [rows.lines[int(row)]])
    return RecordedRows(rows.time[is_new], rows.values[is_new], lines)


def gap_remarks(rows: RecordedRows, median: float) -> list[str]:
    """Return a remark for each gap that is bridged."""
    steps = np.diff(rows.time)
    return [
        f"a gap of {steps[place]:.6g} s before line {rows.lines[int(place) + 1]}, from {rows.time[place]:.6g} s on, is "
        "bridged: the rate is taken as linear across it"
        for place in np.flatnonzero(steps > GAP * median)
    ]


def grid_points(path: Path, time: Array, resample_hz: float | str | Fraction, interval: float) -> int:
    """Return the number of intervals of an even grid over a recording."""
    ratio = (float(time[-1]) - float(time[0])) / interval * (1 + 1e-12)
    if ratio > checks.MOST:
        raise InputError(f"resample_hz {resample_hz}: {path} would make over {checks.MOST:.0e} increments")
    count = math.floor(ratio)
    if count < 1:
        raise InputError(
            f"resample_hz {resample_hz}: {path} is {time[-1] - time[0]:.6g} s long, less than one interval"
        )
    return count


def integrals(rows: RecordedRows, factor: float) -> Array:
    """Return the integrals of rates from each row to the next."""
    increments = Columns(3)
    for first, part in parts(rows.values, 1):
        rates, time = part * factor, np.asarray(rows.time[first : first + len(part)])
        increments.append((rates[1:] + rates[:-1]) / 2 * np.diff(time)[:, None])
    release(rows.time)
    return increments.array()


def resampled(rows: RecordedRows, factor: float, interval: float, count: int) -> Array:
    """Return the integrals of rates over an even grid of so many intervals."""
    begin, end, last = float(rows.time[0]), float(rows.time[-1]), len(rows.time) - 1
    increments, angle, before, done = Columns(3), np.zeros((1, 3)), np.zeros((0, 3)), 0
    for first, part in parts(rows.values, 1):
        rates, time = part * factor, np.asarray(rows.time[first : first + len(part)])
        gaps = np.diff(time)
        pieces = (rates[1:] + rates[:-1]) / 2 * gaps[:, None]
        slopes = np.diff(rates, axis=0) / gaps[:, None]
        angles = np.cumsum(np.vstack([angle, pieces]), axis=0)
        angle = angles[-1:]
        while done <= count:
            grid = np.minimum(begin + interval * np.arange(done, min(done + PART, count + 1)), end)
            if first + len(gaps) < last:  # the rest lies in the parts to come
                grid = grid[grid < time[-1]]
            if not len(grid):
                break
            row = np.minimum(np.searchsorted(time, grid, side="right") - 1, len(gaps) - 1)
            inside = (grid - time[row])[:, None]
            there = angles[row] + inside * (rates[row] + inside / 2 * slopes[row])
            increments.append(np.diff(np.vstack([before, there]), axis=0))
            before, done = there[-1:], done + len(grid)
    release(rows.time)
    return increments.array()
