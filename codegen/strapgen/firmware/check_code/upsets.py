"""Looks at a user's function when its input fails: intervals of 0, negative and large, a NaN; and at long runs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from strapgen.firmware.check_code.bridge import ForeignSource
from strapgen.firmware.check_code.conformance import Finding
from strapgen.firmware.check_code.foreign import (
    RATE_INPUTS,
    Convention,
    ForeignStep,
    Segment,
    departure,
    lengths,
    rotation_vectors,
)
from strapgen.firmware.check_code.foreign_arguments import INTERVAL, STEP, is_whole
from strapgen.firmware.check_code.ladder import drift_segments

Array = NDArray[np.float64]
#: Rate in rad/s about x, y, z before and after an upset, and calls of each; with the largest interval fed in s.
_RATE, _CALLS, _LONGEST = (0.3, -0.2, 0.4), 20, 1.0
#: Calls after a NaN in which a function may recover.
_RECOVERY = 100
#: Samples of a long run of compiled and of interpreted code.
_LONG, _LONG_INTERPRETED = 500_000, 20_000
#: Samples of the cone after which it repeats, and every how many calls the length is read.
_PERIOD, _READ = 10, 50
#: Departures of C C' from the unit matrix in a long run: one that a normalized state keeps, and one that truncation of
#: a good step without normalization leaves; and rounding of a call in units in the last place.
_NORM_WITHIN, _TRUNCATION, _UNITS = 1e-4, 2e-3, 4
#: Largest change without rotation that is rounding, in units in the last place.
_STILL = 64
#: Calls of a fast rotation, parts of the fastest rate, and the largest part of a rotation that rounding takes.
_FAST_CALLS, _PARTS, _FAST_WITHIN = 40, (1.0, 0.5, 0.25, 0.125, 0.0625), 0.05
#: Largest part of a rotation by which two are taken as the same.
_ALIKE = 0.02


def upsets(
    step: ForeignStep, convention: Convention, *, long: bool, rotates: bool = True
) -> Iterator[tuple[Finding, str]]:
    """Yield the findings of a function whose input fails, and of a long run, each with the cause of a failure or "".

    `rotates`: whether a slow rotation is right, so that a fast one that is not overflows.
    """
    if step.source.arguments.elements and step.source.arguments.named(INTERVAL, STEP):
        yield from _intervals(step, convention)
    if is_whole(step.source.arguments.samples):
        yield _fast(step, convention, rotates)
    else:
        yield _not_a_number(step, convention)
    if long and step.source.arguments.elements > 3:
        yield _long_run(step, convention)


def _fast(step: ForeignStep, convention: Convention, rotates: bool) -> tuple[Finding, str]:
    """Return whether integers hold the fastest rotation that a gyro measures, about each axis in both directions."""
    rates = [step.most / float(step.interval) * part for part in _PARTS]
    fed = [rate * sign * axis for rate in rates for axis in np.eye(3) for sign in (1, -1)]
    calls = np.ones((_FAST_CALLS, step.samples, 3)) * float(step.interval)
    done, parts = step.outputs([Segment(calls * rate) for rate in fed], convention)
    if done.stopped:
        return _stopped("fast", f"at {rates[0]:.3g} rad/s {done.stopped}")
    off = []
    for rate, part in zip(fed, parts, strict=True):
        matrices = convention.matrices(part[step.settling :, : step.source.arguments.elements])
        turns = rotation_vectors(np.swapaxes(matrices[:-1], -1, -2) @ matrices[1:])
        angle = rate * float(step.interval) * step.samples
        off.append(float(np.linalg.norm(turns - angle, axis=1).max() / np.linalg.norm(angle)))
    worst = [max(off[k : k + 6]) for k in range(0, len(off), 6)]
    held = next((rate for rate, each in zip(rates, worst, strict=True) if each <= _FAST_WITHIN), 0.0)
    at = f"at {rates[0]:.3g} rad/s ({np.degrees(rates[0]):.4g} deg/s) its integers"
    if worst[0] <= _FAST_WITHIN:
        return Finding("fast", True, f"{at} hold the rotation", worst[0], _FAST_WITHIN), ""
    wrong = f"a call turns wrong by {worst[0]:.3g} of it; it holds up to {held:.3g} rad/s"
    if not rotates:
        return Finding("fast", None, f"{at} may overflow, or the rotation is wrong: {wrong}", worst[0]), ""
    text = f"{at} overflow: {wrong}"
    return Finding("fast", False, text, worst[0], _FAST_WITHIN), text


def _steady(step: ForeignStep, calls: int) -> Array:
    angle = np.array(_RATE) * float(step.interval)
    return np.tile(angle, (calls, step.samples, 1))


def _upset(step: ForeignStep, interval: float | None, factor: float) -> Segment:
    """Return a steady rate with one call between that has another interval, and a multiple of the increments."""
    increments = _steady(step, 2 * _CALLS + 1)
    increments[_CALLS] *= factor
    intervals = np.full(len(increments), float(step.interval))
    intervals[_CALLS] = intervals[_CALLS] if interval is None else interval
    return Segment(increments, intervals=intervals)


def _intervals(step: ForeignStep, convention: Convention) -> Iterator[tuple[Finding, str]]:
    """Yield what intervals of 0 without rotation do, which must be nothing, and what other ones do."""
    whole, of_rates = float(step.interval), step.takes in RATE_INPUTS
    cases = {
        "0 at rest": _upset(step, 0.0, 0.0),
        "usual at rest": _upset(step, None, 0.0),
        f"0 at {np.linalg.norm(_RATE):.2g} rad/s": _upset(step, 0.0, 1.0),
        f"{-whole:g} s": _upset(step, -whole, 1.0),
        f"{_LONGEST:g} s": _upset(step, _LONGEST, 1.0 if of_rates else _LONGEST / whole),
    }
    done, parts = step.outputs([*cases.values()], convention)
    if done.stopped:
        yield _stopped(
            "dropouts", f"with an interval of 0, of {-whole:g} s or of {_LONGEST:g} s {done.stopped}"
        )
        return
    moved, usual = (_change(step, part) for part in parts[:2])
    off, allowed = float(np.abs(moved).max()), _STILL * step.unit
    holds: bool | None = off <= allowed  # not of NaN
    says = "stays as it is" if holds else f"changes by {off:.3g}" if np.isfinite(off) else "becomes NaN"
    text = f"at dt = 0 without rotation the attitude {says}"
    if not holds and np.abs(moved - usual).max() <= allowed:
        holds, text = None, f"{text}, as it does at any dt"
    cause = text if holds is False else ""
    yield Finding("dt of 0", holds, text, off if np.isfinite(off) else None, allowed), cause
    others = {name: _said(step, convention, part) for name, part in [*zip(cases, parts, strict=True)][2:]}
    unused = of_rates and all(abs(part - 1) < _ALIKE for _, part in others.values())
    cause = "dt is an argument, and is not used" if unused else ""
    text = "; ".join(f"dt of {name}: {words}" for name, (words, _) in others.items())
    yield Finding("dropouts", False if unused else None, text), cause


def _change(step: ForeignStep, outputs: Array) -> Array:
    """Return what the call of an upset changes of the attitude; of a rotation vector, all of it."""
    at, outputs = step.settling + _CALLS, outputs[:, : step.source.arguments.elements]
    change: Array = outputs[at] - outputs[at - 1] if step.source.arguments.elements > 3 else outputs[at]
    return change


def _said(step: ForeignStep, convention: Convention, outputs: Array) -> tuple[str, float]:
    """Return in words what a call with another interval did, and how much of a usual call's rotation it makes."""
    outputs = outputs[step.settling :, : step.source.arguments.elements]
    in_call, in_the_end = (np.isfinite(outputs[k]).all() for k in (_CALLS, -1))
    if not (in_call and in_the_end):
        words = "NaN in later calls" if in_call else "NaN, then it recovers" if in_the_end else "NaN"
        return words, float("nan")
    matrices = convention.matrices(outputs)
    before, at, after = (
        rotation_vectors(matrices[k - 1].T @ matrices[k]) for k in (_CALLS - 1, _CALLS, len(matrices) - 1)
    )
    part = float(at @ before) / float(before @ before)
    frozen = float(np.linalg.norm(after)) < _ALIKE * float(np.linalg.norm(before))
    words = "the attitude stays" if abs(part) < _ALIKE else f"it turns by {part:.3g} of a usual call"
    return f"{words}{', then freezes' * frozen}", part


