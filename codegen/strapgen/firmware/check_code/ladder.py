"""Runs a user's function along motions with known attitude: the order on a ladder of steps, and the drift on a cone."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import accumulate

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from strapgen import catalogue, pipeline
from strapgen.catalogue.methods.coning_coefficients import FORMS, Design, design
from strapgen.firmware.check_code.conformance import ORDER_WITHIN, Finding
from strapgen.firmware.check_code.foreign import ENDS, ForeignStep, Segment, SegmentRun, rotations
from strapgen.lab.convergence import MOST_ERROR, Convergence, fitted
from strapgen.lab.motions.motions import GENERAL, Motion, motion
from strapgen.lab.runs import drift_between, simulate
from strapgen.run.backends import backend as attitude_backend

Array = NDArray[np.float64]
#: The cone of the drift: half-angle in rad, frequency in rad/s, sampling interval in s, number of samples.
HALF_ANGLE, FREQUENCY, SAMPLING, SAMPLES = math.radians(1), 20 * math.pi, Fraction(1, 100), 6000
#: Axes about which a cone turns, and what turns that of `cone`, which is nearly y, to each: an integrator without
#: symmetry drifts differently on each.
CONES = {
    "y": np.eye(3),
    "z": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "x": np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]),
}
#: Numbers of steps of the ladder in a second of the motion, and the largest rate of the motion in rad/s, rounded up.
_LADDER, _FASTEST = (8, 16, 32, 64, 128), Fraction(6, 5)
#: Order of a linear rate between rates at instants.
_LINEAR_ORDER = 2
#: How much more than the worst of published steps a drift may be.
DRIFT_WITHIN = 1.2
#: Part of a drift about an axis that is none, and the factor of two that are the same.
_NO_PART, _SAME = 1e-4, 1.001
#: The same for errors at the longest step, which differ more with the start of the run.
_ERROR_WITHIN = 2.0


def ladder_segments(step: ForeignStep) -> list[Segment]:
    """Return the runs of the ladder, from the longest step to the shortest."""
    return [along(step, general_motion(), length, calls) for length, calls in rungs(step)]


def drift_segments(step: ForeignStep) -> list[Segment]:
    """Return the runs on the cones."""
    plain = along(step, cone(), SAMPLING * step.samples, SAMPLES // step.samples)
    return [Segment(plain.increments @ turn.T) for turn in CONES.values()]


def general_motion() -> Motion:
    """Return the motion of the ladder."""
    return motion("coning", **GENERAL)


def rungs(step: ForeignStep) -> list[tuple[Fraction, int]]:
    """Return step lengths in s of the motion, and the number of steps of each.

    The function is told the sampling interval all the same: the motion is as much faster or slower. At short intervals
    it becomes smaller with the interval, so that a gyro can measure its rates.
    """
    reach = min(Fraction(1), Fraction(step.most) * step.samples * _LADDER[0] / _FASTEST)
    return [(reach / count, count) for count in _LADDER]


def along(step: ForeignStep, profile: Motion, length: Fraction, calls: int) -> Segment:
    """Return the samples of a motion, those of calls before it included."""
    count = step.settling + calls
    if step.takes != ENDS:
        return Segment(profile.increments(length, count, step.samples))
    between = float(length / step.samples)
    ends = profile.rate(between * np.arange(1, count * step.samples + 1)) * between
    return Segment(ends.reshape(count, step.samples, 3))


def _align(step: ForeignStep, relative: Array, profile: Motion, length: Fraction) -> tuple[Array, Array]:
    """Return computed and true matrices, equal at the end of the calls before the run."""
    first = step.settling
    true = profile.attitude(np.arange(first, len(relative)) * float(length))
    after = relative[first:]
    return true[0] @ after[0].T @ after, true


def _error(step: ForeignStep, relative: Array, profile: Motion, length: Fraction) -> float:
    """Return the largest error of a run in rad."""
    computed, true = _align(step, relative, profile, length)
    return float((np.linalg.norm(computed - true, axis=(-2, -1)) / math.sqrt(2)).max())


def linear_rates(segment: Segment) -> Array:
    """Return the attitudes of a rate that is linear between instants, corrected for coning, relative to the first.

    Returns (1 + N, 3, 3).
    """
    count, samples, _ = segment.increments.shape
    ends = segment.increments.reshape(-1, 3)
    starts = np.concatenate([np.zeros((1, 3)), ends[:-1]])
    coefficient = float(design(1, 1).pairs[0, 1])
    vectors = (starts + ends) / 2 + coefficient * np.cross(starts, ends)
    relative = np.array([*accumulate(rotations(vectors), np.matmul, initial=np.eye(3))])
    return relative[::samples][: count + 1]


def ladder(step: ForeignStep, runs: tuple[SegmentRun, ...], standard: Design) -> Convergence:
    """Return the errors of a function on the ladder, beside the order of theory."""
    errors = []
    for (length, calls), run in zip(rungs(step), runs, strict=True):
        error = _error(step, run.relative, general_motion(), length)
        floor = _floor(step, calls)
        errors.append((float(length), error, floor < error < MOST_ERROR))
    theory = pipeline.derive(published_step("coning-compressed", standard)).order
    return fitted(step.source.function, step.source.precision, theory, errors)


def _floor(step: ForeignStep, calls: int) -> float:
    """Return the error in rad that rounding may cause in so many calls."""
    return 8 * step.unit * (calls + step.settling)


def order_on_ladder(step: ForeignStep, seen: Convergence) -> tuple[Finding, float | None]:
    """Return the finding on the order by the slope on the ladder, and the order."""
    needed = _LINEAR_ORDER if step.takes == ENDS else seen.predicted
    assert needed is not None
    words = (
        f"a {'linear rate between instants' if step.takes == ENDS else 'published correction'} has {needed}"
    )
    if seen.observed is None:
        errors = [rung.error_rad for rung in seen.rungs if rung.error_rad is not None]
        return Finding("order", False if min(errors) > MOST_ERROR else None, f"{seen.hidden}; {words}"), None
    least, text = needed - ORDER_WITHIN, f"observed {seen.observed:.3f}; {words}"
    return Finding("order", seen.observed > least, text, seen.observed, least), seen.observed


def order_in_float(
    step: ForeignStep, seen: Convergence, standard: Design, proved: int
) -> tuple[Finding, float | None]:
    """Return the finding on the order in single precision, whose rounding hides a slope, and the order.

    It rests on what the probes have proved; beside it the error at the longest step is held to that of published
    steps, as far as rounding shows it.
    """
    (length, calls), error = rungs(step)[0], seen.rungs[0].error_rad
    assert error is not None
    hidden = _floor(step, calls)
    if step.takes == ENDS:
        segment = ladder_segments(step)[0]
        published, needed = _error(step, linear_rates(segment), general_motion(), length), _LINEAR_ORDER
    else:
        published, needed = _published_error(step, standard, length, calls), seen.predicted or 0
    allowed = _ERROR_WITHIN * published + hidden
    is_too_low = proved < min(needed, 3)
    words = f"observed {proved}" if is_too_low else f"{min(proved, needed)} or more by its coefficients"
    text = (
        f"{words}, needed {needed}; at the longest step {error:.2g} rad, published {published:.2g}, "
        f"{step.rounding} hides {hidden:.2g}"
    )
    order = float(min(proved, needed))
    return Finding("order", not is_too_low and error <= allowed, text, order, float(min(needed, 3))), order


def _published_error(step: ForeignStep, standard: Design, length: Fraction, calls: int) -> float:
    """Return the largest error in rad of the published steps on the same samples."""
    between = length / step.samples * standard.increments
    errors = []
    for form in FORMS:
        published = attitude_backend(published_step(f"coning-{form}", standard))
        run = simulate(published, general_motion(), between, length * calls)
        errors.append(float(np.linalg.norm(run.drift, axis=1).max()))
    return max(errors)


def drift_on_cones(
    step: ForeignStep, runs: tuple[SegmentRun, ...], standard: Design, measured: Design | None
) -> tuple[Finding, Array, float | None]:
    """Return the finding on the drift on cones, the largest in deg/h about x, y, z, and its closed form."""
    length, duration = SAMPLING * step.samples, seconds(step.samples)
    drifts = {
        axis: turn @ _drift(step, turn.T @ run.relative @ turn, length, duration)
        for (axis, turn), run in zip(CONES.items(), runs, strict=True)
    }
    axis = max(drifts, key=lambda axis: _size(drifts[axis]))
    if _size(drifts[axis]) < _SAME * _size(drifts["y"]):
        axis = "y"
    by_axis, size = drifts[axis], _size(drifts[axis])
    published, beside, closed = _published_drifts(step, standard, length, duration)
    best = min(published, key=lambda name: published[name])
    least = DRIFT_WITHIN * max(closed or 0.0, *published.values())
    rounding = math.degrees(4 * step.unit * float(duration / length)) / float(duration) * 3600
    parts = ", ".join(f"{part:.4g}" if abs(part) > size * _NO_PART else "0" for part in by_axis)
    text = (
        f"{size:.4g} deg/h ({parts} about x, y, z) on a cone of {math.degrees(HALF_ANGLE):g} deg at "
        f"{FREQUENCY / (2 * math.pi):g} Hz about {axis}, samples at {float(1 / SAMPLING):g} Hz; "
        f"{beside}{best} {published[best]:.4g}"
    )
    holds = size <= least + rounding
    text += f"; limit {least + rounding:.4g}"
    if rounding > least / 100:
        text += f", of which {step.rounding} hides {rounding:.3g}"
        if measured is not None:
            left = abs(closed_form_deg_h(measured))
            text += f"; its coefficients leave {left:.4g}, limit {least:.4g}"
            holds = holds and left <= least
    return Finding("drift", holds, text, size, least + rounding), by_axis, closed


def _published_drifts(
    step: ForeignStep, standard: Design, length: Fraction, duration: Fraction
) -> tuple[dict[str, float], str, float | None]:
    """Return the drifts of published steps by name, the closed form in words, and the closed form."""
    if step.takes == ENDS:
        linear = _drift(step, linear_rates(drift_segments(step)[0]), length, duration)
        return {"a linear rate between instants": _size(linear)}, "", None
    closed = abs(closed_form_deg_h(standard))
    return generated_drifts(standard), f"closed form on {samples_in_words(standard)} {closed:.4g}, ", closed


def _drift(step: ForeignStep, relative: Array, length: Fraction, duration: Fraction) -> Array:
    """Return the drift of a run on the cone in deg/h."""
    computed, true = _align(step, relative, cone(), length)
    return drift_deg_h(drift_between(computed, true), duration)


def _size(drift: Array) -> float:
    return float(np.linalg.norm(drift))


def samples_in_words(standard: Design) -> str:
    """Return the samples of a correction in words."""
    before = f" and {standard.previous} before" if standard.previous else ""
    return f"{standard.increments} sample{'s' if standard.increments > 1 else ''}{before}"


def cone() -> Motion:
    """Return a coning motion whose axis stands still."""
    a, g = FREQUENCY * math.sin(HALF_ANGLE), -2 * FREQUENCY * math.sin(HALF_ANGLE / 2) ** 2
    return motion("coning", a_rad_s=a, b_rad_s=FREQUENCY, g_rad_s=g)


def closed_form_deg_h(standard: Design) -> float:
    """Return the drift on the cone that a coning correction leaves, to second order in the half-angle.

    Returns: computed minus true, in deg/h.

    >>> from strapgen.catalogue.methods.coning_coefficients import design
    >>> [round(closed_form_deg_h(design(1, previous)), 3) for previous in (0, 1)]
    [-127.339, -9.784]
    """
    symbols = dict(zip(("alpha", "omega", "T"), (HALF_ANGLE, FREQUENCY, SAMPLING), strict=True))
    rate = sp.sympify(standard.residual().expression).evalf(30, subs=symbols)
    return math.degrees(float(rate)) * 3600


def published_step(method: str, standard: Design) -> catalogue.Choice:
    """Return the step of Euler parameters with a published correction."""
    return catalogue.choose("euler", method, standard.increments, previous=standard.previous)


def drift_deg_h(drift: Array, duration: Fraction) -> Array:
    """Return the largest drift of a run, over its duration.

    `drift` (N, 3): in rad, reference axes. `duration`: in s. Returns (3,): in deg/h about x, y and z; its
    length is the largest.
    """
    largest = drift[np.linalg.norm(drift, axis=1).argmax()]
    rates: Array = np.degrees(largest) / float(duration) * 3600
    return rates


def generated_drifts(standard: Design) -> dict[str, float]:
    """Return the drift in deg/h that generated steps of published corrections leave, by their methods."""
    length, duration = SAMPLING * standard.increments, seconds(standard.increments)
    drifts = {}
    for form in FORMS:
        step = attitude_backend(published_step(f"coning-{form}", standard))
        rates = drift_deg_h(simulate(step, cone(), length, duration).drift, duration)
        drifts[f"coning-{form}"] = float(np.linalg.norm(rates))
    return drifts


def seconds(samples: int) -> Fraction:
    """Return the duration of a run on the cone in s: whole calls of so many samples."""
    return SAMPLING * (SAMPLES // samples * samples)
