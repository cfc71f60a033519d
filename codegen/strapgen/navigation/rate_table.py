"""The rate-table test of 1984: 70 deg/s about all three axes, through 90 deg of pitch, as a result and drawn."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from strapgen import catalogue
from strapgen.catalogue import Choice
from strapgen.catalogue.methods.windows import named_window
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.lab.runs import attitude, drift_between
from strapgen.navigation.two_speed import two_speed_runner, two_speed_sources
from strapgen.results import figures
from strapgen.results.result import Result
from strapgen.results.table import ERROR, Column, TextTable
from strapgen.run.backend_names import DEFAULT_BACKENDS as DEFAULT_BACKENDS
from strapgen.run.backends import BACKENDS, evaluator
from strapgen.run.backends import backend as attitude_backend
from strapgen.run.increments import pulses, windows

Array = NDArray[np.float64]

#: Rate on each axis in deg/s (AGARD Lecture Series 133, the largest specified rate of that time).
RATE_DEG_S = 70.0
#: Rate in rad/s of the swing's phase: the angle on each axis swings by 140 deg, enough to pass 90 deg of pitch.
SWING_RAD_S = 0.5
MOTIONS = ("linear", "oscillating")
#: Methods of the attitude steps, and the increments of each step.
METHODS = (("rk1", 2), ("rk2", 2), ("rk3", 2), ("rk4", 2), ("magnus4", 2), ("coning-combined", 4))
#: The name under which the algorithms in two speeds run beside the attitude steps.
TWO_SPEED = "two-speed"
ALGORITHMS = (*catalogue.ALGORITHMS, TWO_SPEED)
#: Fast cycles in a slow one.
_FAST_CYCLES = 4
_TWO_SPEEDS = tuple((name, _FAST_CYCLES) for name in two_speed_sources.ALGORITHMS)


@dataclass(frozen=True)
class Row:
    """The drift of one algorithm on one back end."""

    motion: str
    algorithm: str
    backend: str
    #: Largest angle between computed and true attitude over the run, in degrees; None where the run left the
    #: range of the back end's numbers
    drift_deg: float | None
    #: Largest pitch of the computed attitude, in degrees
    pitch_deg: float | None


def angles(motion: str, times: Array) -> Array:
    """Return the rotation vector of the table at times in s; its axis is (1, 1, 1).

    `times` has shape (N,). Returns (N, 3): in rad.

    >>> angles("linear", np.array([1.0])).round(4)
    array([[1.2217, 1.2217, 1.2217]])
    """
    rate = math.radians(RATE_DEG_S)
    turned: Array = rate * times if motion == "linear" else rate / SWING_RAD_S * np.sin(SWING_RAD_S * times)
    return np.repeat(turned[:, None], 3, axis=1)


def stress(
    duration: float | str | Fraction = 3600,
    sample: float | str | Fraction = "0.01",
    record: float | str | Fraction = 1,
    backends: Sequence[str] = DEFAULT_BACKENDS,
    algorithms: Sequence[str] = ALGORITHMS,
    settings: Settings | None = None,
    methods: Sequence[str] | None = None,
) -> Iterator[Row]:
    """Run the test on every algorithm and back end.

    `duration, sample, record`: duration, time between gyro samples, and time from record to record, in s. The
    record is a multiple of the sample, and the duration of the record. A step or a slow cycle takes as many
    samples as its method needs. Attitude steps are orthonormalized at every record; the exact update of the
    algorithms in two speeds needs no orthonormalization. In fixed point the gyro counts pulses of one unit of
    the increments.

    >>> rows = list(stress(10, "0.01", 1, ["numpy"], ["euler"]))
    >>> [row.algorithm for row in rows if row.motion == "linear"][3:5]
    ['euler-rk4-2', 'euler-magnus4-2']
    >>> rows[3].drift_deg < 1e-5 < rows[0].drift_deg
    True
    """
    chosen = list(cases(algorithms, backends, methods))
    total = checks.number("duration", duration, positive=True)
    width = checks.number("sample", sample, positive=True)
    interval = checks.number("record", record, positive=True)
    count = checks.multiple("duration", total, "sample", width)
    every = checks.multiple("record", interval, "sample", width)
    checks.multiple("duration", total, "record", interval)
    for step in {case[3] for case in chosen} | {_FAST_CYCLES}:
        if every % step:
            raise InputError(
                f"record is {every} samples; a multiple of {step}, which a step takes, is needed"
            )
    for motion in MOTIONS:
        # A step may take samples from before the run and from after it.
        instants = np.arange(-catalogue.MOST_BESIDE, count + catalogue.MOST_BESIDE + 1, dtype=np.float64)
        turned = angles(motion, instants * float(width))
        samples = np.diff(turned, axis=0)
        truth = evaluator("dcm-update")
        recorded = turned[catalogue.MOST_BESIDE :][: count + 1 : every]
        true = truth(np.broadcast_to(np.eye(3), (count // every + 1, 3, 3)), recorded)
        for case in chosen:
            if case[0] == motion:
                yield _row(case, samples, every, true, settings)


#: Motion, algorithm, method, samples of a step and back end.
Case = tuple[str, str, str, int, str]


def cases(
    algorithms: Sequence[str], backends: Sequence[str], methods: Sequence[str] | None = None
) -> Iterator[Case]:
    """Yield the cases of the test."""
    for name in backends:
        checks.choice("backend", name, BACKENDS)
    for name in algorithms:
        checks.choice("algorithm", name, ALGORITHMS)
    steps = METHODS if methods is None else [(name, _samples(name)) for name in methods]
    for motion in MOTIONS:
        for algorithm in algorithms:
            for method, count in _TWO_SPEEDS if algorithm == TWO_SPEED else steps:
                for backend in backends:
                    yield motion, algorithm, method, count, backend


def _samples(method: str) -> int:
    """Return the samples of a step by a method."""
    if named_window(method) is None:
        checks.choice("method", method, catalogue.METHODS)
    return dict(METHODS).get(method) or catalogue.enough(method)


def _row(case: Case, samples: Array, every: int, true: Array, settings: Settings | None) -> Row:
    motion, algorithm, method, count, backend = case
    largest = float(np.abs(samples).max())
    settings = (settings or Settings()).fitted(largest) if BACKENDS[backend].fixed else None
    if algorithm == TWO_SPEED:
        name, run = f"{method} {TWO_SPEED}", _in_two_speeds(method, backend, settings, samples, every)
    else:
        choice = catalogue.choose(algorithm, method, count)
        name, run = choice.kernel, _in_steps(choice, backend, settings, samples, every)
    try:
        computed = run()
    except InputError:  # the state leaves the range of its numbers
        return Row(motion, name, backend, None, None)
    if not np.isfinite(computed).all():
        return Row(motion, name, backend, None, None)
    # The whole angle between the frames: low orders lose more than a right angle in an hour.
    cosine = ((computed * true).sum(axis=(1, 2)) - 1) / 2
    drift = np.arctan2(np.linalg.norm(drift_between(computed, true), axis=1), cosine)
    pitch = np.arcsin(np.clip(-computed[:, 2, 0], -1, 1))
    return Row(
        motion, name, backend, math.degrees(float(drift.max())), math.degrees(float(np.abs(pitch).max()))
    )


def _in_steps(
    choice: Choice, backend: str, settings: Settings | None, samples: Array, every: int
) -> Callable[[], Array]:
    """Return the run of an attitude step, which returns one matrix per record."""
    stepper = attitude_backend(choice, backend=backend, settings=settings)
    before, beside = catalogue.MOST_BESIDE, stepper.previous + stepper.ahead
    row = samples[before - stepper.previous : len(samples) - before + stepper.ahead]
    increments = windows(row, stepper.increments, beside)
    if stepper.increment_unit is not None:
        increments = pulses(increments, stepper.increment_unit, beside)
    steps = every // stepper.increments
    return lambda: attitude(stepper, stepper.propagate(increments, steps, steps))


def _in_two_speeds(
    algorithm: str, backend: str, settings: Settings | None, samples: Array, every: int
) -> Callable[[], Array]:
    """Return the run of an algorithm in two speeds without acceleration, which returns one matrix per record."""
    if settings is not None:
        ranges = two_speed_sources.ranges(float(np.abs(samples).max()), fast_cycles=_FAST_CYCLES)
        settings = replace(settings, ranges=ranges)
    samples = samples[catalogue.MOST_BESIDE : -catalogue.MOST_BESIDE]
    loops = two_speed_runner.TwoSpeed(algorithm, backend=backend, settings=settings)
    stride = every // _FAST_CYCLES

    def run() -> Array:
        history = loops.run(samples, np.zeros_like(samples), fast_cycles=_FAST_CYCLES)
        recorded = np.asarray(history.attitudes, np.float64)[stride - 1 :: stride]
        matrices = recorded if algorithm == "dcm" else evaluator(f"dcm-from-{algorithm}")(recorded)
        return np.concatenate([np.eye(3)[None], matrices])

    return run


@dataclass(frozen=True)
class RateTableResult(Result):
    """The largest drift of the rate-table test: a row for each motion, algorithm and back end."""

    rows_in = "drifts"
    row: ClassVar[type | None] = Row
    drawn_by: ClassVar[str] = "strapgen.navigation.rate_table:rate_table_image"

    drifts: Sequence[Row]
    #: Duration of the test, and time between gyro samples, in s
    duration: str
    sample: str

    def text(self) -> str:
        """Return a table for each motion: a line an algorithm, a column a back end."""
        rows = self.drifts
        backends = list(dict.fromkeys(row.backend for row in rows))
        columns = [
            Column("", "<"),
            *(Column(name, spec=ERROR, least=12, missing="out of range") for name in backends),
        ]
        lines = [
            f"{RATE_DEG_S:g} deg/s on all three axes, {self.duration} s, a gyro sample every {self.sample} s",
            "largest drift in deg",
        ]
        for motion in dict.fromkeys(row.motion for row in rows):
            here = [row for row in rows if row.motion == motion]
            steepest = max((row.pitch_deg for row in here if row.pitch_deg is not None), default=math.nan)
            drift_of = {(row.algorithm, row.backend): row.drift_deg for row in here}
            cells = [
                [name, *(drift_of[name, backend] for backend in backends)]
                for name in dict.fromkeys(row.algorithm for row in here)
            ]
            lines += ["", f"{motion}; pitch up to {steepest:.2f} deg", *TextTable(columns, cells).lines()]
        return "\n".join(lines)


_MARKERS = "osD^vP*X"
#: An angle that is marked: one second of arc.
_ARCSECOND_DEG = 1 / 3600


def rate_table_image(result: RateTableResult, path: str | Path) -> bytes:
    """Return the largest drift of every algorithm: a panel for each motion, a line an algorithm, a mark a back end."""
    rows, duration, sample = result.drifts, result.duration, result.sample
    motions = list(dict.fromkeys(row.motion for row in rows))
    algorithms = list(dict.fromkeys(row.algorithm for row in rows))
    backends = list(dict.fromkeys(row.backend for row in rows))
    size = (3.0 + 4.6 * len(motions), 1.7 + 0.27 * len(algorithms))
    figure, grid = figures.grid_of_axes(1, len(motions), size, sharey=True)
    for axes, motion in zip(grid[0], motions, strict=True):
        here = [row for row in rows if row.motion == motion]
        _draw_motion(axes, here, algorithms, backends)
        steepest = max((row.pitch_deg for row in here if row.pitch_deg is not None), default=math.nan)
        axes.set_title(f"{motion}; pitch up to {steepest:.1f} deg", loc="left", fontsize=10)
        axes.set_xlabel("largest drift of the run, deg")
    grid[0, 0].set_yticks(range(len(algorithms)), algorithms, fontsize=9)
    grid[0, 0].set_ylim(len(algorithms) - 0.4, -0.6)
    figures.common_legend(figure, grid[0], loc="outside lower center", ncols=min(6, len(backends)))
    figures.title(
        figure,
        f"rate table at {RATE_DEG_S:g} deg/s on all three axes, {duration} s, a gyro sample every {sample} s",
    )
    return figures.image(figure, path)


def _draw_motion(axes: Any, rows: Sequence[Row], algorithms: Sequence[str], backends: Sequence[str]) -> None:
    """Draw the drifts of one motion, with a thin line where another attitude representation begins."""
    for number, (backend, colour) in enumerate(
        zip(backends, figures.several_colours(len(backends)), strict=True)
    ):
        drifts = {row.algorithm: row.drift_deg for row in rows if row.backend == backend}
        axes.plot(
            [drifts.get(name) or math.nan for name in algorithms],
            range(len(algorithms)),
            linestyle="none",
            marker=_MARKERS[number % len(_MARKERS)],
            markersize=9.5 - 1.1 * min(number, 5),  # equal drifts: one mark inside the other
            markerfacecolor="none",
            markeredgewidth=1.5,
            color=colour,
            label=backend,
        )
    if any(row.drift_deg for row in rows):
        axes.set_xscale("log")
    figures.style(axes)
    for place, name in enumerate(algorithms):
        lost = [row.backend for row in rows if row.algorithm == name and row.drift_deg is None]
        if lost:
            axes.text(
                0.02,
                place,
                f"out of range: {', '.join(lost)}",
                transform=axes.get_yaxis_transform(),
                fontsize=8,
                color="0.35",
                va="center",
            )
    low, high = axes.get_xlim()
    if low < _ARCSECOND_DEG < high:
        axes.axvline(_ARCSECOND_DEG, color="0.55", linewidth=0.9, linestyle="--", zorder=0)
        axes.annotate(
            "1\u2033",
            (_ARCSECOND_DEG, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(3, -9),
            textcoords="offset points",
            fontsize=9,
            color="0.4",
        )
    families = [
        name.rpartition(" ")[2] if name.endswith(TWO_SPEED) else name.split("-")[0] for name in algorithms
    ]
    for place in range(1, len(families)):
        if families[place] != families[place - 1]:
            axes.axhline(place - 0.5, color="0.7", linewidth=0.8, zorder=0)
