"""An algorithm in two speeds along recorded gyro and accelerometer increments, as a result and drawn."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from strapgen.catalogue import AnyAlgorithm, state_name
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.notebook_display import Records, short_repr
from strapgen.lab.recordings.recording import InertialRecording
from strapgen.lab.runs import Array
from strapgen.lab.runs_report import ANGLES, AXES, TIME_COLUMN, RunSettings, settings_text, table_of, thinned
from strapgen.navigation.two_speed import two_speed_runner, two_speed_sources
from strapgen.results import figures
from strapgen.results.records import INTERNAL, entry
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.run import backends
from strapgen.run.backends import BACKENDS


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

    Examples
    --------
    >>> from strapgen import InertialRecording, course
    >>> rest = InertialRecording(0.0, 0.01, np.zeros((20, 3)), np.full((20, 3), 0.01))
    >>> course("euler", rest, fast_cycles=2).time.shape
    (10,)
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
    algorithm: AnyAlgorithm,
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
    algorithm : str, Choice or AttitudeAlgorithm
        "dcm" or "euler"; of an object its state counts alone, since the loops have a method of their own.
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
    algorithm = state_name("course", algorithm, two_speed_sources.ALGORITHMS)
    checks.choice("backend", backend, BACKENDS)
    fast_cycles = checks.count("fast_cycles", fast_cycles, largest=checks.MOST)
    slow_cycles = checks.count("slow_cycles", slow_cycles, largest=checks.MOST)
    of_cycle = fast_cycles * slow_cycles
    cycles, unused = divmod(len(recording.samples), of_cycle)
    if cycles < 1:
        raise InputError(
            f"the recording holds {len(recording.samples)} increments; a navigation cycle needs {of_cycle}"
        )
    used = cycles * of_cycle
    angles, velocities = recording.samples[:used], recording.velocity_increments[:used]
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


def course_table(course: Course) -> TextTable:
    """Return attitude and velocity along a recording as a table."""
    count = len(course.time)
    columns = (
        course.time,
        course.states.reshape(count, -1),
        np.degrees(course.angles),
        course.velocity_changes,
    )
    header = [
        "time_s",
        *course.elements,
        *(f"{name}_deg" for name in ANGLES),
        *(f"dv{axis}_m_s" for axis in AXES),
    ]
    return table_of(header, np.column_stack(columns).tolist())


@dataclass(frozen=True)
class CourseRecords:
    """Attitude and velocity along a recording."""

    #: Increments at the end that make no whole navigation cycle
    unused_increments: int
    #: Names of the elements of the attitude
    elements: tuple[str, ...]
    time_s: Array
    #: The elements at each time
    attitude: Array
    roll_deg: Array
    pitch_deg: Array
    heading_deg: Array
    #: Along x, y and z at each time
    velocity_changes_m_s: Array

    @staticmethod
    def of(course: Course) -> CourseRecords:
        """Return the records of a course."""
        roll, pitch, heading = np.degrees(course.angles).T
        return CourseRecords(
            unused_increments=course.unused,
            elements=course.elements,
            time_s=course.time,
            attitude=course.states.reshape(len(course.time), -1),
            roll_deg=roll,
            pitch_deg=pitch,
            heading_deg=heading,
            velocity_changes_m_s=course.velocity_changes,
        )


@dataclass(frozen=True)
class CourseResult(Result):
    """Attitude and velocity along an inertial recording."""

    drawn_by: ClassVar[str] = f"{__name__}:course_image"
    indented = False

    settings: Mapping[str, Any] = field(metadata=entry(spread=True, kind=RunSettings))
    course: Course = field(metadata=entry(spread=True, write=CourseRecords.of, kind=CourseRecords))
    plot_title: str = field(default="", metadata=INTERNAL)

    def rows(self) -> Any:
        """Return the records of the course, as their times."""
        return self.course.time

    def table(self) -> TextTable:
        """Return attitude and velocity at each time."""
        return course_table(self.course)

    def text(self) -> str:
        """Return angles and velocity changes at most of the times that a reader looks at."""
        course, shown = self.course, thinned(len(self.course.time))
        titles = [*(f"{name}, deg" for name in ANGLES), *(f"dv{axis}, m/s" for axis in AXES)]
        columns = [TIME_COLUMN, *(Column(title, spec=".8f", least=13, gap=1) for title in titles)]
        values = np.column_stack([course.time, np.degrees(course.angles), course.velocity_changes])
        table = TextTable(columns, values[shown].tolist())
        lines = [settings_text({**self.settings}), "", *table.lines()]
        if len(shown) < len(course.time):
            lines.append(f"({len(shown)} of {len(course.time)} cycles; --format csv prints all)")
        if course.unused:
            lines.append(
                f"{checks.counted(course.unused, 'increment')} at the end fill no navigation cycle and "
                f"{'is' if course.unused == 1 else 'are'} left out"
            )
        return "\n".join(lines)


def course_image(result: CourseResult, path: str | Path) -> bytes:
    """Return attitude and velocity changes along a recording against time."""
    return figures.image(course_figure(result.course, result.plot_title), path)


def course_figure(course: Course, title: str) -> Any:
    """Return the figure of `course_image`."""
    figure, grid = figures.grid_of_axes(2, 3, (12, 6))
    parts = (
        [f"{name}, deg" for name in ANGLES],
        [f"velocity change along {axis}, m/s" for axis in AXES],
    )
    values = (np.degrees(course.angles), course.velocity_changes)
    for row, names in enumerate(parts):
        for column, name in enumerate(names):
            axes = grid[row, column]
            axes.plot(course.time, values[row][:, column], color=figures.COLOURS[row], linewidth=1.2)
            axes.set_title(name, loc="left", fontsize=10)
            figures.style_over_time(axes)
            if row == 1:
                axes.set_xlabel("time, s")
    figure.suptitle(figures.printable(title), fontsize=12)
    return figure
