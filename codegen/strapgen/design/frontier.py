"""Compares attitude algorithms by drift on many motions and by cost, at one sampling rate.

Every algorithm takes the same samples. The cost of a step is counted from its program, and divided by the samples
of the step.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from strapgen import catalogue, pipeline
from strapgen.catalogue import Choice
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.version import VERSION
from strapgen.lab.motions.motion_names import is_file
from strapgen.lab.motions.motions import Motion
from strapgen.lab.motions.users_motions import any_motion
from strapgen.lab.parallel_cases import Bundle, Cluster, moved, resume, side_by_side
from strapgen.lab.runs import measured_drift, simulate, steady_drift
from strapgen.lab.sensor_errors.error_file import CLASSES, ERRORS, path_of, read
from strapgen.lab.sensor_errors.instruments import InstrumentErrors
from strapgen.lab.sensor_errors.measured_motions import measured
from strapgen.results.records import INTERNAL, Properties, entry, plain_record, properties, reader_table
from strapgen.results.result import Result
from strapgen.results.table import ANGLE, Column, TextTable
from strapgen.run.backends import backend
from strapgen.storage import cache as disk_cache

#: Motions by their labels: a name, or a user's file, and its settings.
Motions = Mapping[str, tuple[str, Mapping[str, str]]]
#: Half-angles in deg and frequencies in Hz of the cones.
CONES = ("0.1", "1", "5", "15"), ("2", "5", "10", "20")
#: The motions that are compared by default. The spins are those of a body on a cone, in deg/s.
MOTIONS: Motions = {
    **{
        f"cone {angle}/{frequency}": ("cone", {"half_angle_deg": angle, "frequency_hz": frequency})
        for angle in CONES[0]
        for frequency in CONES[1]
    },
    **{
        f"spin {spin} on {angle}/{frequency}": (
            "cone",
            {"half_angle_deg": angle, "frequency_hz": frequency, "spin_deg_s": spin},
        )
        for spin, angle, frequency in (("100", "1", "10"), ("300", "5", "5"))
    },
    **{f"random {rate}": ("random", {"rate_deg_s": rate}) for rate in ("60", "200")},
    **{f"slew {ms} ms": ("slew", {"onset_s": f"0.0{ms}"}) for ms in ("50", "10")},
    "ramps 50 ms": ("ramps", {"onset_s": "0.05"}),
}
#: Runs of sensors with errors, each with random numbers of its own.
_SENSOR_RUNS = 4
#: The state that all algorithms integrate.
STATE = "euler"
#: What stands for the candidates of all methods.
EVERY = "all"


@dataclass(frozen=True)
class Candidate:
    """An algorithm that is compared."""

    #: A method, or the Python file of a user's algorithm
    method: str
    #: Samples of a step, and samples from before it and from after it
    increments: int
    previous: int = 0
    ahead: int = 0

    @property
    def name(self) -> str:
        """The method and its samples, as "coning-combined:3+3" or "window-7-7:1+7+7"."""
        beside = (
            f"+{self.previous}+{self.ahead}" if self.ahead else f"+{self.previous}" if self.previous else ""
        )
        return f"{self.method}:{self.increments}{beside}"

    @property
    def choice(self) -> Choice:
        """The choice of the step; raises `InputError` if there is none."""
        if self.method.endswith(".py"):
            return catalogue.choose_step(
                self.method, None, self.increments, previous=self.previous, ahead=self.ahead
            )
        return catalogue.choose_step(
            STATE, self.method, self.increments, previous=self.previous, ahead=self.ahead
        )


#: The algorithms by the names of their methods, each with its samples.
CANDIDATES = tuple(
    Candidate(method, *samples)
    for method, several in {
        "rk4": ((2,), (4,), (1, 3)),
        "taylor4": ((2,),),
        "taylor6": ((4,),),
        "munthe-kaas4": ((2,),),
        "magnus4": ((2,), (3,), (1, 3)),
        "magnus6": ((3,), (4,), (3, 3)),
        "coning-uncompressed": ((3,), (4,)),
        "coning-compressed": ((1, 1), (2,), (3,), (4,), (1, 3)),
        "coning-combined": ((2, 1), (3,), (3, 3), (5, 3)),
        "crouch-grossman3": ((2,), (3,)),
        "coning-least-squares": ((4,), (3, 3), (1, 8)),
        "coning-shaped-8": ((1, 8),),
        "fit-exact": ((1, 1), (2,), (3,), (4,), (3, 3)),
        "window-7-7": ((1, 7, 7),),
        "window-9-9": ((1, 9, 9),),
        **{f"pair-1-{side}": ((1, side, side),) for side in (5, 7, 8, 9)},
        **{f"pair-2-{side}": ((2, side, side),) for side in (5, 7)},
    }.items()
    for samples in several
)


@dataclass(frozen=True)
class DriftAndCost:
    """Operations of an algorithm in a step, and its drift on each motion."""

    #: Of the candidate, of its kernel, and where the algorithm comes from
    name: str
    title: str
    source: str
    #: Samples of a step
    increments: int
    #: Multiplications, additions and subtractions, and all other operations of a step: divisions, roots, sines
    #: and cosines, choices
    multiply: int
    add: int
    other: int
    #: The drift on each motion in deg/h; None where the attitude leaves the range of its numbers
    drifts: Mapping[str, float | None]

    def per_second(self, sample_hz: float) -> float:
        """Return the multiplications a second at a sampling rate in Hz."""
        return self.multiply / self.increments * sample_hz


@dataclass(frozen=True)
class RunSpec:
    """A candidate with the motions, the sampling rate and the duration of its runs, as a worker process takes it."""

    candidate: Candidate
    #: Sampling rate in Hz, and length of the runs in s
    sample_hz: str
    duration: str
    #: By their labels
    motions: Motions = field(default_factory=lambda: MOTIONS)
    #: File or class of sensor errors; empty for exact increments
    errors: str = ""

    def moved(self, begin: Path, end: Path) -> RunSpec:
        """Return the specification with the user's files in another folder, see `parallel_cases.Bundle`."""
        one, motions = self.candidate, dict(self.motions)
        if one.method.endswith(".py"):
            one = replace(one, method=moved(one.method, begin, end))
        for label, (name, settings) in motions.items():
            motions[label] = (moved(name, begin, end) if is_file(name) else name, settings)
        errors = moved(self.errors, begin, end) if self.errors and self.errors not in CLASSES else self.errors
        return replace(self, candidate=one, motions=motions, errors=errors)


