"""`course` runs an algorithm in two speeds along recorded gyro and accelerometer increments, cycle by cycle."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.notebook_display import Records, short_repr
from strapgen.lab.recordings.recording import InertialRecording
from strapgen.navigation.two_speed import two_speed_runner, two_speed_sources
from strapgen.run import backends
from strapgen.run.backends import BACKENDS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Course(Records):
    """Attitude and velocity along a recording, after each navigation cycle.

    Parameters
    ----------
    time : array, (N,)
        Ends of the navigation cycles in s, on the clock of the recording.
    states : array, (N, state shape)
        Attitude at these times, body to navigation axes.
    angles : array, (N, 3)
        The attitude as roll, pitch, heading in rad.
    velocity_changes : array, (N, 3)
        Integral of the specific force over each cycle in m/s, in the rotating navigation axes.
    elements : tuple of str
        Names of the elements of a state.
    unused : int
        Number of increments at the end that do not fill a navigation cycle.
    """

    time: Array
    states: NDArray[Any]
    angles: Array
    velocity_changes: Array
    elements: tuple[str, ...]
    unused: int

    __repr__ = short_repr

    def _in_words(self) -> str:
        times = f"{self.time[0]:g} s to {self.time[-1]:g} s" if len(self.time) else "none"
        return f"of {len(self.time)} navigation cycles, {times}; {self.unused} increments unused"


@dataclass(frozen=True)
class NavigationFrame:
    """The navigation frame of a run: the attitude of the body in it at the start, and its rate."""

    #: Roll, pitch, heading at the start in rad
    initial_angles: Iterable[float] = (0.0, 0.0, 0.0)
    #: Rate of the navigation frame in rad/s, navigation axes
    frame_rate: Iterable[float] = (0.0, 0.0, 0.0)


#: A frame that does not rotate, with which the body is aligned at the start.
RESTING = NavigationFrame()


@np.errstate(all="ignore")  # numbers that overflow are refused, in one line
def course(
    algorithm: str,
    recording: InertialRecording,
    *,
    fast_cycles: int,
    slow_cycles: int = 1,
    sculling: int = 2,
    backend: str = "numpy",
    settings: Settings | None = None,
    frame: NavigationFrame = RESTING,
) -> Course:
    """Run an algorithm in two speeds along a recording.

    For the first fast cycle the previous increment is zero, as at a start from rest.

    Parameters
    ----------
    algorithm : str
        "dcm" or "euler".
    recording : InertialRecording
        One increment for each fast cycle.
    fast_cycles, slow_cycles : int
        Number of fast cycles in a slow cycle, and of slow cycles in a navigation cycle.
    sculling : int, optional
        Form of the sculling integral, 1 or 2, as for `TwoSpeed`.
    backend : str, optional
        A key of `strapgen.run.backends.BACKENDS`.
    settings : Settings, optional
        Settings of fixed point; ranges that they do not state are derived from the recording.
    frame : NavigationFrame, optional
        Attitude at the start and rate of the frame; by default both are zero.

    Returns
    -------
    Course

    Raises
    ------
    InputError
        If a name or a number is not allowed, the recording is shorter than a navigation cycle, or a result is beyond
        the range of the back end.

    Examples
    --------
    The body is level and turns about the vertical; its specific force is the reaction to gravity:

    >>> level = InertialRecording(0.0, 0.01, np.tile([0, 0, 1e-3], (40, 1)), np.tile([0, 0, 0.0981], (40, 1)))
    >>> along = course("dcm", level, fast_cycles=4, slow_cycles=5)
    >>> along.time, along.angles[:, 2].round(6)
    (array([0.2, 0.4]), array([0.02, 0.04]))
    >>> along.velocity_changes[-1].round(6)
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
    if BACKENDS[backend].fixed:
        settings = settings or Settings()
        needed = two_speed_sources.ranges(
            float(np.abs(angles).max()), float(np.abs(velocities).max()), fast_cycles, slow_cycles
        )
        settings = replace(settings, ranges={**needed, **settings.ranges})
    runner = two_speed_runner.TwoSpeed(algorithm, sculling, backend, settings)
    turns = np.tile(_vector("frame_rate", frame.frame_rate), (cycles * slow_cycles + 1, 1))
    start = _vector("initial_angles", frame.initial_angles)
    begin = backends.evaluator("dcm-from-euler-angles")(start)
    if algorithm != "dcm":
        begin = backends.evaluator(f"{algorithm}-from-dcm")(begin)
    run = runner.run(
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
    return Course(time, states, _euler_angles(matrices, start), changes, runner.state.elements, unused)


def _vector(name: str, values: Iterable[float]) -> Array:
    numbers = [float(checks.number(name, value)) for value in values]
    if len(numbers) != 3:
        raise InputError(f"{name} has {len(numbers)} numbers; 3 are needed")
    return np.array(numbers)


def _euler_angles(matrices: Array, before: Array) -> Array:
    """Return the angles of matrices one after the other, so that roll does not change where pitch is vertical."""
    convert = backends.evaluator("euler-angles-from-dcm")
    angles = []
    for matrix in matrices:
        before = convert(matrix, before)
        angles.append(before)
    return np.array(angles)
