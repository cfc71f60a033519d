"""A described system on a motion over the earth: its start, its run, and its errors of attitude, velocity, position."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motions import Motion
from strapgen.lab.runs_report import TIME_COLUMN, RunSettings, settings_text, table_of, thinned
from strapgen.lab.sensor_errors.measured_motions import MeasuredMotion, both_increments
from strapgen.lab.sensor_errors.sensors import MeasurementUnit, steady
from strapgen.navigation.frame.frame_rates import HEIGHT, POSITION, VELOCITY
from strapgen.navigation.systems.system import Cell, DescribedSystem
from strapgen.navigation.systems.system_runner import SystemMemory, SystemRunner
from strapgen.navigation.systems.system_runs import attitude_state, cycles_of, matrices, samples
from strapgen.navigation.vehicle.vehicle_motion import VehicleMotion
from strapgen.results import figures
from strapgen.results.records import INTERNAL, entry
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.run.backends import evaluator

Array = NDArray[np.float64]


def over_earth(motion: Motion) -> VehicleMotion | None:
    """Return the true motion over the earth of a motion; None for one in a frame that rests."""
    true = motion.true if isinstance(motion, MeasuredMotion) else motion
    return true if isinstance(true, VehicleMotion) else None


@dataclass(frozen=True)
class NavigationCells:
    """The cells of a system with attitude, velocity, position and height of the vehicle."""

    attitude: tuple[Cell, ...]
    velocity: tuple[Cell, ...]
    position: tuple[Cell, ...]
    height: tuple[Cell, ...]

    @classmethod
    def of(cls, system: DescribedSystem) -> NavigationCells:
        """Return the cells of a navigator, outputs first; refuse a system without one of the first three outputs."""
        cells = sorted(system.cells, key=lambda cell: cell.name not in system.outputs)

        def named(like: Any) -> tuple[Cell, ...]:
            return tuple(
                cell
                for cell in cells
                if (cell.signal.name, cell.signal.frame, cell.signal.unit)
                == (like.name, like.frame, like.unit)
            )

        attitude = tuple(
            cell
            for cell in cells
            if cell.signal.constraint and cell.signal.frame == "b to n" and cell.signal.size in (4, 9)
        )
        found = cls(attitude, named(VELOCITY), named(POSITION), named(HEIGHT))
        for name, some in (
            ("attitude (frame b to n)", found.attitude),
            ("velocity (m/s, frame n)", found.velocity),
            ("position (frame n to e)", found.position),
        ):
            if not some or some[0].name not in system.outputs:
                raise InputError(
                    f"system {system.name} has no {name} among its outputs ({', '.join(system.outputs)}); a motion "
                    "over the earth needs attitude, velocity and position"
                )
        return found


def begun(
    runner: SystemRunner, motion: VehicleMotion, aligned_by: MeasuredMotion | None = None
) -> SystemMemory:
    """Return the memory of a system that begins on a motion: the truth, and all that follows from it.

    `aligned_by`: the motion as the sensors measure it with which the system has found the vertical; its heading is
    true.
    """
    memory, cells = runner.begin(), NavigationCells.of(runner.system)
    attitude = motion.navigation_attitude(0.0)
    if aligned_by is not None:
        attitude = aligned(motion, attitude, aligned_by, 1 / runner.system.sample_hz)
    for cell in cells.attitude:
        runner.set(memory, cell.name, attitude_state(cell.signal, attitude))
    stated = [(cells.velocity, motion.velocity(0.0)), (cells.position, motion.position(0.0))]
    for some, value in [*stated, (cells.height, motion.height(0.0))]:
        for cell in some:
            runner.set(memory, cell.name, value)
    true = {c.name for some in (cells.attitude, cells.velocity, cells.position, cells.height) for c in some}
    runner.settle(memory, true)
    return memory


def aligned(motion: VehicleMotion, attitude: Array, measured: MeasuredMotion, interval: Fraction) -> Array:
    """Return an attitude in whose axes the specific force that sensors measure first is the true one."""
    drawn = MeasurementUnit(measured.errors, float(interval), measured.run).errors
    angle, velocity = motion.both_samples(interval, 0, 1)
    _, sensed = MeasurementUnit(steady(drawn), float(interval))(angle, velocity)
    there, here = (attitude @ one[0] / np.linalg.norm(one[0]) for one in (sensed, velocity))
    return np.asarray(_shortest(there[None], here[None])[0] @ attitude)


@dataclass(frozen=True)
class Flight:
    """Errors of a navigator on a motion over the earth, after each cycle of its slowest output.

    The attitude error is that against the computed level: the attitude is moved along the shortest arc from the
    computed to the true place before it is compared, so that neither a pole nor a wander angle enters.
    """

    #: (N,): in s
    time: Array
    #: (N, 3): rotation vector from the true to the computed attitude, axes east, north, up, in rad
    attitude_error: Array
    #: (N, 3): computed less true, axes east, north, up, in m/s and m
    velocity_error: Array
    position_error: Array
    #: (N, 3): true latitude and longitude in rad, height in m
    track: Array

    @property
    def sizes(self) -> tuple[Array, Array, Array]:
        """The lengths of the errors of attitude in rad, velocity in m/s and position in m, (N,) each."""
        attitude, velocity, position = (
            np.linalg.norm(part, axis=1)
            for part in (self.attitude_error, self.velocity_error, self.position_error)
        )
        return attitude, velocity, position

    def less(self, other: Flight) -> Flight:
        """Return the differences of the errors from those of another run on the same motion."""
        return replace(
            self,
            attitude_error=self.attitude_error - other.attitude_error,
            velocity_error=self.velocity_error - other.velocity_error,
            position_error=self.position_error - other.position_error,
        )


def fly(
    runner: SystemRunner,
    motion: Motion,
    duration: Fraction,
    record: Fraction | None = None,
    align: bool = False,
) -> Flight:
    """Run a system on a motion over the earth.

    `motion`: a `VehicleMotion`, or one as sensors with errors measure it. `record`: time between records in s, a
    multiple of the cycle of the slowest output, by default that cycle. `align`: whether the system begins with the
    vertical that its sensors measure, in place of the true one.
    """
    true = over_earth(motion)
    assert true is not None, "the caller has asked"
    system, cells = runner.system, NavigationCells.of(runner.system)
    cycles, interval = cycles_of(system, duration), 1 / system.sample_hz
    kinds = [cells.attitude[0], cells.velocity[0], cells.position[0]]
    kinds += [cell for cell in cells.height[:1] if cell.name in system.outputs]
    every = max(system.every(cell.name) for cell in kinds)
    thinning = every * (
        1 if record is None else checks.multiple("record", record, "cycle of the outputs", every * interval)
    )
    memory = begun(runner, true, motion if align and isinstance(motion, MeasuredMotion) else None)
    angle, velocity = both_increments(motion, None, (0.0, 0.0, 0.0), interval, cycles)
    records: dict[str, list[Array]] = {cell.name: [] for cell in kinds}
    seen = dict.fromkeys(records, 0)
    for run in runner.blocks(samples(runner.fit.description, angle, velocity), memory):
        for name, parts in records.items():
            values, share = run.values[name], thinning // system.every(name)
            parts.append(values[(share - 1 - seen[name]) % share :: share])
            seen[name] += len(values)
    computed = [np.concatenate(parts) for parts in records.values()]
    attitudes = matrices(cells.attitude[0].signal, computed[0])
    if not all(np.isfinite(part).all() for part in computed):
        raise InputError(f"an output of system {system.name} is not finite; the increments are too large")
    time = np.arange(1.0, len(attitudes) + 1) * float(thinning * interval)
    height = computed[3].reshape(-1) if len(kinds) > 3 else true.height(time)
    return _errors(true, time, attitudes, computed[1], computed[2].reshape(-1, 3, 3), height)


def _errors(
    motion: VehicleMotion, time: Array, attitude: Array, velocity: Array, position: Array, height: Array
) -> Flight:
    """Return the errors of what a system computed at some times."""
    true, level = motion.position(time), motion.height(time)
    angles = np.asarray(evaluator("geographic-angles")(true, np.zeros((len(time), 3))))
    axes, up = local_axes(true), true[:, :, 2]
    there = position[:, :, 2] / np.linalg.norm(position[:, :, 2], axis=-1, keepdims=True)
    moved = _shortest(there, up) @ position
    turned = moved @ attitude @ np.swapaxes(true @ motion.navigation_attitude(time), 1, 2)
    skew = (turned - np.swapaxes(turned, 1, 2)) / 2
    vector = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=-1)
    sine = np.linalg.norm(vector, axis=-1)
    cosine = (np.trace(turned, axis1=1, axis2=2) - 1) / 2
    angle = np.arctan2(sine, cosine)
    vector *= np.divide(angle, sine, out=np.ones_like(angle), where=sine > 0)[:, None]
    fast = np.einsum("kij,kj->ki", moved, velocity) - np.einsum("kij,kj->ki", true, motion.velocity(time))
    far = motion.cartesian(there, height) - motion.cartesian(up, level)

    def local(vectors: Array) -> Array:
        return np.asarray(np.einsum("kij,kj->ki", axes, vectors))

    track = np.column_stack([angles[:, :2], level])
    return Flight(time, local(vector), local(fast), local(far), track)


def local_axes(position: Array) -> Array:
    """Return the axes east, north and up in axes e of positions C_n^e, as rows, (N, 3, 3)."""
    angles = np.asarray(evaluator("geographic-angles")(position, np.zeros((len(position), 3))))
    sine, cosine = np.sin(angles[:, 1]), np.cos(angles[:, 1])
    east, up = np.stack([-sine, cosine, 0 * sine], axis=-1), position[:, :, 2]
    return np.stack([east, np.cross(up, east), up], axis=1)


def _shortest(there: Array, here: Array) -> Array:
    """Return the rotations along the shortest arc from unit vectors to others, (N, 3, 3)."""
    axis, cosine = np.cross(there, here), np.einsum("ki,ki->k", there, here)
    skew = np.cross(axis[:, None, :], np.eye(3)).swapaxes(1, 2)
    return np.asarray(np.eye(3) + skew + skew @ skew / (1 + cosine)[:, None, None])


@dataclass(frozen=True)
class FlightErrors:
    """Errors of attitude, velocity and position in axes east, north, up, and the true track."""

    time_s: Array
    attitude_error_deg: Array
    velocity_error_m_s: Array
    position_error_m: Array
    #: Latitude and longitude in deg, height in m
    track: Array

    @staticmethod
    def of(flight: Flight) -> FlightErrors:
        """Return the records of a flight."""
        track = np.column_stack([np.degrees(flight.track[:, :2]), flight.track[:, 2]])
        return FlightErrors(
            flight.time,
            np.degrees(flight.attitude_error),
            flight.velocity_error,
            flight.position_error,
            track,
        )


_PARTS = (
    ("attitude", "deg", "attitude_error_deg"),
    ("velocity", "m/s", "velocity_error_m_s"),
    ("position", "m", "position_error_m"),
)
_AXES = ("east", "north", "up")
#: Least error that a logarithmic axis shows, and most points of a curve.
_LEAST, _POINTS = 1e-15, 600


@dataclass(frozen=True)
class FlightResult(Result):
    """Errors of a described system along a motion over the earth."""

    drawn_by: ClassVar[str] = f"{__name__}:flight_image"
    indented = False

    settings: Mapping[str, Any] = field(metadata=entry(spread=True, kind=RunSettings))
    flight: Flight = field(metadata=entry(spread=True, write=FlightErrors.of, kind=FlightErrors))
    title: str | None = field(default=None, metadata=entry(optional=True))
    #: Title of a plot where the user states none
    plot_title: str = field(default="", metadata=INTERNAL)

    def rows(self) -> Any:
        """Return the records, as their times."""
        return self.flight.time

    def table(self) -> TextTable:
        """Return all errors and the track at each record."""
        errors = FlightErrors.of(self.flight)
        names = [
            f"{part}_error_{axis}_{unit.replace('/', '_')}" for part, unit, _ in _PARTS for axis in _AXES
        ]
        columns = [errors.time_s, *(getattr(errors, key) for *_, key in _PARTS), errors.track]
        header = ["time_s", *names, "latitude_deg", "longitude_deg", "height_m"]
        return table_of(header, np.column_stack(columns).tolist())

    def text(self) -> str:
        """Return the errors at most of the times that a reader looks at, and the largest."""
        errors, shown = FlightErrors.of(self.flight), thinned(len(self.flight.time))
        columns = [TIME_COLUMN]
        for part, unit, _ in _PARTS:
            group = f"{part} error, {unit}"
            columns += [Column(axis, spec=".4g", least=10, gap=1, group=group) for axis in _AXES]
        columns += [
            Column("latitude, deg", spec=".5f", least=10),
            Column("longitude, deg", spec=".5f", least=10),
            Column("height, m", spec=".1f", least=9),
        ]
        parts = [errors.time_s, *(getattr(errors, key) for *_, key in _PARTS), errors.track]
        values = np.column_stack(parts)
        lines = [] if self.title is None else [self.title, ""]
        lines += [settings_text({**self.settings}), "", *TextTable(columns, values[shown].tolist()).lines()]
        if len(shown) < len(values):
            lines.append(
                f"({len(shown)} of {len(values)} records; --format csv prints all, --record S thins them)"
            )
        largest = (
            f"{part} {np.linalg.norm(getattr(errors, key), axis=1).max():.4g} {unit}"
            for part, unit, key in _PARTS
        )
        return "\n".join([*lines, "", f"largest errors: {', '.join(largest)}"])


def flight_image(result: FlightResult, path: str | Path) -> bytes:
    """Return the errors against time beside the map of the track."""
    return figures.image(flight_figure({"": result.flight}, result.title or result.plot_title), path)


def flight_figure(flights: Mapping[str, Flight], title: str) -> Any:
    """Return the lengths of the errors of flights on one track against time, beside the map of the track."""
    figure = figures.pyplot().figure(figsize=(11, 6.5), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(3, 2))
    colours = figures.several_colours(len(flights))
    for row, (part, unit, _) in enumerate(_PARTS):
        axes, largest = figure.add_subplot(grid[row, 0]), []
        for (name, flight), colour in zip(flights.items(), colours, strict=True):
            sizes = np.degrees(flight.sizes[0]) if row == 0 else flight.sizes[row]
            time, sizes = _peaks(flight.time, sizes)
            axes.semilogy(time, np.maximum(sizes, _LEAST), color=colour, linewidth=1.2, label=name)
            largest.append(max(float(sizes.max()), _LEAST))
        axes.set_title(f"{part} error, {unit}", loc="left", fontsize=10)
        axes.set_ylim(min(largest) / 100, 3 * max(largest))
        figures.style(axes)
        if row == 2:
            axes.set_xlabel("time, s")
    if len(flights) > 1:
        handles = figure.axes[0].get_legend_handles_labels()
        figure.legend(*handles, fontsize=9, frameon=False, ncols=3, loc="outside lower left")
    chart = figure.add_subplot(grid[:, 1])
    track = next(iter(flights.values())).track
    _draw_track(chart, track)
    figures.title(figure, title)
    return figure


def _peaks(time: Array, sizes: Array) -> tuple[Array, Array]:
    """Return the largest sizes of as many neighbours as leave `_POINTS`, each at the end of its part."""
    share = -(-len(time) // _POINTS)
    starts = np.arange(0, len(time), share)
    return time[np.minimum(starts + share, len(time)) - 1], np.maximum.reduceat(sizes, starts)


def _draw_track(axes: Any, track: Array) -> None:
    """Draw a track in a plane: km to the east and north of its start, in the azimuthal projection about it."""
    latitude, longitude = track[:, 0], track[:, 1]
    s, c = np.sin(latitude[0]), np.cos(latitude[0])
    x = np.cos(latitude) * np.sin(longitude - longitude[0])
    y = c * np.sin(latitude) - s * np.cos(latitude) * np.cos(longitude - longitude[0])
    far = s * np.sin(latitude) + c * np.cos(latitude) * np.cos(longitude - longitude[0])
    angle = np.arctan2(np.hypot(x, y), far)
    scale = 6371.0 * np.divide(angle, np.hypot(x, y), out=np.ones_like(angle), where=np.hypot(x, y) > 0)
    every = slice(None, None, -(-len(track) // _POINTS))
    axes.plot((x * scale)[every], (y * scale)[every], color=figures.COLOURS[0], linewidth=1.5)
    axes.plot(0, 0, "o", color=figures.COLOURS[1], markersize=6)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title("track from its start (dot), km east and north", loc="left", fontsize=10)
    figures.style(axes)
