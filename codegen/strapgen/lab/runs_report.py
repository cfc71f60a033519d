"""Runs and recordings as results."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from strapgen.lab.recordings.attitude_output import (
    AttitudeForm,
    attitude_of,
    kitti,
    parquet,
    roll_pitch_heading,
    tum,
)
from strapgen.lab.recordings.quaternions import inverse, product, rotation_vectors
from strapgen.lab.recordings.recording import History
from strapgen.lab.recordings.true_attitude import AttitudeError
from strapgen.lab.runs import Array, Run
from strapgen.results import figures
from strapgen.results.records import INTERNAL, entry, properties
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.run.orders import SEQUENTIAL

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.ir.signals import Signal
    from strapgen.run.backends import Backend

AXES = ("x", "y", "z")
ANGLES = ("roll", "pitch", "heading")
#: The planes of skew about the axes x, y, z, as the thesis names them.
SKEW_PLANES = ("y-z", "z-x", "x-y")
_PLACES = [f"{row}{column}" for row in "123" for column in "123"]
_MOST_ROWS = 36
#: Digits of the numbers in Markdown.
_DIGITS = ".9g"
#: Parts of an error matrix, and the unit in the names of their columns.
_PARTS = (("scale", ""), ("skew", "_deg"), ("drift", "_deg"))
_MATRIX_TITLES = [
    Column(title, "<", least=38) for title in ("computed C", "true C", "computed - true", "error matrix E")
]
#: The states as they are.
_STATE = AttitudeForm()
TIME_COLUMN = Column("time, s", spec=".4f", least=10)


def _three(group: str, names: Sequence[str], spec: str) -> list[Column]:
    """Return three columns of numbers close together, under one title."""
    return [Column(name, spec=spec, least=12, gap=1 if k else 2, group=group) for k, name in enumerate(names)]


_ERROR_COLUMNS = (
    Column("s", spec=".3f", least=9, group="time"),
    *_three("scale", AXES, ".4e"),
    *_three("skew, deg", SKEW_PLANES, ".4e"),
    *_three("drift, deg", AXES, ".4e"),
)


_MATRIX_COLUMNS = [
    column for spec in (".9f", ".9f", ".4e", ".4e") for column in _three("", ("", "", ""), spec)
]


def step_facts(backend: Backend, choice: Choice) -> dict[str, Any]:
    """Return the facts on the step of a run."""
    facts: dict[str, Any] = {"algorithm": choice.name, "method": choice.method_name}
    facts |= {"rates_at": list(backend.nodes)} if backend.nodes else {"increments": backend.increments}
    if backend.previous:
        facts["previous"] = backend.previous
    if backend.ahead:
        facts["ahead"] = backend.ahead
    if backend.order != SEQUENTIAL:
        facts["order"] = backend.order
    return facts | {"backend": backend.name}


@dataclass(frozen=True)
class RunSettings:
    """The settings of a run, as far as they apply."""

    algorithm: str | None = field(metadata=entry(optional=True))
    method: str | None = field(metadata=entry(optional=True))
    #: Nodes in a step, 0 to 1, at which the algorithm takes rates
    rates_at: tuple[float, ...] | None = field(metadata=entry(optional=True))
    #: Increments that a step takes
    increments: int | None = field(metadata=entry(optional=True))
    #: Increments from before a step that it takes too
    previous: int | None = field(metadata=entry(optional=True))
    #: Increments from after a step that it takes too
    ahead: int | None = field(metadata=entry(optional=True))
    #: Order in which the steps were multiplied, where it is not one after the other
    order: str | None = field(metadata=entry(optional=True))
    #: Name or file of a described system
    system: str | None = field(metadata=entry(optional=True))
    backend: str | None = field(metadata=entry(optional=True))
    #: Samples of a described system in a second
    sample_hz: float | None = field(metadata=entry(optional=True))
    motion: str | None = field(metadata=entry(optional=True))
    #: File of the recording
    source: str | None = field(metadata=entry(optional=True))
    step_s: float | None = field(metadata=entry(optional=True))
    duration_s: float | None = field(metadata=entry(optional=True))
    #: Roll, pitch and heading at the start
    initial_deg: str | None = field(metadata=entry(optional=True, unit="deg"))
    specific_force_m_s2: tuple[float, ...] | None = field(metadata=entry(optional=True))
    #: File of the sensor errors
    errors: str | None = field(metadata=entry(optional=True))
    #: Rate that is taken off a recording, about x, y, z
    bias_deg_s: tuple[float, ...] | None = field(metadata=entry(optional=True))
    #: Standard deviation of that of a rest
    bias_uncertainty_deg_s: tuple[float, ...] | None = field(metadata=entry(optional=True))
    #: Latitude at which the Earth's rate is taken off
    latitude_deg: float | None = field(metadata=entry(optional=True))


@dataclass(frozen=True)
class RunErrors:
    """The errors of a run at its records."""

    time_s: Array
    #: On the axes x, y, z at each record
    scale: Array
    #: In the planes y-z, z-x, x-y at each record
    skew_deg: Array
    #: On the axes x, y, z at each record
    drift_deg: Array
    #: Root of the sum of the squares of the largest drifts on the axes
    mean_drift_deg: float

    @staticmethod
    def of(run: Run) -> RunErrors:
        """Return the errors of a run in degrees."""
        mean = math.degrees(run.mean_drift)
        return RunErrors(run.time, run.scale, np.degrees(run.skew), np.degrees(run.drift), mean)


@dataclass(frozen=True)
class RunMatrices:
    """The direction cosine matrices of a run at its records."""

    computed: Array
    true: Array
    #: Computed less true
    difference: Array
    #: Computed times transposed true, less the identity
    error: Array

    @staticmethod
    def of(run: Run) -> RunMatrices:
        """Return the matrices of a run."""
        return RunMatrices(run.computed, run.true, run.computed - run.true, run.error)


@dataclass(frozen=True)
class RunResult(Result):
    """The nine errors of a run on a motion at its records."""

    drawn_by: ClassVar[str] = "strapgen.lab.runs_report:run_image"
    indented = False

    settings: Mapping[str, Any] = field(metadata=entry(spread=True, kind=RunSettings))
    run: Run = field(metadata=entry(spread=True, write=RunErrors.of, kind=RunErrors))
    title: str | None = field(default=None, metadata=entry(optional=True))
    #: The run if its matrices are written too
    matrices: Run | None = field(
        default=None, metadata=entry(spread=True, optional=True, write=RunMatrices.of, kind=RunMatrices)
    )
    #: The motion with its parameters in words, for the text
    motion: str | None = field(default=None, metadata=INTERNAL)
    #: Records from one print of the matrices to the next in the text; by default those at the end are printed
    every: int | None = field(default=None, metadata=INTERNAL)
    #: Title of a plot where the user states none
    plot_title: str = field(default="", metadata=INTERNAL)

    def rows(self) -> Any:
        """Return the records of the run, as their times."""
        return self.run.time

    def table(self) -> TextTable:
        """Return the nine errors and all matrices at each record."""
        return run_table(self.run)

    def reader(self) -> TextTable:
        """Return the nine errors at each record."""
        return TextTable(_ERROR_COLUMNS, _error_rows(self.run, range(len(self.run.time))))

    def text(self) -> str:
        """Return the nine errors in time, the matrices at the end or every so often, the mean drift."""
        run, shown = self.run, thinned(len(self.run.time))
        lines = [] if self.title is None else [self.title, ""]
        stated = {} if self.motion is None else {"motion": self.motion}
        lines += [settings_text({**self.settings, **stated}), ""]
        lines += TextTable(_ERROR_COLUMNS, _error_rows(run, shown)).lines()
        if len(shown) < len(run.time):
            lines.append(
                f"({len(shown)} of {len(run.time)} records; --format csv prints all, --record S thins them)"
            )
        largest = ", ".join(
            f"{axis} {value:.6g}" for axis, value in zip(AXES, np.degrees(run.drift_by_axis), strict=True)
        )
        lines += [
            "",
            *(line for record in _printed_records(run, self.every) for line in _matrix_lines(run, record)),
        ]
        lines += [f"largest drift, deg: {largest}", f"mean drift, deg: {np.degrees(run.mean_drift):.6g}"]
        return "\n".join(lines)


def run_table(run: Run) -> TextTable:
    """Return a run as a table: the nine errors and all matrices at each record."""
    header = ["time_s"]
    header += [f"{kind}_{axis}{unit}" for kind, unit in _PARTS for axis in AXES]
    header += [
        f"{matrix}_{place}" for matrix in ("computed", "true", "difference", "error") for place in _PLACES
    ]
    flat = [m.reshape(-1, 9) for m in (run.computed, run.true, run.computed - run.true, run.error)]
    columns = [run.time[:, None], run.scale, np.degrees(run.skew), np.degrees(run.drift), *flat]
    return table_of(header, np.hstack(columns).tolist())


def largest_table(run: Run) -> TextTable:
    """Return the largest errors of a run by axis, for a reader."""
    parts = (("scale", AXES, run.scale), ("skew, deg", SKEW_PLANES, np.degrees(run.skew)))
    rows = [
        (f"{kind} {name}", float(np.abs(values[:, k]).max()), float(values[-1, k]))
        for kind, names, values in (*parts, ("drift, deg", AXES, np.degrees(run.drift)))
        for k, name in enumerate(names)
    ]
    columns = (Column("error", "<"), Column("largest", spec=".4g"), Column("at the end", spec=".4g"))
    return TextTable(columns, rows)


def history_elements(history: History) -> tuple[str, ...]:
    """Return the names of the elements of a history's states; numbers where it has no names."""
    return history.elements or tuple(
        f"state_{k}" for k in range(1, 1 + int(np.prod(history.states.shape[1:])))
    )


