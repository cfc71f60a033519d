"""What bandwidth, delay and jitter make of increments: a response of second order, and the instants of the samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.exceptions import InputError

Array = NDArray[np.float64]

#: Samples that a linear recursion takes together.
_BLOCK = 128
#: Standard deviations that no instant of a sample departs by.
_FARTHEST = 10.0
#: Most sampling intervals by which a sample is late.
_MOST_LATE = 1_000_000


@dataclass(frozen=True)
class LinearRecursion:
    """A recursion ``y = c s + d x``, ``s' = a s + b x`` on single numbers x and y."""

    #: (m, m)
    a: Array
    #: (m,)
    b: Array
    c: Array
    d: float

    def __post_init__(self) -> None:
        powers = [np.eye(len(self.b))]
        for _ in range(_BLOCK):
            powers.append(self.a @ powers[-1])
        weights = np.array([self.d, *(float(self.c @ power @ self.b) for power in powers[:-1])])
        lags = np.subtract.outer(np.arange(_BLOCK), np.arange(_BLOCK))
        object.__setattr__(self, "_direct", np.where(lags >= 0, weights[np.maximum(lags, 0)], 0.0))
        object.__setattr__(self, "_free", np.array([self.c @ power for power in powers[:-1]]))
        object.__setattr__(self, "_inflow", np.array([power @ self.b for power in powers[:-1]]))
        object.__setattr__(self, "_powers", powers)

    def run(self, row: Array, state: Array) -> tuple[Array, Array]:
        """Return the results of a row of numbers, (n,), from a state on, (m,), and the state after it."""
        parts: Any = self
        result = np.empty_like(row)
        for first in range(0, len(row), _BLOCK):
            block = row[first : first + _BLOCK]
            count = len(block)
            result[first : first + count] = (
                parts._free[:count] @ state + parts._direct[:count, :count] @ block
            )
            state = parts._powers[count] @ state + block @ parts._inflow[:count][::-1]
        return result, state


def second_order(frequency: float, damping: float, interval: float) -> LinearRecursion:
    """Return the response 1/(1 + 2 zeta s/w + s^2/w^2) as a recursion on increments.

    It is exact for a rate that is constant over each interval. The state is the rate that comes out, in increments
    per interval, and its derivative over w.

    `frequency`: natural frequency w/(2 pi) in Hz. `interval`: in s.

    >>> settled = second_order(80, 0.7, 0.001).run(np.ones(3), np.array([1.0, 0.0]))[0]
    >>> settled.round(12)
    array([1., 1., 1.])
    """
    turn = 2 * np.pi * frequency * interval  # w times the interval, the unit of time
    # Of the rate, its derivative, the integral of the rate, and the constant that goes in.
    system = np.zeros((4, 4))
    system[0, 1], system[2, 0] = turn, 1.0
    system[1] = [-turn, -2 * damping * turn, 0.0, turn]
    step = _exponential(system)
    return LinearRecursion(step[:2, :2], step[:2, 3], step[2, :2], float(step[2, 3]))


def bounded_noise(decay: float) -> LinearRecursion:
    """Return ``b[n] = A b[n-1] + (1 - A)(w[n] - w[n-1])`` as a recursion on w; the state is b and w of the time before.

    The variance for unit w is 2(1-A)^2/(1+A), that of the running sum (1-A)/(1+A).
    """
    gain = 1 - decay
    return LinearRecursion(
        np.array([[decay, -gain], [0.0, 0.0]]), np.array([gain, 1.0]), np.array([decay, -gain]), gain
    )


def _exponential(matrix: Array) -> Array:
    """Return the exponential of a matrix, by halving and its series."""
    halvings = max(0, int(np.ceil(np.log2(max(float(np.abs(matrix).sum(axis=1).max()), 1e-300)))) + 4)
    small = matrix / 2.0**halvings
    result = term = np.eye(len(matrix))
    for k in range(1, 14):  # the norm is at most 1/16: 16**-14/14! is far below round-off
        term = term @ small / k
        result = result + term
    for _ in range(halvings):
        result = result @ result
    return result


class Lag:
    """The response of three sensors, part by part; before the first increment its rate has held for ever."""

    def __init__(self, bandwidth_hz: Array, damping: Array, interval: float) -> None:
        self._recursions = [
            second_order(frequency, ratio, interval) if np.isfinite(frequency) else None
            for frequency, ratio in zip(bandwidth_hz, damping, strict=True)
        ]
        self._states: list[Array] | None = None

    def __call__(self, row: Array) -> Array:
        """Return what comes out for increments, (n, 3)."""
        if self._states is None:
            self._states = [np.array([first, 0.0]) for first in row[0]]
        result = row.copy()
        for axis, recursion in enumerate(self._recursions):
            if recursion is not None:
                result[:, axis], self._states[axis] = recursion.run(row[:, axis], self._states[axis])
        return result


class SampleTimes:
    """Increments between instants that are late and unsteady, part by part.

    The angle between two exact instants is taken as linear; an instant after its time takes the rate of the interval
    before it. Before the first increment its rate has held for ever.
    """

    def __init__(self, delay: Array, jitter: float, interval: float) -> None:
        self._delay, self._jitter = delay / interval, jitter / interval
        latest = float(self._delay.max()) + _FARTHEST * self._jitter
        if latest > _MOST_LATE:
            raise InputError(
                f"a sample is up to {latest:.6g} sampling intervals late by delay and jitter; up to {_MOST_LATE} are "
                "possible"
            )
        self._depth = int(np.ceil(latest)) + 2
        self._history: Array | None = None
        self._before = self._delay[None]  # how late the sample before is, in intervals

    def __call__(self, row: Array, departures: Array) -> Array:
        """Return the increments between the instants, (n, 3).

        `row` (n, 3): increments between exact instants. `departures` (n, 1): departures of the instants from their
        times in standard deviations of the jitter.
        """
        if self._history is None:
            self._history = np.tile(row[0], (self._depth, 1))
        whole = np.concatenate([self._history, row])
        late = self._delay - self._jitter * np.clip(departures, -_FARTHEST, _FARTHEST)
        late = np.concatenate([self._before, late])
        angle = np.cumsum(whole, axis=0)
        # `angle[k]` is that at the end of interval k; the sample before the first stands at the end of the history.
        ends = np.arange(self._depth - 1, len(whole))[:, None]
        behind = np.maximum(np.floor(late), 0.0)
        place = ends - behind.astype(np.int64)
        axes = np.arange(3)
        there = angle[place, axes] - (late - behind) * whole[place, axes]
        self._history, self._before = whole[len(row) :], late[-1:]
        exact = (self._delay == 0) & (self._jitter == 0)
        return np.where(exact, row, np.diff(there, axis=0))
