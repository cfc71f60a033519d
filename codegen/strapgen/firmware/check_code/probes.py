"""Probes a user's function with small increments: the rotation that it makes of each, and of every two of them.

To second order the rotation vector of a run is the sum of all increments and of their products, each with a
coefficient. A probe turns by one increment about x, by a later one about y, reads the rotation about z, and does the
same with the axes interchanged: half the difference belongs to the cross product. An exact product of rotations gives
1/2 to two increments of different calls; what a function adds to that, and all that it gives to two increments of one
call, is its coning correction.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from strapgen.firmware.check_code.foreign import (
    ENDS,
    SCALARS,
    SENSES,
    Convention,
    ForeignStep,
    Segment,
    SegmentRun,
    rotation_vectors,
    rotations,
)
from strapgen.lab.motions.motions import motion
from strapgen.lab.runs import drift_between

Array = NDArray[np.float64]
Table = dict[tuple[int, int], float]
#: Largest difference of an answer to a rotation about an axis, in units of the rotation.
DIRECTION_WITHIN = 0.1
#: The same for one that is no fault in itself, and for a factor that is known.
SIZE_WITHIN = _FACTOR_WITHIN = 0.01
#: Most samples from before a call that a published correction takes.
MOST_PREVIOUS = 3
#: Rotation in rad of a call that shows directions: small enough to be read when it comes out 57.3 times as large.
_TURN = 0.001
#: Size of an increment of a product in rad, by precision: its square is seen, its fourth power is not.
_SMALL, _SMALL_COARSE = {"double": 0.002}, 0.02
#: Calls without rotation after a probe, in which what comes late arrives.
LATE = 2
#: Samples from before a call whose products with those of the call are looked at: one more, for a late correction.
BEFORE = MOST_PREVIOUS + 1
#: Fewest calls of each of two large rotations, and their angle in rad.
_CALLS, _LARGE = 20, 0.5
#: The axes of an older and of a newer increment, the axis of their cross product, and its sign.
AXES = [(0, 1, 2, 1), (1, 0, 2, -1), (1, 2, 0, 1), (2, 1, 0, -1), (2, 0, 1, 1), (0, 2, 1, -1)]
_SIGNS = list(product((1, -1), repeat=2))


@dataclass(frozen=True)
class Directions:
    """Responses of a function to rotations about the axes."""

    #: (3, 3): rotation vector of the first call of a constant rate, and of one after many calls, in units of
    #: the rotation about each axis: a column for each
    at_once: Array
    steady: Array
    #: Number of samples by which a rotation at a growing rate comes too late
    lag: float
    #: Angle in rad between the attitude after a rotation about x and then one about y, and the true one
    order_of_turns: float
    #: The same for the attitude of the two rotations in the other order
    other_order: float


def direction_segments(step: ForeignStep) -> list[Segment]:
    """Return the segments that `directions` needs of a function."""
    samples, calls = step.samples, step.settling + 1
    segments = []
    for axis, sign in product(range(3), (1, -1)):
        increments = np.zeros((calls, samples, 3))
        increments[:, :, axis] = sign * _TURN / samples
        segments.append(Segment(increments))
    for sign in (1, -1):
        ramp = np.zeros((calls * samples, 3))
        ramp[:, 0] = sign * _slope(step) * (np.arange(len(ramp)) + (1.0 if step.takes == ENDS else 0.5))
        segments.append(Segment(ramp.reshape(calls, samples, 3)))
    count = step.calls_for(_LARGE, _CALLS)
    turns = np.zeros((2 * count, samples, 3))
    turns[:count, :, 0] = turns[count:, :, 1] = _LARGE / (count * samples)
    return [*segments, Segment(turns)]


def _slope(step: ForeignStep) -> float:
    """Return how much a sample of the growing rate is larger than the one before, in rad."""
    return _TURN / ((step.settling + 1) * step.samples)


def directions(step: ForeignStep, runs: Sequence[SegmentRun]) -> Directions:
    """Return the answer to rotations about the axes."""
    first = rotation_vectors(np.array([run.relative[1] for run in runs[:8]]))
    last = rotation_vectors(np.array([run.relative[-2].T @ run.relative[-1] for run in runs[:8]]))
    at_once, steady = ((turns[:6:2] - turns[1:6:2]).T / (2 * _TURN) for turns in (first, last))
    numbers = np.arange(step.settling * step.samples, (step.settling + 1) * step.samples) + 0.5
    ramp = float(last[6, 0] - last[7, 0]) / (2 * _slope(step))
    lag = (float(numbers.sum()) - ramp) / step.samples
    about_x, about_y = (motion("constant", **{key: _LARGE}).attitude(1.0) for key in ("x_rad_s", "y_rad_s"))
    turned = runs[8].relative[-1]
    angles = (
        float(np.linalg.norm(drift_between(turned, true))) for true in (about_x @ about_y, about_y @ about_x)
    )
    return Directions(at_once, steady, lag, *angles)


@dataclass(frozen=True)
class Products:
    """The coefficients of cross products, older times newer sample, beside the sum of samples and exact products."""

    #: Samples of a call
    samples: int
    #: Coefficients after the call with the newer sample, and after more calls without rotation, means of the
    #: three axes. Samples of the call have the numbers 0 to samples - 1, those before it are negative
    at_once: Table
    finally_: Table
    #: By how much of each sample of a call the attitude turns in the end; 1 for each is right
    weights: tuple[float, ...] = ()
    #: Coefficients in the end about x, y and z; none where they are alike
    by_axis: tuple[Table, ...] = ()
    #: What rounding and terms of fourth order may add to a coefficient
    noise: float = 0.0


def pairs(samples: int) -> list[tuple[int, int]]:
    """Return the pairs of samples whose products are looked at: the newer one is of the call."""
    return [(older, newer) for newer in range(samples) for older in range(-BEFORE, newer)]


def small_turn(step: ForeignStep) -> float:
    """Return the size of the increments of products in rad."""
    return min(_SMALL.get(step.source.precision, _SMALL_COARSE), step.most)


def product_segments(step: ForeignStep) -> list[Segment]:
    """Return the segments that `products` needs."""
    samples, small = step.samples, small_turn(step)
    calls_before = -(-BEFORE // samples)
    segments = []
    for (older, newer), axes, signs in product(pairs(samples), AXES, _SIGNS):
        row = np.zeros(((calls_before + 1 + LATE) * samples, 3))
        row[calls_before * samples + older, axes[0]] = signs[0] * small
        row[calls_before * samples + newer, axes[1]] = signs[1] * small
        segments.append(Segment(row.reshape(-1, samples, 3)))
    return segments


def products(step: ForeignStep, runs: Sequence[SegmentRun], *, exact: bool) -> Products:
    """Return the coefficients of all products."""
    samples, small = step.samples, small_turn(step)
    known = pairs(samples)
    shape = (len(known), len(AXES), len(_SIGNS))
    of_turns = _odd(_exact_turns(small))[0] / small**2
    tables = []
    for call in (-(-BEFORE // samples) + 1, -1):
        turns = rotation_vectors(np.array([run.relative[call] for run in runs])).reshape(*shape, 3)
        per_axis = _odd(turns) / small**2
        per_axis -= np.array([older < 0 for older, _ in known])[:, None] * of_turns
        tables.append(per_axis)
    signs = np.array(_SIGNS)[:, 1]
    newer_axes = [axes[1] for axes in AXES]
    linear = (turns * signs[:, None]).mean(axis=2)[:, range(len(AXES)), newer_axes].mean(axis=1) / small
    weights = [
        float(linear[[newer == k for _, newer in known]].mean()) for k in range(samples)
    ]  # of the newer sample of a pair
    now, end = (dict(zip(known, map(float, table.mean(axis=1)), strict=True)) for table in tables)
    by_axis = tuple(dict(zip(known, map(float, tables[1][:, axis]), strict=True)) for axis in range(3))
    noise = 4 * step.unit / small + (0.0 if exact else small**2)
    return Products(samples, now, end, tuple(weights), by_axis, noise)


def _odd(turns: Array) -> Array:
    """Return the part about x, y, z of rotations (N, axes, signs, 3) that belongs to the cross product."""
    weights = np.array([first * second for first, second in _SIGNS])
    return about_axes((turns * weights[:, None]).mean(axis=2))


def about_axes(odd: Array) -> Array:
    """Return the part about x, y, z (N, 3) of what cross products with `AXES` (N, axes, 3) make."""
    parts = np.zeros((len(odd), 3))
    for number, (_, _, axis, sign) in enumerate(AXES):
        parts[:, axis] += sign * odd[:, number, axis] / 2
    return parts


def _exact_turns(small: float) -> Array:
    """Return the rotation vectors of exact products of rotations by two increments, (1, axes, signs, 3)."""
    vectors = np.zeros((2, len(AXES), len(_SIGNS), 3))
    for number, (older, newer, _, _) in enumerate(AXES):
        vectors[0, number, :, older] = small * np.array(_SIGNS)[:, 0]
        vectors[1, number, :, newer] = small * np.array(_SIGNS)[:, 1]
    first, second = rotations(vectors.reshape(2, -1, 3))
    return rotation_vectors(first @ second).reshape(1, len(AXES), len(_SIGNS), 3)


#: Rotation below which a function does not turn at all, in units of the rotation.
_NOTHING = 1e-5


def convention_of(step: ForeignStep, declared: Directions) -> tuple[Convention | None, Directions]:
    """Return the convention that fits a function, the declared one first; None if none does."""
    if fits(declared.steady):
        return step.convention, declared
    scalars = SCALARS if step.source.arguments.elements == 4 else SCALARS[:1]
    others = [Convention(scalar, sense) for scalar, sense in product(scalars, SENSES)]
    ours = step.convention
    others.sort(key=lambda other: (other.scalar != ours.scalar) + (other.sense != ours.sense))
    for other in others:
        done = step.run(direction_segments(step), other)
        if not done.stopped:
            response = directions(step, done.segments)
            if fits(response.steady):
                return other, response
    return None, declared


def fits(response: Array) -> bool:
    """Return whether the computed rotations about the axes equal the input."""
    return bool(np.abs(response - np.eye(3)).max() < DIRECTION_WITHIN)


def off(response: Directions) -> float:
    """Return the largest difference of an answer to a rotation about an axis, in units of the rotation."""
    return float(np.abs(response.steady - np.eye(3)).max())


def sizes_in_words(response: Array) -> str:
    """Return in words by how much rotations come out too large that are about the right axes.

    `response` (3, 3): a rotation vector for each axis, in units of the rotation about it.
    """
    sizes = np.diag(response)
    if np.abs(response - np.diag(sizes)).max() > SIZE_WITHIN:
        return "a small rotation about an axis turns about others too"
    if np.ptp(sizes) < SIZE_WITHIN:
        return f"rotations come out {sizes.mean():.4g} times as large as they are fed"
    each = ", ".join(f"{size:.4g}" for size in sizes)
    return f"rotations about x, y, z come out {each} times as large as they are fed"


def in_words(step: ForeignStep, response: Array) -> str:
    """Return in words how rotations about the axes come out.

    `response` (3, 3): a rotation vector for each axis, in units of the rotation about it.
    """
    if not np.isfinite(response).all():
        return "a small rotation gives no attitude near the one before it"
    sizes = np.abs(response).max(axis=0)
    if np.all(sizes < _NOTHING):
        return "a small rotation about an axis does not turn the attitude"
    signs = np.where(np.abs(response) > sizes / 2, np.sign(response), 0)
    one_each = np.array_equal(np.abs(signs).sum(axis=0), np.ones(3)) and np.array_equal(
        np.abs(signs).sum(axis=1), np.ones(3)
    )
    factor = float(np.median(sizes))
    if not one_each or not np.allclose(response, factor * signs, atol=DIRECTION_WITHIN * factor):
        return "a small rotation about an axis is wrong in size or axis"
    parts = []
    if abs(factor - 1) >= DIRECTION_WITHIN:
        parts.append(_factor(step, factor))
    if not np.array_equal(signs, np.eye(3)):
        names = [
            ("-" if signs[:, k].sum() < 0 else "") + "xyz"[int(np.abs(signs[:, k]).argmax())]
            for k in range(3)
        ]
        parts.append(f"rotations about x, y, z turn about {', '.join(names)}")
    return "; ".join(parts)


def _factor(step: ForeignStep, factor: float) -> str:
    """Return in words the cause of rotations that are too large by a factor."""
    interval = float(step.interval)
    known = {
        math.degrees(1): "degrees for radians, it turns radians into degrees",
        math.radians(1): "degrees for radians, it takes radians for degrees",
        interval: "it multiplies by the sampling interval what is an increment already",
        1 / interval: "it does not multiply rates by the sampling interval",
    }
    size = f"rotations come out {factor:.4g} times as large as they are fed"
    for value, said in known.items():
        if abs(factor / value - 1) < _FACTOR_WITHIN:
            return f"{said}: {size}"
    return size


#: Calls without rotation: many, so that a rate as slow as that of the earth is seen in single precision too.
_FEW, _MANY = 10, 1000
#: Rotation in rad that leads to another attitude, and fewest calls of it.
_APPROACH, _APPROACH_CALLS = (0.5, -1.1, 0.6), 10
#: Rotation of all these calls that is no rounding, in units in the last place.
_UNITS = 64
#: Largest difference of two rates that are the same, by their size.
_ALIKE = 0.05
#: Part of a rate about an axis that is none.
_NO_RATE = 1e-4


@dataclass(frozen=True)
class Rest:
    """States of a function without rotation."""

    #: Largest change of an element of the state
    moved: float
    #: (3,): rotation of a call, the same in reference axes at every attitude, in rad; 0 if there is none
    frame: Array
    #: (3,): the same in body axes
    body: Array
    #: Whether it turns otherwise than a frame that moves at a constant rate
    strays: bool

    def causes(self, seconds: float) -> list[str]:
        """Return the likely causes, for calls of a duration in s."""
        said = []
        if self.frame.any():
            said.append(f"the frame moves at a constant rate, {_rate(-self.frame / seconds)}")
        if self.body.any():
            said.append(f"a constant rate is added to that of the gyro, {_rate(self.body / seconds)}")
        return said


def rest_segments(step: ForeignStep) -> list[Segment]:
    """Return the segments that `rest` needs of a function."""
    nothing = np.zeros((_MANY, step.samples, 3))
    count = step.calls_for(float(np.linalg.norm(_APPROACH)), _APPROACH_CALLS)
    turns = np.tile(np.array(_APPROACH) / (count * step.samples), (count, step.samples, 1))
    return [Segment(nothing), Segment(np.concatenate([turns, nothing[: step.settling], nothing]))]


def rest(step: ForeignStep, runs: Sequence[SegmentRun]) -> Rest:
    """Return the states of a function without rotation."""
    states, none = runs[0].states, np.zeros(3)
    reference = states[0] if states.shape[1] != 3 else none  # of a rotation vector nothing is to be left
    moved = float(np.abs(states - reference).max())
    in_frame, in_body = zip(*map(_turns_of_a_call, runs), strict=True)
    size = float(np.linalg.norm(in_frame[0]))
    if size * _MANY < _UNITS * step.unit:
        return Rest(moved, none, none, strays=False)
    same = [
        float(np.linalg.norm(here - there)) < _ALIKE * size + 2 * step.unit
        for here, there in (in_frame, in_body)
    ]
    if same == [True, False]:
        return Rest(moved, in_frame[0], none, strays=False)
    return Rest(moved, none, in_body[0] if same == [False, True] else none, strays=True)


def _turns_of_a_call(run: SegmentRun) -> tuple[Array, Array]:
    """Return the rotation vector of a call without rotation in reference axes and in body axes; nan if it changes."""
    calls = run.relative[-1 - _MANY :]
    count = _MANY if np.linalg.norm(rotation_vectors(calls[0].T @ calls[_FEW])) * _MANY < _FEW else _FEW
    first, half, last = calls[0], calls[count // 2], calls[count]
    whole, part = (rotation_vectors(first.T @ after) / count for after in (last, half))
    if np.linalg.norm(whole - 2 * part) > _ALIKE * np.linalg.norm(whole):
        return np.full(3, np.nan), np.full(3, np.nan)
    return run.start @ rotation_vectors(last @ first.T) / count, whole


def _rate(rate: Array) -> str:
    hourly = np.degrees(rate) * 3600
    size = math.hypot(*hourly)
    parts = ", ".join(f"{part:.4g}" if abs(part) > size * _NO_RATE else "0" for part in hourly)
    return f"{size:.4g} deg/h ({parts} about x, y, z)"