def _error_rows(run: Run, records: Iterable[int]) -> list[tuple[float, ...]]:
    """Return the time and the nine errors of some records."""
    parts = np.hstack([run.scale, np.degrees(run.skew), np.degrees(run.drift)])
    return [(run.time[k], *parts[k]) for k in records]


def _printed_records(run: Run, every: int | None) -> list[int]:
    """Return the records whose matrices are printed, the last one among them."""
    last = len(run.time) - 1
    return [last] if every is None else sorted({*range(0, len(run.time), every), last})


def _matrix_lines(run: Run, record: int) -> list[str]:
    """Return the matrices at a record of a run side by side, and an empty line."""
    computed, true = run.computed[record], run.true[record]
    rows = np.hstack([computed, true, computed - true, run.error[record]])
    table = TextTable(_MATRIX_TITLES, []).lines() + TextTable(_MATRIX_COLUMNS, rows.tolist()).lines()
    return [f"at {run.time[record]:g} s", *table, ""]


def history_columns(
    history: History, form: AttitudeForm = _STATE, error: AttitudeError | None = None
) -> dict[str, Array]:
    """Return the time and the attitude in a form by name, and the error beside the truth; nan where it is not known."""
    columns = {"time_s": history.time}
    if history.piece is not None:
        columns["piece"] = history.piece
    columns |= form.columns(history)
    if error is None:
        return columns
    vector = np.degrees(error.at(history.time))
    names = ("error_deg", *(f"error_{axis}_deg" for axis in AXES))
    return columns | dict(zip(names, [np.linalg.norm(vector, axis=1), *vector.T], strict=True))


