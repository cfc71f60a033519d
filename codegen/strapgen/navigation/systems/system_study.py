"""Runs a described system along a motion over the earth on several back ends, and tells its errors by their causes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import ClassVar, NamedTuple

from strapgen.ir.fixed_settings import Settings
from strapgen.lab.motions.motions import Motion
from strapgen.lab.sensor_errors.instruments import InstrumentErrors
from strapgen.lab.sensor_errors.measured_motions import measured
from strapgen.navigation.systems.budget import Budget, budget, measured_budget
from strapgen.navigation.systems.system_flight import Flight, flight_figure, fly
from strapgen.navigation.systems.system_runner import CompiledSystem, system_runner
from strapgen.navigation.systems.wiring import Description
from strapgen.navigation.vehicle.vehicle_motion import VehicleMotion
from strapgen.results import figures
from strapgen.results.records import INTERNAL, entry, reader_table
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.run import backends
from strapgen.targets.printer import fill

#: The back end that the others are compared with.
REFERENCE = "c"


@dataclass(frozen=True)
class SystemStudy:
    """The result of a study."""

    description: Description
    seconds: float
    #: Errors of C in double, in its own sensors' counts
    double: Flight
    #: Differences of every other back end from C in double
    differences: Mapping[str, Flight]
    #: What the errors of the sensors add in double; None without errors
    sensors: Flight | None
    #: Memory and operations of the code of each back end in C
    needs: Mapping[str, Budget]

    @property
    def causes(self) -> dict[str, Flight]:
        """The errors by their cause."""
        causes = {"algorithm, in double": self.double}
        causes |= {f"word length, {name}": flight for name, flight in self.differences.items()}
        return causes if self.sensors is None else {**causes, "sensor errors, in double": self.sensors}


def study(
    description: Description,
    motion: VehicleMotion,
    seconds: Fraction,
    names: Iterable[str],
    settings: Settings | None = None,
    cpu: str = "",
    errors: InstrumentErrors | None = None,
    align: bool = False,
) -> SystemStudy:
    """Run a system on back ends along a motion over the earth.

    `description`: its inputs are increments or counts of gyros and accelerometers in body axes. An input of counts
    takes those of the unit that the stage has to which it is wired; where a stage compensates the errors of a
    measurement unit, the sensors have these errors. `align`: with errors the system begins with the vertical that its
    sensors measure.
    """
    needs: dict[str, Budget] = {}

    def run(name: str, along: Motion = motion) -> Flight:
        fixed = backends.BACKENDS[name].fixed
        runner = system_runner(description, name, settings if fixed else None)
        if isinstance(runner, CompiledSystem):
            needs[name] = measured_budget(runner.fit, cpu) if cpu and fixed else budget(runner.fit)
        return fly(runner, along, seconds, align=align)

    double = run(REFERENCE)
    differences = {name: run(name).less(double) for name in dict.fromkeys(names) if name != REFERENCE}
    sensors = None if errors is None else run(REFERENCE, measured(motion, errors)).less(double)
    return SystemStudy(description, float(seconds), double, differences, sensors, needs)


_ARCSEC = math.degrees(1) * 3600
_SPEC = ".3g"
#: What the papers print, AGARD LS-133.
_PRINTED = (
    "printed in 1984: LTR-81 had a Z-8002 with 40,960 bytes of program and 6,144 of scratch for its whole task, and "
    "the M6800 of the gyro module of LCIGS, with 1,433 bytes of program and 143 of memory, was busy 85 % of the time"
)


@dataclass(frozen=True)
class DifferenceRow:
    """Differences of a back end from double, largest and at the end."""

    backend: str = field(metadata=entry("back end", align="<"))
    attitude_arcsec: float = field(metadata=entry("largest", _SPEC, group="attitude, arcsec"))
    attitude_end_arcsec: float = field(metadata=entry("at the end", _SPEC, group="attitude, arcsec"))
    velocity_m_s: float = field(metadata=entry("largest", _SPEC, group="velocity, m/s"))
    velocity_end_m_s: float = field(metadata=entry("at the end", _SPEC, group="velocity, m/s", unit="m/s"))
    position_m: float = field(metadata=entry("largest", _SPEC, group="position, m"))
    position_end_m: float = field(metadata=entry("at the end", _SPEC, group="position, m"))

    @staticmethod
    def of(backend: str, flight: Flight) -> DifferenceRow:
        """Return the largest difference of each kind, and that at the end."""
        row = [value for part in flight.sizes for value in (float(part.max()), float(part[-1]))]
        return DifferenceRow(backend, row[0] * _ARCSEC, row[1] * _ARCSEC, *row[2:])


@dataclass(frozen=True)
class CauseRow:
    """Errors of attitude, velocity and position by a cause, largest and at the end."""

    cause: str = field(metadata=entry("cause", align="<"))
    attitude_error_deg: float = field(metadata=entry("largest", _SPEC, group="attitude, deg"))
    attitude_error_end_deg: float = field(metadata=entry("at the end", _SPEC, group="attitude, deg"))
    velocity_error_m_s: float = field(metadata=entry("largest", _SPEC, group="velocity, m/s"))
    velocity_error_end_m_s: float = field(
        metadata=entry("at the end", _SPEC, group="velocity, m/s", unit="m/s")
    )
    position_error_m: float = field(metadata=entry("largest", _SPEC, group="position, m"))
    position_error_end_m: float = field(metadata=entry("at the end", _SPEC, group="position, m"))

    @staticmethod
    def of(cause: str, flight: Flight) -> CauseRow:
        """Return the row of a cause."""
        row = [value for part in flight.sizes for value in (float(part.max()), float(part[-1]))]
        return CauseRow(cause, math.degrees(row[0]), math.degrees(row[1]), *row[2:])


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
    drawn_by: ClassVar[str] = f"{__name__}:study_image"

    study: SystemStudy = field(metadata=INTERNAL)
    system: str
    sample_hz: float
    seconds: float
    motion: str
    #: Attitude of C in double from the true one
    double_from_truth_arcsec: AttitudeError
    by_cause: list[CauseRow]
    needs: list[ResourceRow]
    from_double: list[DifferenceRow]

    @staticmethod
    def of(study: SystemStudy, motion: str) -> SystemStudyResult:
        """Return the result of a study."""
        truth, system = study.double.sizes[0] * _ARCSEC, study.description.system
        return SystemStudyResult(
            study=study,
            system=system.name,
            sample_hz=float(system.sample_hz),
            seconds=study.seconds,
            motion=motion,
            double_from_truth_arcsec=AttitudeError(float(truth.max()), float(truth[-1])),
            by_cause=[CauseRow.of(*pair) for pair in study.causes.items()],
            needs=[ResourceRow.of(name, budget) for name, budget in study.needs.items()],
            from_double=[DifferenceRow.of(*pair) for pair in study.differences.items()],
        )

    def text(self) -> str:
        """Return differences, memory and load."""
        return "\n".join(_lines(self))


def _lines(result: SystemStudyResult) -> Iterator[str]:
    study = result.study
    system = study.description.system
    yield f"{system.title}: {study.seconds:g} s at {float(system.sample_hz):g} Hz, {result.motion}"
    yield from [
        "",
        "errors by cause, in one closed run",
        "",
        *reader_table(result.by_cause, CauseRow).lines(),
    ]
    yield from ["", *_load(result.needs).lines(), "", *fill(_PRINTED, "", 100).splitlines()]


def study_image(result: SystemStudyResult, path: str | Path) -> bytes:
    """Return the errors by cause against time, beside the map of the track."""
    title = f"{result.system}: {result.motion}"
    return figures.image(flight_figure(result.study.causes, title), path)


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
