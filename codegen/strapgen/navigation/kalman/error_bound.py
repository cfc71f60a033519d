"""Bounds the error of a filter with fixed gains in fixed point over all its steps.

The estimate of the code less that of exact arithmetic on the same words follows e + = (I - K h) Phi e + r, where r is
what a call rounds, at most the certified error of its kernel, and what the rounding of the gains moves. A bound after k
steps is the sum over j of |A_k ... A_j+1| r_j. The products are those of double arithmetic, and what these round is
added to r; sums are rounded up.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import sympy as sp

from strapgen.ir.formats import float_above
from strapgen.ir.interfaces import Interface
from strapgen.navigation.kalman.kalman_filter import KalmanFilter
from strapgen.run.evaluators import Array

#: Relative rounding of double, doubled so that the rounding of the bounds themselves is covered.
_UNIT = 2.0**-51
#: Part of a step that is left of an error from so long ago that the rest is a geometric sum.
_FORGOTTEN = 1e-3
#: Most steps until then, and most directions of errors that are told apart, for each state.
_LONGEST, _DIRECTIONS = 400_000, 400


@dataclass(frozen=True)
class RunBound:
    """Bounds of the error of every state."""

    #: Steps for which they hold; None for a run of any length
    steps: int | None
    #: By the name of the state, in its unit
    errors: dict[str, float]


def run_bound(model: KalmanFilter, interfaces: list[Interface]) -> RunBound | None:
    """Return the bounds of a run, while no call refuses a value; None where errors last too long.

    `interfaces`: of the time update and of the updates, in order.
    """
    loop = _Loop(model, interfaces)
    if model.text.kind == "steady":
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is no bound
            errors, steps = loop.steady(), None
    else:
        errors, steps = loop.scheduled(), model.text.steps
    if errors is None or not np.isfinite(errors).all():
        return None
    return RunBound(steps, {name: float(error) for name, error in zip(model.states, errors, strict=True)})


class _Loop:
    """The steps of the error: matrices in double, and what each call adds."""

    def __init__(self, model: KalmanFilter, interfaces: list[Interface]) -> None:
        self.text, time, updates = model.text, interfaces[0], interfaces[1:]
        self.names = model.states
        self.transition = _doubles(model.transition)
        self.rows = _doubles(model.H)
        self.time_error = self._errors(time)
        self.update_errors = [self._errors(one) for one in updates]
        words = [(max(-one.outputs[0].low, one.outputs[0].high), one.outputs[0].unit) for one in updates]
        self.innovations = [float_above(largest * unit) for largest, unit in words]
        assert model.solved is not None
        self.gains = [
            [np.array([float(x) for x in row]) for row in model.solved.rows[name]]
            for name in model.measurements
        ]
        self.rounded = [
            [_gain_errors(one, row) for row in model.solved.rows[name]]
            for name, one in zip(model.measurements, updates, strict=True)
        ]
        formats = {one.signal.name: one.format for one in time.inputs}
        starts = [(formats[one.name], one.initial) for one in model.text.states]
        self.start = np.array([float(abs(form.nearest(first) * form.unit - first)) for form, first in starts])

    def _errors(self, interface: Interface) -> Array:
        errors = {one.signal.name: max(one.errors) for one in interface.outputs}
        return np.array([float_above(errors[f"next_{name}"]) for name in self.names])

    def parts(self, step: int) -> Iterator[tuple[Array, Array]]:
        """Yield the matrix of every call of a step, and what it adds."""
        yield self.transition, self.time_error
        for place, one in enumerate(self.text.measurements):
            if step % one.every == 0:
                which = min(step // one.every, len(self.gains[place])) - 1
                gain, row = self.gains[place][which], self.rows[place]
                added = self.update_errors[place] + self.rounded[place][which] * self.innovations[place]
                yield np.eye(len(gain)) - np.outer(gain, row), added

    def scheduled(self) -> Array:
        """Return the largest errors after any step of the schedule."""
        assert self.text.steps is not None
        n = len(self.names)
        directions, worst = np.diag(self.start), self.start.copy()
        for step in range(1, self.text.steps + 1):
            for matrix, added in self.parts(step):
                # The matrix is rounded from exact numbers, by at most a unit of it and of the identity.
                lost = (n + 3) * _UNIT * ((np.abs(matrix) + np.eye(n)) @ _sum(directions))
                directions = np.hstack([matrix @ directions, np.diag((added + lost) * (1 + _UNIT))])
                worst = np.maximum(worst, _sum(directions))
            directions = _fewer(directions)
        return worst

    def steady(self) -> Array | None:
        """Return the largest errors in a run of any length; None where they last too long."""
        n = len(self.names)
        # The start counts as if it came with every measurement.
        loop, majorant, added, between, calls = np.eye(n), np.eye(n), self.start, [], 0
        for step in range(1, self.text.measurements[0].every + 1):
            for matrix, more in self.parts(step):
                loop, majorant = matrix @ loop, (np.abs(matrix) + np.eye(n)) @ majorant
                calls += 1
                added = (np.abs(matrix) @ added + more) * (1 + (n + 2) * _UNIT)
                between.append((np.abs(loop), added))
        added = np.maximum(added, added.max() * 2.0**-40)
        power, total, lost = np.eye(n), np.zeros(n), np.zeros(n)
        for _ in range(_LONGEST):
            now = np.abs(power) @ added
            total = (total + now) * (1 + (n + 2) * _UNIT)
            lost += 2 * calls * (n + 3) * _UNIT * (majorant @ now)
            power = loop @ power
            left = float((np.abs(power) @ total / total).max())
            part = float((lost / added).max())  # of a disturbance like r, what rounding lost is at most this
            if not part <= _FORGOTTEN:  # nan is refused
                return None
            if left < _FORGOTTEN:
                whole = total / (1 - left) / (1 - part) * (1 + _FORGOTTEN * _FORGOTTEN)
                reached = [size @ whole * (1 + 1e-9) + more for size, more in between]
                return np.asarray(np.max([whole, *reached], axis=0))
        return None


def _sum(directions: Array) -> Array:
    """Return the sums of the magnitudes of all directions, rounded up."""
    return np.asarray(np.abs(directions).sum(axis=1) * (1 + directions.shape[1] * _UNIT))


def _fewer(directions: Array) -> Array:
    """Return as many directions as are told apart: the smallest ones become a box."""
    n, count = directions.shape
    if count <= _DIRECTIONS * n:
        return directions
    scale = _sum(directions)
    weight = (np.abs(directions) / np.where(scale > 0, scale, 1)[:, None]).max(axis=0)
    order = np.argsort(weight)
    small, large = order[: count // 2], order[count // 2 :]
    return np.hstack([directions[:, large], np.diag(_sum(directions[:, small]))])


def _doubles(matrix: sp.Matrix) -> Array:
    return np.array([[float(x) for x in matrix[i, :]] for i in range(matrix.rows)])


def _gain_errors(interface: Interface, row: Sequence[Fraction]) -> Any:
    """Return by how much the gains of a row differ from those in the formats of the code."""
    taken = [one for one in interface.inputs if one.signal.name.startswith("gain_")]
    if not taken:
        return np.zeros(len(row))
    pairs = zip(taken, row, strict=True)
    return np.array([float_above(abs(one.format.nearest(gain) * one.unit - gain)) for one, gain in pairs])