def history_table(
    history: History, form: AttitudeForm = _STATE, error: AttitudeError | None = None
) -> TextTable:
    """Return an attitude history as a table; an error that is not known is an empty cell."""
    columns = history_columns(history, form, error)
    return table_of([*columns], _rows_of(columns))


def _rows_of(columns: dict[str, Any]) -> list[list[Any]]:
    """Return columns as rows, None for what is no number."""
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    return [[None if value != value else value for value in row] for row in rows]


def settings_text(settings: dict[str, Any]) -> str:
    """Return settings that have values as text."""
    stated = {key: value for key, value in settings.items() if value is not None}
    return ", ".join(
        f"{key} {' '.join(f'{x:g}' for x in value) if isinstance(value, list) else value}"
        for key, value in stated.items()
    )


@dataclass(frozen=True)
class AttitudeRecords:
    """The attitude along a recording."""

    step_s: float
    duration_s: float
    #: Increments at the end that make no whole step
    unused_increments: int
    #: Names of the elements of the attitude
    elements: tuple[str, ...]
    time_s: Array
    #: The elements at each time
    attitude: Array
    #: Number of the piece between gaps of the recording
    piece: Array | None = field(default=None, metadata=entry(optional=True))


@dataclass(frozen=True)
class ErrorRecords:
    """The error of the attitude beside a true one."""

    #: What the clock of the truth shows more
    time_offset_s: float
    #: Its standard deviation
    time_offset_uncertainty_s: float
    #: Of the magnitudes of the rates; null where the offset is stated
    correlation: float | None
    #: Which axes of the computed attitude are turned
    align: str
    #: Rotation vector of the turn of the reference axes
    reference_deg: Array
    #: Rotation vector of the turn of the body axes
    body_deg: Array
    #: Slope of the error angle
    angle_slope_deg_h: float
    #: Its standard deviation
    angle_slope_uncertainty_deg_h: float
    #: Slopes of the error about the reference axes
    slope_deg_h: Array
    #: Their standard deviations
    slope_uncertainty_deg_h: Array
    #: Instants of the errors, on the clock of the recording
    time_s: Array
    #: The error angle at each
    angle_deg: Array
    #: About the reference axes at each
    error_deg: Array

    @staticmethod
    def of(error: AttitudeError) -> ErrorRecords:
        """Return the records of an error."""
        offset, of_angle, by_axis = error.offset, error.angle_slope, error.slope
        return ErrorRecords(
            *(offset.seconds, offset.uncertainty_s, offset.correlation),
            error.align,
            np.degrees(rotation_vectors(error.reference)),
            np.degrees(rotation_vectors(error.body)),
            *(float(of_angle.deg_h), float(of_angle.uncertainty_deg_h)),
            *(by_axis.deg_h, by_axis.uncertainty_deg_h),
            error.time,
            np.degrees(error.angle),
            np.degrees(error.vector),
        )