def candidates(names: Iterable[str] | None = None) -> list[Candidate]:
    """Return the requested algorithms, checked.

    >>> [candidate.name for candidate in candidates(["magnus6", "rk2:1+1"])]
    ['magnus6:3', 'magnus6:4', 'magnus6:3+3', 'rk2:1+1']
    """
    if names is None:
        return list(CANDIDATES)
    chosen: dict[Candidate, None] = {}
    for name in names:
        method, colon, samples = name.rpartition(":")
        if name == EVERY:
            every = (one for method in catalogue.METHODS for one in _of_method(method))
            chosen |= dict.fromkeys([*CANDIDATES, *every])
            continue
        if not colon:
            chosen |= dict.fromkeys(_of_method(name))
            continue
        counts = [checks.whole(f"number of samples in {name}", part) for part in samples.split("+")]
        if len(counts) > 3:
            raise InputError(f"{name} has {len(counts)} numbers of samples; METHOD:N+P+L has at most three")
        candidate = Candidate(method, *counts)
        _ = candidate.choice  # refuses what is not known
        chosen[candidate] = None
    return list(chosen)


def _of_method(method: str) -> list[Candidate]:
    """Return the candidates of a method; without any, one with the number of samples that the method needs."""
    several = [candidate for candidate in CANDIDATES if candidate.method == method]
    if several:
        return several
    if method.endswith(".py"):
        choice = catalogue.choose_step(method)
    else:
        checks.choice("method", method, catalogue.METHODS)
        choice = catalogue.choose_step(STATE, method, None)
    assert choice.increments is not None, "a step of increments is chosen"
    return [Candidate(method, choice.increments, choice.previous, choice.ahead)]