def _stopped(name: str, text: str) -> tuple[Finding, str]:
    """Return the finding on a run that stopped: a fault, but for an exception at wrong input, which one may handle."""
    held = None if " it raises " in text and name in ("dropouts", "NaN") else False
    return Finding(name, held, text), "" if held is None else text


def _not_a_number(step: ForeignStep, convention: Convention) -> tuple[Finding, str]:
    """Return what one NaN among the samples does to the attitudes after it."""
    increments = _steady(step, _CALLS + _RECOVERY)
    increments[_CALLS, 0, 0] = np.nan
    done, parts = step.outputs([Segment(increments)], convention)
    if done.stopped:
        return _stopped("NaN", f"at a NaN in one sample {done.stopped}")
    finite = np.array([np.isfinite(row).all() for row in parts[0][step.settling + _CALLS :]])
    if finite.all():
        text = "a NaN in one sample does not reach the attitude"
    elif finite[-1]:
        last = int(np.flatnonzero(~finite)[-1]) + 1
        text = f"after a NaN in one sample the attitude is not finite in {last} call{'s' if last > 1 else ''}, then is"
    else:
        text = f"a NaN in one sample stays in the attitude ({_RECOVERY} calls were seen)"
    return Finding("NaN", None, text), ""


def _long_run(step: ForeignStep, convention: Convention) -> tuple[Finding, str]:
    """Return the finding on the length of the state in a long run on a cone."""
    samples = _LONG if isinstance(step.source, ForeignSource) else _LONG_INTERPRETED
    cone = drift_segments(step)[0].increments.reshape(-1, 3)[: _PERIOD * step.samples]
    turns = -(-samples // len(cone))
    increments = np.tile(cone, (turns, 1)).reshape(-1, step.samples, 3)
    done, parts = step.outputs([Segment(increments, settled=False)], convention)
    calls = f"in {len(increments)} calls"
    if done.stopped:
        return _stopped("long run", f"{calls} {done.stopped}")
    states = np.vstack([parts[0][::_READ], parts[0][-1:]])[:, : step.source.arguments.elements]
    if not np.isfinite(states).all():
        text = f"{calls} the attitude becomes infinite or NaN"
        return Finding("long run", False, text), text
    off, rounding = departure(states), _UNITS * step.unit * len(increments)
    text = f"{calls} on the cone C C' departs from the unit matrix by at most {off:.3g}"
    if off <= _NORM_WITHIN:
        return Finding("long run", True, text, off, _NORM_WITHIN), ""
    if off <= max(rounding, _TRUNCATION):
        what = "rounding" if off <= rounding else "truncation"
        return Finding("long run", None, f"{text}: {what} adds up without normalization", off), ""
    cause = f"the state's length is off in long runs: {lengths(states)[-1]:.6g} after {len(increments)} calls"
    return Finding("long run", False, text, off, max(rounding, _TRUNCATION)), cause
