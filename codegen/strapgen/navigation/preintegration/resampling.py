"""Increments over even intervals between two instants from samples with instants of their own.

A polynomial goes through the samples around a time; its kernel has the integral from the instant before to the time,
or, of samples at instants, the mean over the interval around it.
"""

from __future__ import annotations

import numpy as np

from strapgen.navigation.preintegration import AWAY, FEWEST, POINTS
from strapgen.run.evaluators import Array, Evaluator


def increments(kernel: Evaluator, times: Array, samples: Array, boundaries: Array) -> Array:
    """Return the increments between boundaries, (n, 6), from the integrals since the instant before, (instants, 6).

    Instants and boundaries are in intervals since a first instant.
    """
    ends = interpolated(kernel, times, samples, boundaries)
    before = _before(times, boundaries)
    total = np.zeros((len(boundaries) - 1, 6))
    between = np.diff(before)
    for k in range(1, int(between.max()) + 1):
        place = np.minimum(before[:-1] + k, len(samples) - 1)
        total = np.where(k <= between[:, None], total + samples[place], total)
    return np.asarray(total + (ends[1:] - ends[:-1]))


def interpolated(kernel: Evaluator, times: Array, samples: Array, points: Array) -> Array:
    """Return what a kernel gives at points, (n, 6), from the samples around each, (instants, 6)."""
    before, last = _before(times, points), len(times) - 1
    half = np.clip(np.minimum(before + 1, last - before), FEWEST, POINTS // 2)
    count = np.minimum(2 * half, len(times))
    first = np.clip(before - (half - 1), 0, len(times) - count)
    slots = np.arange(POINTS)
    places = before[:, None] - (POINTS // 2 - 1) + slots
    there = (first[:, None] <= places) & (places < (first + count)[:, None])
    places = np.where(there, places, 0)
    from_point = np.where(there, times[places] - points[:, None], AWAY * (POINTS + 1 + slots))
    around = np.where(there[..., None], samples[places], 0.0)
    outputs, _ = kernel.run([from_point, around.reshape(len(points), -1)], kernel.fresh(len(points)))
    return np.asarray(outputs[0])


def _before(times: Array, points: Array) -> Array:
    """Return the places of the last instants that are not after points."""
    return np.clip(np.searchsorted(times, points, side="right") - 1, 0, len(times) - 1)
