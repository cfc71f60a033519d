"""Counts detected and isolated failures of sensors with errors, by Monte Carlo."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from itertools import product
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from strapgen import pipeline
from strapgen.ir.exceptions import InputError
from strapgen.navigation.redundancy import redundancy_kernels
from strapgen.navigation.redundancy.geometry import SensorGeometry
from strapgen.navigation.redundancy.geometry_report import FailureTable, failure_table
from strapgen.navigation.redundancy.redundancy_kernels import SensorSet
from strapgen.results import figures
from strapgen.results.records import INTERNAL, Properties, entry, properties, reader_table
from strapgen.results.result import Result
from strapgen.run.backend_names import BACKENDS, of_sources
from strapgen.run.evaluators import Evaluator
from strapgen.run.kernel_sources import sources_of_program

Array = NDArray[np.float64]
_ARCSEC = float(np.radians(1 / 3600))
#: Sizes of a failure in trip levels; zero is none, for false alarms.
SIZES = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 8.0, 12.0)


@dataclass(frozen=True)
class SensorErrors:
    """Errors of the sensors, flight conditions and trip levels of a study; all are choices of the study."""

    #: Cycle in s
    cycle_s: float = 0.02
    #: Largest rate about an axis and largest load; trials are uniform up to them
    rate_deg_s: float = 100.0
    load_g: float = 7.0
    #: Standard deviation of white noise of a cycle, and the quantum of the counts
    noise_arcsec: float = 1.0
    pulse_arcsec: float = 3.0
    #: Standard deviations
    bias_deg_h: float = 1.0
    scale_ppm: float = 50.0
    #: Angle by which the second half of the sensors bends against the first, about a random axis, for each g
    bending_arcmin_g: float = 1.0
    #: Trip level in standard deviations of all errors that do not depend on rate
    trip_sigmas: float = 5.0
    #: Part of the trip level for each unit of rate and of rate times bending, in standard deviations too
    trip_rate: float = 3.0

    def __post_init__(self) -> None:
        for one in fields(self):
            value = getattr(self, one.name)
            if not np.isfinite(value) or value < 0 or (one.name == "cycle_s" and value == 0):
                raise InputError(f"{one.name} is {value}; a finite number above 0 is needed")

    @property
    def steady(self) -> float:
        """Standard deviation of the errors of an increment that do not depend on rate, in rad."""
        noise = self.noise_arcsec * _ARCSEC
        quantum = self.pulse_arcsec * _ARCSEC / np.sqrt(6)  # the difference of two counts
        bias = np.radians(self.bias_deg_h / 3600) * self.cycle_s
        return float(np.sqrt(noise**2 + quantum**2 + bias**2))

    def trip(self, increment: Array, load: Array) -> Array:
        """Return the trip levels of equations of length 1, scheduled on increments in rad and loads in g, (trials,)."""
        turned = np.linalg.norm(increment, axis=-1)
        moving = self.scale_ppm * 1e-6 + self.bending_arcmin_g * load * 60 * _ARCSEC
        level: Array = self.trip_sigmas * self.steady + self.trip_rate * moving * turned
        return level


@dataclass(frozen=True)
class Outcomes:
    """Counts of trials with sensors removed before, and one that fails by a size."""

    computed: ClassVar[Properties] = properties(
        undetected=entry("undetected", group="equations"),
        false_alarms=entry("false_alarms", group="equations"),
    )

    #: Sensors that failed before and are excluded
    removed: int = field(metadata=entry("removed"))
    #: Size of the failure in trip levels; 0 for none
    size: float = field(metadata=entry("size", ".3g"))
    trials: int
    #: Trials in which an equation fails
    detected: int = field(metadata=entry("detected", group="equations"))
    #: The failing sensor is isolated, by the rule of the kernel
    isolated: int = field(metadata=entry("isolated", group="rule"))
    #: Another one is isolated
    wrong: int = field(metadata=entry("wrong", group="rule"))
    #: A triad is selected without the failing sensor, if one fails
    selected: int = field(metadata=entry("selected", group="rule"))
    #: The same by the tables
    table_isolated: int = field(metadata=entry("isolated", group="tables"))
    #: The same by the tables
    table_wrong: int = field(metadata=entry("wrong", group="tables"))
    #: The same by the tables
    table_selected: int = field(metadata=entry("selected", group="tables"))

    @property
    def undetected(self) -> int:
        """Trials with a failure in which no equation fails."""
        return self.trials - self.detected if self.size else 0

    @property
    def false_alarms(self) -> int:
        """Trials without a failure in which an equation fails."""
        return 0 if self.size else self.detected


@dataclass(frozen=True)
class _Unit:
    """The kernels of a set of sensors as callables, and its tables."""

    sensors: SensorSet
    parity: Evaluator
    select: Evaluator
    tables: dict[tuple[int, ...], FailureTable]


def study_steps(geometry: SensorGeometry) -> list[tuple[int, float]]:
    """Return the numbers of removed sensors with the sizes of a failure, each of which is a step of the study."""
    return list(product(range(geometry.fail_operate + 1), SIZES))


def redundancy_study(
    sensors: SensorSet, errors: SensorErrors, trials: int, seed: int = 1, backend: str = "numpy"
) -> Iterator[Outcomes]:
    """Yield the counts of every step of the study."""
    if sensors.sensor != "gyro":
        raise InputError(f"the study is one of gyros; the sensors of {sensors.name} are accelerometers")
    largest = np.sqrt(3) * np.radians(errors.rate_deg_s) * errors.cycle_s
    if largest > sensors.range:
        raise InputError(
            f"increments reach {largest:.3g} rad, beyond the range {sensors.range} of the sensors of {sensors.name}"
        )
    target = BACKENDS[backend].target
    parity, select = (
        of_sources(sources_of_program(pipeline.lower(kernel(sensors)), target))
        for kernel in (redundancy_kernels.parity, redundancy_kernels.select)
    )
    unit = _Unit(sensors, parity, select, {})
    rng = np.random.default_rng(seed)
    for removed, size in study_steps(sensors.geometry):
        yield _step(unit, errors, removed, size, trials, rng)


def _step(
    unit: _Unit, errors: SensorErrors, removed: int, size: float, trials: int, rng: np.random.Generator
) -> Outcomes:
    geometry = unit.sensors.geometry
    order = np.argsort(rng.random((trials, geometry.count)), axis=1)
    gone, failing = np.sort(order[:, :removed], axis=1), order[:, removed]
    measured, trip = _measured(geometry, errors, trials, rng)
    measured[np.arange(trials), failing] += size * trip * rng.choice((-1, 1), trials)
    excluded = np.zeros((trials, geometry.count))
    np.put_along_axis(excluded, gone, 1.0, axis=1)
    vectors = np.array(geometry.equations, float)
    levels = trip[:, None] * np.linalg.norm(vectors, axis=1)
    parity = unit.parity(measured)
    detected, failed, triad = unit.select(parity, levels, excluded)
    rule = np.where(failed.any(axis=1), failed.argmax(axis=1), -1)
    table, chosen = _by_tables(unit, np.abs(parity) >= levels, gone)
    members = np.array([[s in t.sensors for s in range(geometry.count)] for t in geometry.triads])

    def without(numbers: Any) -> int:
        return int((~members[np.asarray(numbers, int), failing]).sum()) if size else trials

    return Outcomes(
        removed,
        size,
        trials,
        int((detected > 0.5).sum()),
        *_isolated_counts(rule, failing, size),
        without(triad),
        *_isolated_counts(table, failing, size),
        without(chosen),
    )


def _isolated_counts(told: Any, failing: Any, size: float) -> tuple[int, int]:
    """Return how often the failing sensor is isolated, and how often another one."""
    right = (told == failing) & (size > 0)
    return int(right.sum()), int(((told >= 0) & ~right).sum())


def _measured(
    geometry: SensorGeometry, errors: SensorErrors, trials: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Return the increments that the sensors measure, (trials, N), and the trip levels, (trials,)."""
    axes = np.array(geometry.axes, float)
    true = np.radians(errors.rate_deg_s) * errors.cycle_s * rng.uniform(-1, 1, (trials, 3))
    load = errors.load_g * rng.uniform(0, 1, trials)
    about = rng.normal(size=(trials, 3))
    about /= np.linalg.norm(about, axis=1, keepdims=True)
    bent = true + np.cross(errors.bending_arcmin_g * 60 * _ARCSEC * load[:, None] * about, true)
    half = geometry.count // 2
    measured = np.concatenate([true @ axes[:half].T, bent @ axes[half:].T], axis=1)
    shape = measured.shape
    measured *= 1 + errors.scale_ppm * 1e-6 * rng.normal(size=shape)
    measured += np.radians(errors.bias_deg_h / 3600) * errors.cycle_s * rng.normal(size=shape)
    measured += errors.noise_arcsec * _ARCSEC * rng.normal(size=shape)
    if errors.pulse_arcsec:
        quantum, begin = errors.pulse_arcsec * _ARCSEC, rng.random(shape)
        measured = quantum * np.floor(
            measured / quantum + begin
        )  # the angle begins anywhere within a quantum
    return measured, errors.trip(true, load)


