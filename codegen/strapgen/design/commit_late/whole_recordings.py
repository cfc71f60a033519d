"""Runs a window over a whole recording: its first and its last samples too, where steps begin and end inside."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from strapgen.catalogue import Choice
from strapgen.design.commit_late.commit_late_sources import NORMALIZATIONS
from strapgen.design.commit_late.late_recording import recording_attitudes
from strapgen.ir.exceptions import InputError
from strapgen.lab.recordings.recording import History, Recording, record_interval
from strapgen.run.increments import pulses

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
    return window.increments == 1 and len(window.one_sided) == window.samples - 1


def propagate_whole(
    choice: Choice,
    backend: str,
    recording: Recording,
    orthonormalize: float | str | Fraction | None = None,
    record: float | str | Fraction | None = None,
    pulse: float | str | Fraction | None = None,
) -> History:
    """Run a window over all recorded increments, from zero rotation.

    The intervals at both ends have filters with fewer samples on one side. The states are normalized, whatever the
    interval of orthonormalization.

    >>> from strapgen import choose
    >>> history = propagate_whole(choose("euler", "window-3-3"), "numpy", Recording(0.0, 0.01, np.full((9, 3), 1e-3)))
    >>> history.states.shape, history.time[[0, -1]].tolist()
    ((10, 4), [0.0, 0.09])
    """
    window = choice.window
    if window is None or not covers(choice, backend):
        raise InputError(f"{choice.kernel} on back end {backend} does not cover the ends of a recording")
    row, step = recording.increments, recording.interval
    if not len(row):
        raise InputError("the recording holds 0 increments; a step needs 1")
    if orthonormalize is not None:
        record_interval("orthonormalize", orthonormalize, step)
    every = 1 if record is None else record_interval("record", record, step)
    if every > len(row):
        raise InputError(f"record {record} s is longer than the recording, {len(row) * step:.6g} s")
    if pulse is not None:
        row = pulses(row[:, None], pulse)[:, 0]
    states = recording_attitudes(window, row, algorithm=choice.name, backend=backend)[::every]
    time = recording.start + step * every * np.arange(len(states), dtype=np.float64)
    return History(time, states, step, 0)