def identity(sample_hz: str, duration: str, motions: Motions = MOTIONS, errors: str = "") -> dict[str, Any]:
    """Return the identity of a study: the code, the sampling, the motions, and the errors of sensors."""
    return {
        "study": "frontier",
        "version": VERSION,
        "code": disk_cache.generator_digest(),
        "sample_hz": str(Fraction(sample_hz)),
        "duration_s": str(Fraction(duration)),
        "motions": {label: [name, dict(settings)] for label, (name, settings) in motions.items()},
        **({"errors": repr(ERRORS.content(path_of(errors)))} if errors else {}),
    }


def frontier(
    several: Sequence[Candidate],
    sample_hz: str = "100",
    duration: str = "60",
    results: str | Path | None = None,
    jobs: int | None = None,
    cluster: Cluster | None = None,
    motions: Motions = MOTIONS,
    errors: str = "",
) -> Iterator[DriftAndCost]:
    """Run algorithms on motions, and yield drift and cost of each when its runs end.

    `sample_hz, duration`: sampling rate in Hz, and length of the runs in s. `errors`: file or class of sensor errors.
    """
    if errors:
        read(errors)  # refuses what is not allowed
    rate, length = require_steps(several, sample_hz, duration)
    for name, settings in motions.values():
        any_motion(name, str(length), settings)  # refuses what is not known
    cases = {one.name: RunSpec(one, str(rate), str(length), motions, errors) for one in several}
    users = [one.method for one in several if one.method.endswith(".py")]
    users += [name for name, _ in motions.values() if is_file(name)]
    users += [errors] if errors and errors not in CLASSES else []
    files = None if cluster is None else Bundle.of(users)
    if results is None:
        finished = side_by_side(run_case, cases, jobs, cluster, files)
    else:
        about = identity(str(rate), str(length), motions, errors)
        finished = resume(run_case, cases, results, about, jobs, cluster, files)
    for _, data in finished:
        yield DriftAndCost(**data)


def require_steps(several: Sequence[Candidate], sample_hz: str, duration: str) -> tuple[Fraction, Fraction]:
    """Return the sampling rate and the duration as numbers, in which every algorithm has a whole step."""
    rate = checks.number("sample_hz", sample_hz, positive=True)
    length = checks.number("duration", duration, positive=True)
    for candidate in several:
        if length * rate < candidate.increments:
            raise InputError(
                f"duration {float(length):g} s is shorter than a step of {candidate.name} at {float(rate):g} Hz"
            )
    checks.multiple("duration", length, "sampling interval", 1 / rate)
    return rate, length


def in_order(drifts_and_costs: Iterable[DriftAndCost], several: Sequence[Candidate]) -> list[DriftAndCost]:
    """Return drifts and costs in the order of the candidates."""
    by_name = {drift_and_cost.name: drift_and_cost for drift_and_cost in drifts_and_costs}
    return [by_name[candidate.name] for candidate in several]


def run_case(spec: RunSpec) -> dict[str, Any]:
    """Run a candidate on the motions of a specification; return drift and cost as plain JSON data."""
    choice = spec.candidate.choice
    program = pipeline.program(choice)
    operations = program.operations
    return asdict(
        DriftAndCost(
            spec.candidate.name,
            program.title,
            program.source,
            spec.candidate.increments,
            operations["multiply"],
            operations["add"],
            sum(number for kind, number in operations.items() if kind not in ("multiply", "add", "negate")),
            {label: _drift(choice, label, spec) for label in spec.motions},
        )
    )