def _by_tables(unit: _Unit, fails: NDArray[np.bool_], gone: Any) -> tuple[Any, Any]:
    """Return the failed sensor by the tables, -1 for none, and the number of the selected triad, (trials,)."""
    geometry = unit.sensors.geometry
    failed, triads = np.full(len(fails), -1), np.zeros(len(fails), int)
    for number, (status, removed) in enumerate(zip(fails, map(tuple, gone.tolist()), strict=True)):
        if removed not in unit.tables:
            unit.tables[removed] = failure_table(geometry, removed)
        table = unit.tables[removed]
        verdict = table.verdicts.get(tuple(status[list(table.equations)].tolist()))
        if verdict is None:  # a status that the scan has not met: no sensor is told
            continue
        failed[number] = -1 if verdict.failed is None else verdict.failed
        triads[number] = verdict.triad
    return failed, triads


_KEYS = (
    *("removed", "size", "detected", "undetected", "false_alarms", "isolated", "wrong", "selected"),
    *("table_isolated", "table_wrong", "table_selected"),
)


@dataclass(frozen=True)
class RedundancyResult(Result):
    """Detected and isolated failures of redundant sensors."""

    computed: ClassVar[Properties] = properties(name=entry())
    drawn_by: ClassVar[str] = f"{__name__}:redundancy_image"

    sensors: SensorSet = field(metadata=INTERNAL)
    errors: SensorErrors
    outcomes: Sequence[Outcomes] = field(metadata=entry(key="rows"))

    @property
    def name(self) -> str:
        """Name of the set of sensors."""
        return self.sensors.name

    def rows(self) -> list[dict[str, Any]]:
        """Return the counts of each step."""
        return [{key: getattr(row, key) for key in _KEYS} for row in self.outcomes]

    def text(self) -> str:
        """Return the counts as a table."""
        head = (
            f"{self.name}: {self.outcomes[0].trials} trials in every row; size of the failure in trip levels of "
            "equations of length 1;\nselected: a triad without the failing sensor\n"
        )
        return f"{head}\n{reader_table(self.outcomes, Outcomes, *_KEYS).as_text()}"