@dataclass(frozen=True)
class HistoryResult(Result):
    """The attitude along a recording."""

    drawn_by: ClassVar[str] = "strapgen.lab.runs_report:history_image"
    indented = False
    computed = properties(records=entry(spread=True, kind=AttitudeRecords))

    settings: Mapping[str, Any] = field(metadata=entry(spread=True, kind=RunSettings))
    history: History = field(metadata=INTERNAL)
    title: str | None = field(default=None, metadata=entry(optional=True))
    #: Title of a plot where the user states none
    plot_title: str = field(default="", metadata=INTERNAL)
    form: AttitudeForm = field(default=_STATE, metadata=INTERNAL)
    #: Beside a true attitude
    error: AttitudeError | None = field(
        default=None, metadata=entry(optional=True, write=ErrorRecords.of, kind=ErrorRecords)
    )

    @property
    def records(self) -> AttitudeRecords:
        """The attitude at each time."""
        history, columns = self.history, self.form.columns(self.history)
        values, length = np.column_stack([*columns.values()]), float(history.time[-1] - history.time[0])
        return AttitudeRecords(
            history.step, length, history.unused, tuple(columns), history.time, values, history.piece
        )

    def rows(self) -> Any:
        """Return the records of the history, as their times."""
        return self.history.time

    def table(self) -> TextTable:
        """Return the attitude at each time."""
        return history_table(self.history, self.form, self.error)

    def written(self, format: str) -> str:
        """Return the attitude in a format of `Result`, or as a trajectory: "tum" or "kitti"."""
        trajectories = {"tum": tum, "kitti": kitti}
        return trajectories[format](self.history) if format in trajectories else super().written(format)

    def parquet(self) -> bytes:
        """Return the attitude at each time as a Parquet file."""
        return parquet(history_columns(self.history, self.form, self.error))

    def text(self) -> str:
        """Return the attitude at most of the times that a reader looks at, and the error beside the truth."""
        history, shown = self.history, thinned(len(self.history.time))
        columns = {
            name: values[shown] for name, values in history_columns(history, self.form, self.error).items()
        }
        heads = [TIME_COLUMN, *(Column(name, spec=".9f", least=12, gap=1) for name in [*columns][1:])]
        title = {} if self.title is None else {"title": self.title}
        lines = [settings_text(title | {**self.settings}), "", *TextTable(heads, _rows_of(columns)).lines()]
        if len(shown) < len(history.time):
            lines.append(f"({len(shown)} of {len(history.time)} records; --format csv prints all)")
        if history.unused:
            lines.append(f"{history.unused} increments at the end make no whole step and were not used")
        return "\n".join([*lines, *(self.error.lines() if self.error else ())])


def places(signal: Signal) -> list[str]:
    """Return short names of the elements of a signal."""
    if signal.shape == (3, 3):
        return list(_PLACES)
    return [element.rpartition("_")[2] for element in signal.elements]


def thinned(count: int) -> list[int]:
    """Return at most so many record numbers, evenly spread, with the first and the last."""
    if count <= _MOST_ROWS + 1:
        return list(range(count))
    return sorted({round(k * (count - 1) / _MOST_ROWS) for k in range(_MOST_ROWS + 1)})


def table_of(names: Iterable[str], rows: Sequence[Sequence[float]]) -> TextTable:
    """Return rows of numbers under names as a table."""
    return TextTable([Column(name, spec=_DIGITS) for name in names], rows)


def run_figure(run: Run, title: str) -> Any:
    """Return the figure of `run_image`."""
    figure, grid = figures.grid_of_axes(3, 3, (12, 8))
    parts = (
        ("scale", "", run.scale, AXES),
        ("skew", ", deg", np.degrees(run.skew), SKEW_PLANES),
        ("drift", ", deg", np.degrees(run.drift), AXES),
    )
    for row, (kind, unit, values, names) in enumerate(parts):
        for column, name in enumerate(names):
            axes = grid[row, column]
            axes.plot(run.time, values[:, column], color=figures.COLOURS[row], linewidth=1.4)
            axes.set_title(f"{name} {kind}{unit}", loc="left", fontsize=10)
            figures.style_over_time(axes)
            if row == 2:
                axes.set_xlabel("time, s")
    figure.suptitle(figures.printable(title), fontsize=12)
    return figure


