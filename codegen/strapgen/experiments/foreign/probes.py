"""Probes a user's function with small increments: the rotation that it makes of each, and of every two of them.

To second order the rotation vector of a run is the sum of all increments and of their cross products, each with a
coefficient. A probe turns by one increment about x, by a later one about y, and reads the coefficient from the rotation
about z. An exact product of rotations gives 1/2 to two increments of different calls; what a function adds to that, and
all that it gives to two increments of one call, is its coning correction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from strapgen.experiments.foreign.runs import Segment, SegmentRun
from strapgen.simulation.motions import motion
from strapgen.simulation.runs import drift_between

Array = NDArray[np.float64]

#: Size of a small increment in rad: its square is seen in single precision, its fourth power is not.
_SMALL = 0.02
#: Calls without rotation after a probe, in which what comes late arrives.
_LATE = 2
#: Samples from before a call whose products with those of the call are looked at.
_BEFORE = 3
#: Calls of each of two large rotations, and their angle in rad.
_CALLS, _LARGE = 20, 0.5


@dataclass(frozen=True)
class Directions:
    """How a function answers rotations about the axes.

    Parameters
    ----------
    at_once, finally_ : array, (3, 3)
        Rotation vector after the call, and after more calls without rotation, in units of the rotation about each axis:
        a column for each.
    order_of_turns : float
        Angle in rad between the attitude after a rotation about x and then one about y, and the true one.
    other_order : float
        The same for the attitude of the two rotations in the other order.
    """

    at_once: Array
    finally_: Array
    order_of_turns: float
    other_order: float


def direction_segments(samples: int) -> list[Segment]:
    """Return the segments that `directions` needs of a function with so many samples a call."""
    segments = []
    for axis in range(3):
        increments = np.zeros((1 + _LATE, samples, 3))
        increments[0, :, axis] = _SMALL / samples
        segments.append(Segment(increments))
    turns = np.zeros((2 * _CALLS, samples, 3))
    turns[:_CALLS, :, 0] = turns[_CALLS:, :, 1] = _LARGE / (_CALLS * samples)
    return [*segments, Segment(turns)]


def directions(runs: Sequence[SegmentRun]) -> Directions:
    """Return the answer to rotations about the axes.

    Parameters
    ----------
    runs : sequence of SegmentRun
        Of `direction_segments`.

    Returns
    -------
    Directions
    """
    at_once, finally_ = (
        np.column_stack([_turned(run.relative[place]) / _SMALL for run in runs[:3]]) for place in (1, -1)
    )
    about_x, about_y = (motion("constant", **{key: _LARGE}).attitude(1.0) for key in ("x_rad_s", "y_rad_s"))
    last = runs[3].relative[-1]
    angles = (
        float(np.linalg.norm(drift_between(last, true))) for true in (about_x @ about_y, about_y @ about_x)
    )
    return Directions(at_once, finally_, *angles)


def _turned(matrix: Array) -> Array:
    """Return the vector of a small rotation."""
    return drift_between(np.eye(3), matrix)


@dataclass(frozen=True)
class Products:
    """The coefficients of cross products, older times newer sample, beside the sum of samples and exact products.

    Parameters
    ----------
    samples : int
        Samples of a call.
    at_once, finally_ : dict
        Coefficients after the call with the newer sample, and after more calls without rotation. Samples of the call
        have the numbers 0 to samples - 1, those before it are negative.
    weights : tuple of float, optional
        By how much of each sample of a call the attitude turns in the end; 1 for each is right.
    """

    samples: int
    at_once: dict[tuple[int, int], float]
    finally_: dict[tuple[int, int], float]
    weights: tuple[float, ...] = ()


def pairs(samples: int) -> list[tuple[int, int]]:
    """Return the pairs of samples whose products are looked at: the newer one is of the call."""
    return [(older, newer) for newer in range(samples) for older in range(-_BEFORE, newer)]


def product_segments(samples: int) -> list[Segment]:
    """Return the segments that `products` needs."""
    calls_before = -(-_BEFORE // samples)
    segments = []
    for (older, newer), (first, second) in product(pairs(samples), product((1, -1), repeat=2)):
        row = np.zeros(((calls_before + 1 + _LATE) * samples, 3))
        row[calls_before * samples + older, 0] = first * _SMALL
        row[calls_before * samples + newer, 1] = second * _SMALL
        segments.append(Segment(row.reshape(-1, samples, 3)))
    return segments


def products(runs: Sequence[SegmentRun], samples: int) -> Products:
    """Return the coefficients of all products.

    Parameters
    ----------
    runs : sequence of SegmentRun
        Of `product_segments`.
    samples : int

    Returns
    -------
    Products
    """
    place = -(-_BEFORE // samples) + 1
    tables: list[dict[tuple[int, int], float]] = [{}, {}]
    weights = [0.0] * samples
    for number, pair in enumerate(pairs(samples)):
        answers = runs[4 * number : 4 * number + 4]
        of_turns = 0.5 if pair[0] < 0 else 0.0
        for table, call in zip(tables, (place, -1), strict=True):
            # Of the four signs of the two increments, only what is odd in both is left.
            turns = [_turned(run.relative[call]) for run in answers]
            z = turns[0] - turns[1] - turns[2] + turns[3]
            table[pair] = float(z[2]) / (4 * _SMALL**2) - of_turns
            weights[pair[1]] = float((turns[0] - turns[1] + turns[2] - turns[3])[1]) / (4 * _SMALL)
    return Products(samples, tables[0], tables[1], tuple(weights))
