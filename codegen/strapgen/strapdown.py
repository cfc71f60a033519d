"""Algorithms in two speeds along recorded gyro and accelerometer increments: attitude and velocity, cycle by cycle."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen import backends, checks, two_speed
from strapgen.backends import BACKENDS
from strapgen.exceptions import InputError
from strapgen.fixedpoint import Settings
from strapgen.recording import InertialRecording
from strapgen.targets import FIXED

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Course:
    """What an algorithm makes of a recording, navigation cycle by navigation cycle.

    Parameters
    ----------
    time : array, (N,)
        Ends of the navigation cycles in s, on the recording's clock.
    states : array, (N, state shape)
        Attitude at these times, body to navigation axes.
    angles : array, (N, 3)
        The same as roll, pitch, heading in rad.
    velocity_changes : array, (N, 3)
        Integral of the specific force over each cycle in m/s, navigation axes as they turn.
    elements : tuple of str
        Names of the elements of a state.
    unused : int
        Increments at the end that make no whole cycle.
    """

    time: Array
    states: NDArray[Any]
    angles: Array
    velocity_changes: Array
    elements: tuple[str, ...]
    unused: int


def course(
    algorithm: str,
    recording: InertialRecording,
    *,
    fast_cycles: int,
    slow_cycles: int = 1,
    sculling: int = 2,
    backend: str = "numpy",
    settings: Settings | None = None,
    initial_angles: Iterable[float] = (0.0, 0.0, 0.0),
    frame_rate: Iterable[float] = (0.0, 0.0, 0.0),
) -> Course:
    """Run an algorithm in two speeds along a recording.

    The first fast cycle takes the increment before it as zero, as at a start from rest.

    Parameters
    ----------
    algorithm : str
        "dcm" or "euler".
    recording : InertialRecording
        An increment each fast cycle.
    fast_cycles, slow_cycles : int
        Fast cycles in a slow cycle, slow cycles in a navigation cycle.
    sculling : int, optional
        1 or 2, as for `TwoSpeed`.
    backend : str, optional
        A key of `strapgen.backends.BACKENDS`.
    settings : Settings, optional
        For fixed point; ranges that it does not state are made for the recording.
    initial_angles : iterable of float, (3,), optional
        Roll, pitch, heading at the start in rad.
    frame_rate : iterable of float, (3,), optional
        Rate of the navigation frame in rad/s, navigation axes.

    Returns
    -------
    Course

    Raises
    ------
    InputError
        If a name or a number is not allowed, the recording is shorter than a navigation cycle, or the numbers leave the
        range of the back end.

    Examples
    --------
    Level, at rest but for a turn about the vertical; what is felt is the reaction to gravity:

    >>> level = InertialRecording(0.0, 0.01, np.tile([0, 0, 1e-3], (40, 1)), np.tile([0, 0, 0.0981], (40, 1)))
    >>> made = course("dcm", level, fast_cycles=4, slow_cycles=5)
    >>> made.time, made.angles[:, 2].round(6)
    (array([0.2, 0.4]), array([0.02, 0.04]))
    >>> made.velocity_changes[-1].round(6)
    array([0.   , 0.   , 1.962])
    """
    checks.choice("backend", backend, BACKENDS)
    checks.count("fast_cycles", fast_cycles, largest=checks.MOST)
    checks.count("slow_cycles", slow_cycles, largest=checks.MOST)
    of_cycle = fast_cycles * slow_cycles
    cycles, unused = divmod(len(recording.increments), of_cycle)
    if cycles < 1:
        raise InputError(
            f"the recording holds {len(recording.increments)} increments; a navigation cycle needs {of_cycle}"
        )
    used = cycles * of_cycle
    angles, velocities = recording.increments[:used], recording.velocity_increments[:used]
    if BACKENDS[backend].target in FIXED:
        settings = settings or Settings()
        needed = two_speed.ranges(
            float(np.abs(angles).max()), float(np.abs(velocities).max()), fast_cycles, slow_cycles
        )
        settings = replace(settings, ranges={**needed, **settings.ranges})
    made = two_speed.TwoSpeed(algorithm, sculling, backend, settings)
    turns = np.tile(_vector("frame_rate", frame_rate), (cycles * slow_cycles + 1, 1))
    start = _vector("initial_angles", initial_angles)
    begin = backends.evaluator("dcm-from-euler-angles")(start)
    if algorithm != "dcm":
        begin = backends.evaluator(f"{algorithm}-from-dcm")(begin)
    run = made.run(
        angles,
        velocities,
        fast_cycles=fast_cycles,
        slow_cycles=slow_cycles,
        turns=turns * recording.interval * fast_cycles,
        initial=begin,
    )
    states = run.attitudes[slow_cycles - 1 :: slow_cycles]
    time = recording.start + recording.interval * of_cycle * np.arange(1.0, cycles + 1)
    matrices = np.asarray(states, np.float64)
    if algorithm != "dcm":
        matrices = backends.evaluator(f"dcm-from-{algorithm}")(matrices)
    changes = np.asarray(run.velocity_changes, np.float64)
    found = _euler_angles(matrices, start)
    return Course(time, states, found, changes, made.state.elements, unused)


def _vector(name: str, values: Iterable[float]) -> Array:
    numbers = [float(checks.number(name, value)) for value in values]
    if len(numbers) != 3:
        raise InputError(f"{name} has {len(numbers)} numbers; 3 are needed")
    return np.array(numbers)


def _euler_angles(matrices: Array, before: Array) -> Array:
    """Return the angles of matrices one after the other, so that roll stays what it was where pitch is vertical."""
    convert = backends.evaluator("euler-angles-from-dcm")
    found = []
    for matrix in matrices:
        before = convert(matrix, before)
        found.append(before)
    return np.array(found)
