"""The attitudes of a whole recording by a window: its start and its end are covered, and lost samples restored.

They are what `CommitLate` commits over the recording and a flush at its end, all intervals of the inside at once.
The compiler's extension point "lab.whole-recordings" is this module, see `covers` and `propagate_whole`.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any

import numpy as np

from strapgen.catalogue import AnyAlgorithm, Choice
from strapgen.catalogue.methods.window import Window
from strapgen.design.commit_late import commit_late_sources
from strapgen.design.commit_late.commit_late_sources import NORMALIZATIONS
from strapgen.design.commit_late.late_filters import NEXT, REACH, SHORT, LateFilters, short_place
from strapgen.design.commit_late.late_unit import GapError, SampleKind, refusal
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.renamed import renamed_parameters
from strapgen.lab.recordings.recording import History, Recording, record_interval
from strapgen.run.backends import backend as attitude_backend
from strapgen.run.backends import evaluator
from strapgen.run.evaluators import Array, Evaluator
from strapgen.run.increments import StepWindows, pulses


@renamed_parameters(increments="samples")
def recording_attitudes(
    window: str | Window,
    samples: Any,
    kinds: Sequence[int] | None = None,
    *,
    algorithm: AnyAlgorithm = "euler",
    backend: str = "numpy",
    initial: Any = None,
    sample_hz: float | str | Fraction | None = None,
) -> Array:
    """Return the attitudes of a whole recording, from its first instant to its last.

    Parameters
    ----------
    window : str or Window
        A window of the catalogue by its name, or a family of filters.
    samples : array_like, (N, 3)
        Angle increments of the intervals in rad, body axes; of no meaning where they were lost.
    kinds : sequence of int, (N,), optional
        What each sample is, as for `CommitLate.push`; by default all are good.
    algorithm : str, Choice or AttitudeAlgorithm, optional
        "euler" or "dcm", as for `CommitLate`.
    backend : str, optional
        A back end in floating point: "numpy", "c" or "c-float".
    initial : array_like, (state shape), optional
        Attitude at the start, by default zero rotation.
    sample_hz : number, optional
        Sampling rate in Hz, for a family that is designed for a gyro.

    Returns
    -------
    array, (N + 1, state shape)
        Body to reference.

    Raises
    ------
    GapError
        If a lost sample cannot be restored; the message has its number.
    InputError
        If a name is unknown, or a shape or a number is not allowed.

    Examples
    --------
    >>> turn = np.tile([0.0, 0.0, np.pi / 40], (20, 1))
    >>> recording_attitudes("window-7-7", turn)[[0, 10, 20]].round(6) + 0.0
    array([[0.      , 0.      , 0.      , 1.      ],
           [0.      , 0.      , 0.382683, 0.92388 ],
           [0.      , 0.      , 0.707107, 0.707107]])
    """
    filters = commit_late_sources.family(window, sample_hz)
    state = commit_late_sources.state_name("recording_attitudes", algorithm, filters)
    checks.choice("backend", backend, ("numpy", "c", "c-float"))
    row = checks.real_array("samples", samples, (3,))
    if row.ndim != 2:
        raise InputError(f"samples has shape {row.shape}; (N, 3) is needed")
    row = _restore(row, np.zeros(len(row), int) if kinds is None else np.asarray(kinds), filters)
    step, rotation, normalization = commit_late_sources.kernels(filters, state)
    loop = attitude_backend(step, backend=backend)
    turn = evaluator(rotation, backend)
    start = loop.identity if initial is None else initial
    start = checks.real_array("initial", start, loop.identity.shape, loop.dtype)
    if len(row) < filters.samples:
        few = [start]
        for place in range(len(row)):
            few.append(turn(few[-1], *_few(row, place, filters)))
        return np.stack(few)
    previous, ahead, count = filters.window.previous, filters.window.ahead, filters.samples
    first = [start]
    for place in range(previous):
        first.append(_advance(turn, first[-1], row[:count], place, filters))
    part = StepWindows(lambda begin, stop: row[begin:stop], 1, previous + ahead)
    inside = loop.propagate_parts(part, len(row) - previous - ahead)
    inside = evaluator(f"{state}-product", backend)(first[-1], inside)
    last = [inside[-1]]
    for place in range(count - ahead, count):
        last.append(_advance(turn, last[-1], row[-count:], place, filters))
    states: Array = np.concatenate([np.stack(first[:-1] or [start])[:previous], inside, np.stack(last)[1:]])
    # Rounding alone takes the states off their constraint, so that it can be taken out of each by itself.
    states[1:] = evaluator(normalization, backend)(states[1:])
    return states


def _advance(turn: Evaluator, state: Array, samples: Array, place: int, filters: LateFilters) -> Array:
    """Return a state after the interval at a place of a whole window of samples."""
    rows = np.array(filters.sets[place], float)
    result: Array = turn(state, *(rows @ samples))
    return result


def _few(row: Array, place: int, filters: LateFilters) -> Array:
    """Return the Legendre coefficients of the rate over an interval of a recording without a whole window."""
    width = min(len(row), SHORT)
    first = min(max(place - 1, 0), len(row) - width)
    rows = np.array(filters.short[short_place(width, place - first)], float)
    result: Array = rows @ row[first : first + width]
    result[0] = row[place]
    return result


def _restore(row: Array, kinds: Array, filters: LateFilters) -> Array:
    """Return the samples with lost ones restored, and merged samples split."""
    if kinds.shape != (len(row),) or kinds.dtype.kind not in "iu":
        raise InputError(
            f"kinds has shape {kinds.shape}; a whole number for each of {len(row)} samples is needed"
        )
    if not np.isin(kinds, list(SampleKind)).all():
        raise InputError(
            f"kinds holds {int(kinds[~np.isin(kinds, list(SampleKind))][0])}; 0, 1 and 2 are allowed"
        )
    result, last = row.copy(), -REACH - 1
    for number in map(int, np.flatnonzero(kinds)):
        gap = number - last if number - last <= REACH else 0
        reason = refusal(int(kinds[number]), gap, number)
        if reason:
            raise GapError(f"sample {number}: {reason}")
        if kinds[number] == SampleKind.MERGED:
            continue
        last = number
        merged = number + 1 < len(row) and kinds[number + 1] == SampleKind.MERGED
        both = row[number + 1] if merged else None
        result[number] = np.array(NEXT, float) @ result[number - SHORT : number]
        if both is not None:
            result[number + 1] = both - result[number]
        if number + REACH < len(row):
            taps = filters.restoration.merged if merged else filters.restoration.lost
            result[number] = np.array(taps, float) @ result[number - REACH : number + REACH + 1]
            if both is not None:
                result[number + 1] = both - result[number]
    return result


#: Back ends on which whole recordings are covered.
BACKENDS = ("numpy", "c", "c-float")


def covers(choice: Choice, backend: str) -> bool:
    """Return whether a recording is covered as a whole: by a family of filters with steps of one sample.

    >>> from strapgen import choose
    >>> covers(choose("euler", "window-7-7"), "c"), covers(choose("euler", "rk4"), "c")
    (True, False)
    """
    window = choice.window
    if (
        window is None
        or choice.name not in NORMALIZATIONS
        or backend not in BACKENDS
        or window.gyro is not None
    ):
        return False
    return window.increments == 1 and len(window.one_sided) == window.total_increments - 1


def propagate_whole(
    choice: Choice,
    backend: str,
    recording: Recording,
    orthonormalize: float | str | Fraction | None = None,
    record: float | str | Fraction | None = None,
    pulse: float | str | Fraction | None = None,
    initial: Any = None,
) -> History:
    """Run a window over all recorded increments.

    The intervals at both ends have filters with fewer samples on one side. The states are normalized, whatever the
    interval of orthonormalization. `initial` (3, 3): direction cosine matrix at the start; by default no rotation.

    >>> from strapgen import choose
    >>> history = propagate_whole(choose("euler", "window-3-3"), "numpy", Recording(0.0, 0.01, np.full((9, 3), 1e-3)))
    >>> history.states.shape, history.time[[0, -1]].tolist()
    ((10, 4), [0.0, 0.09])
    """
    window = choice.window
    if window is None or not covers(choice, backend):
        raise InputError(f"{choice.kernel} on back end {backend} does not cover the ends of a recording")
    row, step = recording.samples, recording.interval
    if not len(row):
        raise InputError("the recording holds 0 increments; a step needs 1")
    if orthonormalize is not None:
        record_interval("orthonormalize", orthonormalize, step)
    every = 1 if record is None else record_interval("record", record, step)
    if every > len(row):
        raise InputError(f"record {record} s is longer than the recording, {len(row) * step:.6g} s")
    if pulse is not None:
        row = pulses(row[:, None], pulse)[:, 0]
    if initial is not None and choice.name != "dcm":
        initial = evaluator(f"{choice.name}-from-dcm")(np.asarray(initial, float))
    states = recording_attitudes(window, row, algorithm=choice.name, backend=backend, initial=initial)[
        ::every
    ]
    time = recording.start + step * every * np.arange(len(states), dtype=np.float64)
    return History(time, states, step, 0)