def _drift(choice: Choice, label: str, spec: RunSpec) -> float | None:
    """Return the drift on a motion over as many whole steps as the duration holds, in deg/h."""
    rate, duration = Fraction(spec.sample_hz), Fraction(spec.duration)
    step = spec.candidate.increments / rate
    name, settings = spec.motions[label]
    with np.errstate(all="ignore"):
        try:
            profile = _motion(name, tuple(settings.items()), spec.duration)
            if spec.errors:
                value = _drift_of_sensors(choice, profile, step, duration // step, spec.errors)
            else:
                value = measured_drift(choice, profile, step, duration // step)
        except InputError:  # the attitude is not finite
            return None
    return value if np.isfinite(value) else None


def _drift_of_sensors(choice: Choice, motion: Motion, step: Fraction, count: int, errors: str) -> float:
    """Return the root mean square of the steady drift in deg/h of runs of sensors with errors."""
    stepper, sensors = backend(choice), _sensors(errors)
    runs = (simulate(stepper, measured(motion, sensors, k), step, count * step) for k in range(_SENSOR_RUNS))
    return math.sqrt(math.fsum(steady_drift(run) ** 2 for run in runs) / _SENSOR_RUNS)


@cache
def _sensors(errors: str) -> InstrumentErrors:
    return read(errors)


@cache
def _motion(name: str, settings: tuple[tuple[str, str], ...], duration: str) -> Motion:
    """Return a motion, which has checked the settings of a user's file once for all candidates of a process."""
    return any_motion(name, duration, dict(settings))


def pareto(points: Mapping[str, tuple[float, float]], gain: float = 0.0) -> list[str]:
    """Return the names of the points on the Pareto front: a second number below all others so far, by the share `gain`.

    >>> pareto({"cheap": (1, 9), "worse": (2, 9), "little": (3, 8.9), "good": (4, 1)}, gain=0.1)
    ['cheap', 'good']
    """
    front: list[str] = []
    for name in sorted(points, key=lambda name: points[name]):
        if not front or points[name][1] < (1 - gain) * points[front[-1]][1]:
            front.append(name)
    return front


#: Format of a drift, and of a count for each sample.
_DRIFT, _COUNT = ANGLE, ".5g"


@dataclass(frozen=True)
class AlgorithmCost:
    """Operations of an algorithm for each sample, and its drift on each motion."""

    algorithm: str = field(metadata=entry("algorithm", align="<"))
    title: str
    #: Where it comes from
    source: str
    #: Samples of a step
    increments: int
    multiply_per_sample: float = field(metadata=entry("multiply", _COUNT))
    add_per_sample: float = field(metadata=entry("add", _COUNT))
    #: Divisions, roots, sines and cosines, choices
    other_per_sample: float = field(metadata=entry("other", _COUNT))
    multiply_per_s: float = field(metadata=entry("multiply/s", _COUNT))
    #: The drift on each motion; None where the attitude leaves the range of its numbers
    drift_deg_h: Mapping[str, float | None]


@dataclass(frozen=True)
class FrontierResult(Result):
    """Operations of attitude algorithms, and their drift on every motion."""

    computed: ClassVar[Properties] = properties(motions=entry(), algorithms=entry())
    drawn_by: ClassVar[str] = "strapgen.design.design_plots:frontier_image"

    drifts_and_costs: Sequence[DriftAndCost] = field(metadata=INTERNAL)
    #: Sampling rate
    sample_hz: float
    #: Length of the runs
    duration_s: float
    described: Motions = field(default_factory=lambda: MOTIONS, metadata=INTERNAL)
    #: File or class of sensor errors; empty for exact increments
    errors: str = ""

    @property
    def motions(self) -> dict[str, dict[str, str]]:
        """The motions by their labels: the name of each, and its parameters."""
        return {label: {"motion": name, **settings} for label, (name, settings) in self.described.items()}

    @property
    def algorithms(self) -> list[AlgorithmCost]:
        """The algorithms, with their costs for each sample."""
        return [
            AlgorithmCost(
                algorithm=one.name,
                title=one.title,
                source=one.source,
                increments=one.increments,
                multiply_per_sample=one.multiply / one.increments,
                add_per_sample=one.add / one.increments,
                other_per_sample=one.other / one.increments,
                multiply_per_s=one.per_second(self.sample_hz),
                drift_deg_h=one.drifts,
            )
            for one in self.drifts_and_costs
        ]

    def rows(self) -> list[dict[str, Any]]:
        """Return all figures, a row for each algorithm."""
        rows = []
        for one in self.algorithms:
            row = plain_record(one)
            drifts = row.pop("drift_deg_h")
            rows.append(row | {f"{label} deg/h": drift for label, drift in drifts.items()})
        return rows

    def reader(self) -> TextTable:
        """Return costs and drifts."""
        costs = reader_table(self.algorithms, AlgorithmCost)
        columns = [*costs.columns, *(Column(label, spec=_DRIFT) for label in self.described)]
        rows = zip(costs.rows, self.drifts_and_costs, strict=True)
        return TextTable(columns, [[*row, *one.drifts.values()] for row, one in rows])

    def text(self) -> str:
        """Return a table of costs, and one for each kind of motion."""
        exact = [
            f"largest angle from the true attitude over {self.duration_s:g} s, divided by that time, in deg/h,",
            f"with exact increments at {self.sample_hz:g} Hz; every figure is measured here,",
            "what rounding could hide again in 40 digits; random rates and slews, integrated to 5e-13 rad, cannot be",
        ]
        of_sensors = [
            f"steady drift over {self.duration_s:g} s in deg/h, root mean square of {_SENSOR_RUNS} runs,",
            f"with increments at {self.sample_hz:g} Hz of sensors with errors, {self.errors}",
        ]
        lines = [
            *(of_sensors if self.errors else exact),
            "",
            "operations for each sample, counted from the program; other: divisions, roots, sines, cosines, choices",
            "N+P+L: samples of a step, from before it, from after it",
            "",
            *reader_table(self.algorithms, AlgorithmCost).lines(),
        ]
        for title, columns in _tables() if self.described == MOTIONS else _table_of(self.described):
            rows = [[one.name, *(one.drifts[label] for label in columns)] for one in self.drifts_and_costs]
            table = TextTable([Column("", "<"), *columns.values()], rows)
            lines += ["", title, "", *table.lines()]
        lines += ["", "sources", ""]
        sources: dict[str, list[str]] = {}
        for one in self.drifts_and_costs:
            sources.setdefault(one.source, []).append(one.name)
        return "\n".join([*lines, *(f"{', '.join(names)}: {source}" for source, names in sources.items())])


def _tables() -> list[tuple[str, dict[str, Column]]]:
    """Return the tables of drifts: a title, and the column of each motion by its label."""
    angles, frequencies = CONES
    tables = []
    for pair in (angles[:2], angles[2:]):
        columns = {
            f"cone {angle}/{frequency}": Column(f"{frequency} Hz", spec=_DRIFT, group=f"cone of {angle} deg")
            for angle in pair
            for frequency in frequencies
        }
        tables.append((f"drift on cones, half-angle {' and '.join(pair)} deg", columns))
    rest = [label for label in MOTIONS if not label.startswith("cone ")]
    title = "drift on cones of a body that spins, at deg/s on half-angle/Hz; random rates, at deg/s; slews"
    return [*tables, (title, {label: Column(label, spec=_DRIFT) for label in rest})]


def _table_of(motions: Motions) -> list[tuple[str, dict[str, Column]]]:
    """Return the table of drifts on motions that a user states."""
    words = "; ".join(
        ", ".join([name, *(f"{key}={value}" for key, value in settings.items())])
        for name, settings in motions.values()
    )
    return [(f"drift on {words}", {label: Column(label, spec=_DRIFT) for label in motions})]
