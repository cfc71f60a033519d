"""Runs a described system on several back ends from the counts of one vehicle, and compares the navigation outputs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from strapgen.ir.fixed_settings import Settings
from strapgen.navigation.systems import system_runs
from strapgen.navigation.systems.budget import Budget, budget, measured_budget
from strapgen.navigation.systems.system import Cell
from strapgen.navigation.systems.system_runner import (
    CompiledSystem,
    SystemRunner,
    system_runner,
)
from strapgen.navigation.systems.system_runs import matrices
from strapgen.navigation.systems.turning_vehicle import TurningVehicle
from strapgen.navigation.systems.wiring import Description
from strapgen.results.records import INTERNAL, entry, reader_table
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.run import backends
from strapgen.targets.printer import fill

Array = NDArray[np.float64]
#: The back end that the others are compared with.
REFERENCE = "c"
#: Radius by which an angle of position becomes a distance, in m.
_RADIUS = 6378137.0


@dataclass(frozen=True)
class NavigationErrors:
    """Differences of attitude, velocity and position of one back end from another."""

    backend: str
    #: (N,): angle between the attitudes in rad, length of the difference of velocities in m/s, distance of the
    #: positions in m, after each of their cycles; empty where the system has no such output
    attitude: Array
    velocity: Array
    position: Array


@dataclass(frozen=True)
class SystemStudy:
    """The result of a study."""

    description: Description
    seconds: float
    #: (N,): angle between the attitude of the reference and the true one in rad; empty without an attitude
    against_truth: Array
    #: Of every other back end against the reference
    errors: tuple[NavigationErrors, ...]
    #: Memory and operations of the code of each back end in C
    needs: Mapping[str, Budget]


def study(
    description: Description,
    vehicle: TurningVehicle,
    seconds: Fraction,
    names: Iterable[str],
    settings: Settings | None = None,
    cpu: str = "",
) -> SystemStudy:
    """Run a system on back ends.

    `description`: its inputs are increments or counts of gyros and accelerometers in body axes.
    """
    inputs = samples(description, vehicle, seconds)
    outputs = Outputs.of(description)

    needs: dict[str, Budget] = {}

    def run(name: str) -> tuple[SystemRunner, Mapping[str, Array]]:
        fixed = backends.BACKENDS[name].fixed
        runner = system_runner(description, name, settings if fixed else None)
        if isinstance(runner, CompiledSystem):
            needs[name] = measured_budget(runner.fit, cpu) if cpu and fixed else budget(runner.fit)
        memory = None
        if outputs.attitude is not None:
            memory, _ = system_runs.begun(runner, vehicle.attitude(np.zeros(1))[0])
        return runner, runner.run(inputs, memory).values

    runner, values = run(REFERENCE)
    errors = tuple(
        outputs.between(name, run(name)[1], values) for name in dict.fromkeys(names) if name != REFERENCE
    )
    truth = np.empty(0)
    if outputs.attitude is not None:
        every = runner.system.every(outputs.attitude.name)
        attitudes = matrices(outputs.attitude.signal, values[outputs.attitude.name])
        times = np.arange(1.0, len(attitudes) + 1) * float(every / runner.system.sample_hz)
        truth = angles(attitudes, vehicle.attitude(times))
    return SystemStudy(description, float(seconds), truth, errors, needs)


def samples(description: Description, vehicle: TurningVehicle, seconds: Fraction) -> dict[str, Array]:
    """Return the samples of a system on a vehicle, by the names of its inputs.

    An input in rad or m/s takes increments. One of counts takes those of the unit that the stage has to which it is
    wired, angle-counts or velocity-counts. Where a stage compensates the errors of a measurement unit, the sensors have
    these errors: the kernel that is its inverse makes them.
    """
    system = description.system
    cycles = system_runs.cycles_of(system, seconds)
    angle, velocity = vehicle.increments(float(1 / system.sample_hz), cycles)
    return system_runs.samples(description, angle, velocity)


@dataclass(frozen=True)
class Outputs:
    """The cells with attitude, velocity and position of a system; None for a missing output."""

    attitude: Cell | None
    velocity: Cell | None
    position: Cell | None

    @classmethod
    def of(cls, description: Description) -> Outputs:
        """Return the first output of each kind."""
        cells = [description.system.cell(name) for name in description.system.outputs]

        def first(frame: str, constraint: bool, unit: str) -> Cell | None:
            fitting = (
                cell
                for cell in cells
                if (cell.signal.frame, bool(cell.signal.constraint), cell.signal.unit)
                == (frame, constraint, unit)
            )
            return next(fitting, None)

        return cls(first("b to n", True, "1"), first("n", False, "m/s"), first("n to e", True, "1"))

    def between(self, name: str, one: Mapping[str, Array], other: Mapping[str, Array]) -> NavigationErrors:
        """Return the differences of one run from another."""
        empty = np.empty(0)

        def turned(cell: Cell | None) -> Array:
            if cell is None:
                return empty
            return angles(matrices(cell.signal, one[cell.name]), matrices(cell.signal, other[cell.name]))

        velocity = empty
        if self.velocity is not None:
            velocity = np.linalg.norm(one[self.velocity.name] - other[self.velocity.name], axis=-1)
        return NavigationErrors(name, turned(self.attitude), velocity, turned(self.position) * _RADIUS)


def angles(one: Array, other: Array) -> Array:
    """Return the angle between attitudes in rad, from the antisymmetric part of their quotient."""
    turned = one @ other.swapaxes(-1, -2)
    skew = (turned - turned.swapaxes(-1, -2)) / 2
    return np.asarray(np.sqrt(skew[..., 2, 1] ** 2 + skew[..., 0, 2] ** 2 + skew[..., 1, 0] ** 2))


_ARCSEC = math.degrees(1) * 3600
_SPEC = ".3g"
#: What the papers print, AGARD LS-133.
_PRINTED = (
    "printed in 1984: LTR-81 had a Z-8002 with 40,960 bytes of program and 6,144 of scratch for its whole task, and "
    "the M6800 of the gyro module of LCIGS, with 1,433 bytes of program and 143 of memory, was busy 85 % of the time"
)


@dataclass(frozen=True)
class DifferenceRow:
    """Differences of a back end from double, largest and at the end; None for a missing output."""

    backend: str = field(metadata=entry("back end", align="<"))
    attitude_arcsec: float | None = field(metadata=entry("largest", _SPEC, group="attitude, arcsec"))
    attitude_end_arcsec: float | None = field(metadata=entry("at the end", _SPEC, group="attitude, arcsec"))
    velocity_m_s: float | None = field(metadata=entry("largest", _SPEC, group="velocity, m/s"))
    velocity_end_m_s: float | None = field(
        metadata=entry("at the end", _SPEC, group="velocity, m/s", unit="m/s")
    )
    position_m: float | None = field(metadata=entry("largest", _SPEC, group="position, m"))
    position_end_m: float | None = field(metadata=entry("at the end", _SPEC, group="position, m"))

    @staticmethod
    def of(errors: NavigationErrors) -> DifferenceRow:
        """Return the largest difference of each kind, and that at the end."""
        row: list[float | None] = []
        for values, scale in ((errors.attitude, _ARCSEC), (errors.velocity, 1.0), (errors.position, 1.0)):
            both = (values.max(), values[-1]) if values.size else (None, None)
            row += [None if value is None else float(value) * scale for value in both]
        return DifferenceRow(errors.backend, *row)


@dataclass(frozen=True)
class ResourceRow:
    """Memory, code and load of a back end in C; None where no processor was named."""

    backend: str
    memory_bytes: int
    constant_bytes: int
    operations_per_s: float
    cpu: str | None
    code_bytes: int | None
    instructions_per_s: float | None

    @staticmethod
    def of(backend: str, needs: Budget) -> ResourceRow:
        """Return memory, code and load of a back end."""
        executed = needs.executed_per_second
        return ResourceRow(
            backend,
            needs.memory_bytes,
            needs.constant_bytes,
            float(needs.per_second),
            needs.cpu,
            needs.code_bytes,
            None if executed is None else float(executed),
        )


class AttitudeError(NamedTuple):
    """Angle between the attitude and the true one in arcsec, at most and at the end."""

    largest: float
    end: float


@dataclass(frozen=True)
class SystemStudyResult(Result):
    """Navigation outputs of a described system on several back ends."""

    rows_in = "from_double"

    study: SystemStudy = field(metadata=INTERNAL)
    system: str
    sample_hz: float
    seconds: float
    #: Attitude of C in double from the true one; None without an attitude
    double_from_truth_arcsec: AttitudeError | None
    needs: list[ResourceRow]
    from_double: list[DifferenceRow]

    @staticmethod
    def of(study: SystemStudy) -> SystemStudyResult:
        """Return the result of a study."""
        truth, system = study.against_truth * _ARCSEC, study.description.system
        return SystemStudyResult(
            study=study,
            system=system.name,
            sample_hz=float(system.sample_hz),
            seconds=study.seconds,
            double_from_truth_arcsec=AttitudeError(float(truth.max()), float(truth[-1]))
            if truth.size
            else None,
            needs=[ResourceRow.of(name, budget) for name, budget in study.needs.items()],
            from_double=list(map(DifferenceRow.of, study.errors)),
        )

    def text(self) -> str:
        """Return differences, memory and load."""
        return "\n".join(_lines(self))


def _lines(result: SystemStudyResult) -> Iterator[str]:
    study = result.study
    system = study.description.system
    yield f"{system.title}: {study.seconds:g} s at {float(system.sample_hz):g} Hz"
    if study.against_truth.size:
        truth = study.against_truth * _ARCSEC
        yield (
            f"attitude in double: {truth.max():{_SPEC}} arcsec from the truth at most, {truth[-1]:{_SPEC}} at the end"
        )
    if study.errors:
        yield from [
            "",
            "differences from double, in one closed run",
            "",
            *reader_table(result.from_double, DifferenceRow).lines(),
        ]
    yield from ["", *_load(result.needs).lines(), "", *fill(_PRINTED, "", 100).splitlines()]


def _load(needs: Sequence[ResourceRow]) -> TextTable:
    """Return memory, code and load of each back end in C."""
    cpu = next((row.cpu for row in needs if row.cpu), "")
    columns = [Column("back end", "<"), Column("state, bytes"), Column("constants, bytes")]
    columns += [Column("operations/s", spec=",.0f")]
    columns += [Column(f"code on {cpu}, bytes"), Column("instructions/s", spec=",.0f")] if cpu else []
    rows = []
    for row in needs:
        measured = [row.code_bytes, row.instructions_per_s] if cpu else []
        rows.append([row.backend, row.memory_bytes, row.constant_bytes, row.operations_per_s, *measured])
    return TextTable(columns, rows)