def redundancy_image(result: RedundancyResult, path: str | Path) -> bytes:
    """Return the shares of detected and isolated failures against their size, a panel for each number removed."""
    groups: dict[int, list[Outcomes]] = {}
    for row in result.outcomes:
        groups.setdefault(row.removed, []).append(row)
    figure, grid = figures.grid_of_axes(1, len(groups), (2.0 + 3.6 * len(groups), 4.2), sharey=True)
    for axes, (removed, group) in zip(grid[0], groups.items(), strict=True):
        _draw(axes, group)
        axes.set_title(f"sensors removed before: {removed}", loc="left", fontsize=10)
        axes.set_xlabel("failure, trip levels")
    grid[0][0].set_ylabel("share of the trials")
    figures.common_legend(figure, list(grid[0]), loc="outside right center")
    figures.title(figure, f"{result.name}: what becomes of a failure of one more sensor")
    return figures.image(figure, path)


def _draw(axes: Any, group: Sequence[Outcomes]) -> None:
    sizes = [row.size for row in group]
    lines = (
        ("an equation fails", "detected", "-"),
        ("isolated by the rule", "isolated", "-"),
        ("isolated by the tables", "table_isolated", ":"),
        ("another one by the tables", "table_wrong", ":"),
        ("selected without it", "selected", "--"),
    )
    for (label, key, line), colour in zip(lines, figures.several_colours(len(lines)), strict=True):
        shares = [getattr(row, key) / row.trials for row in group]
        axes.plot(sizes, shares, line, color=colour, linewidth=1.6, label=label)
    figures.style(axes)