def run_image(result: RunResult, path: str | Path) -> bytes:
    """Return the nine errors of a run against time: scale, skew and drift, three axes each."""
    return figures.image(run_figure(result.run, result.title or result.plot_title), path)


def history_image(result: HistoryResult, path: str | Path) -> bytes:
    """Return roll, pitch, heading, length and rate against time, and the error beside a true attitude."""
    return figures.image(
        history_figure(result.history, result.title or result.plot_title, result.error), path
    )


def history_figure(history: History, title: str, error: AttitudeError | None = None) -> Any:
    """Return the figure of `history_image`."""
    if history.backend is None:
        return _elements_figure(history, title)
    q = attitude_of(history)
    length = np.linalg.norm(history.states.reshape(len(q), -1), axis=1) / np.linalg.norm(
        history.backend.identity
    )
    turns = rotation_vectors(product(inverse(q[:-1]), q[1:]))
    rate = np.linalg.norm(turns, axis=1) / np.diff(history.time)
    angles = [*zip((f"{name}, deg" for name in ANGLES), np.degrees(roll_pitch_heading(q)).T, strict=True)]
    panels = [
        *((name, history.time, _broken(values)) for name, values in angles),
        ("length of the state less 1", history.time, length - 1),
        ("magnitude of the rate, deg/s", (history.time[:-1] + history.time[1:]) / 2, np.degrees(rate)),
    ]
    figure, grid = figures.grid_of_axes(
        len(panels) + (error is not None), 1, (10, 9 + 1.8 * (error is not None))
    )
    for axes, (name, time, values) in zip(grid.flat, panels, strict=False):
        axes.plot(time, values, color=figures.COLOURS[0], linewidth=1.2)
        axes.set_title(name, loc="left", fontsize=10)
        figures.style_over_time(axes)
    for axes in grid[:3, 0]:
        axes.ticklabel_format(axis="y", style="plain")
    if error is not None:
        _draw_error(grid[-1, 0], error)
    grid[-1, 0].set_xlabel("time, s")
    figure.suptitle(figures.printable(title), fontsize=12)
    return figure


def _broken(angles: Array) -> Array:
    """Return angles in deg with a gap where they wrap."""
    values = angles.copy()
    values[1:][np.abs(np.diff(angles)) > 180] = np.nan
    return values


def error_figure(error: AttitudeError, title: str) -> Any:
    """Return the figure of the error of an attitude beside a true one."""
    figure, grid = figures.grid_of_axes(1, 1, (10, 3.6))
    _draw_error(grid[0, 0], error)
    grid[0, 0].set_xlabel("time, s")
    figure.suptitle(figures.printable(title), fontsize=12)
    return figure


def _draw_error(axes: Any, error: AttitudeError) -> None:
    """Draw the error about each reference axis, and its angle, over time."""
    for axis, values, colour in zip(AXES, np.degrees(error.vector).T, figures.COLOURS, strict=True):
        axes.plot(error.time, values, color=colour, linewidth=1, label=f"about {axis}")
    axes.plot(error.time, np.degrees(error.angle), color="0.4", linewidth=1.2, label="angle")
    axes.set_title("error beside the true attitude, deg, reference axes", loc="left", fontsize=10)
    figures.style_over_time(axes)
    axes.legend(frameon=False, fontsize=9, ncols=4)


def _elements_figure(history: History, title: str) -> Any:
    """Return the elements of states that are no known attitudes, against time."""
    states, elements = history.states.reshape(len(history.time), -1), history_elements(history)
    columns = 3 if len(elements) == 9 else 1
    rows = -(-len(elements) // columns)
    figure, grid = figures.grid_of_axes(rows, columns, (10, 1.9 * rows + 0.6), sharey=True)
    for axes, name, values in zip(grid.flat, elements, states.T, strict=True):
        axes.plot(history.time, values, color=figures.COLOURS[0], linewidth=1.2)
        axes.set_title(name, loc="left", fontsize=10)
        figures.style_over_time(axes)
        axes.ticklabel_format(axis="y", style="plain")
        axes.set_ylim(-1.05, 1.05)
    for axes in grid[-1]:
        axes.set_xlabel("time, s")
    figure.suptitle(figures.printable(title), fontsize=12)
    return figure
