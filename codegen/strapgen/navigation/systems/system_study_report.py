"""What a described system navigates on several back ends, as a result."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from strapgen.navigation.systems.budget import Budget
from strapgen.navigation.systems.system_study import NavigationErrors, SystemStudy
from strapgen.results.records import INTERNAL, entry, reader_table
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable
from strapgen.targets.printer import fill

_ARCSEC = math.degrees(1) * 3600
_SPEC = ".3g"
#: What the papers print, AGARD LS-133.
_PRINTED = (
    "printed in 1984: LTR-81 had a Z-8002 with 40,960 bytes of program and 6,144 of scratch for its whole task, and "
    "the M6800 of the gyro module of LCIGS, with 1,433 bytes of program and 143 of memory, was busy 85 % of the time"
)


@dataclass(frozen=True)
class DifferenceRow:
    """How far a back end has gone from double: at most, and at the end; None where there is no such output."""

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
class NeedsRow:
    """Memory, code and load of a back end in C; None where no processor was named."""

    backend: str
    memory_bytes: int
    constant_bytes: int
    operations_per_s: float
    cpu: str | None
    code_bytes: int | None
    instructions_per_s: float | None

    @staticmethod
    def of(backend: str, needs: Budget) -> NeedsRow:
        """Return what a back end needs."""
        sizes = [stage.code_bytes for rate in needs.rates for stage in rate.stages]
        executed = needs.executed_per_second
        return NeedsRow(
            backend,
            needs.memory_bytes,
            needs.constant_bytes,
            float(needs.per_second),
            needs.cpu or None,
            None if None in sizes else sum(filter(None, sizes)),
            None if executed is None else float(executed),
        )


class FromTruth(NamedTuple):
    """Angle between the attitude and the true one in arcsec, at most and at the end."""

    largest: float
    end: float


@dataclass(frozen=True)
class SystemStudyResult(Result):
    """What a described system navigates on several back ends."""

    rows_in = "from_double"

    study: SystemStudy = field(metadata=INTERNAL)
    system: str
    sample_hz: float
    seconds: float
    #: Attitude of C in double from the true one; None without an attitude
    double_from_truth_arcsec: FromTruth | None
    needs: list[NeedsRow]
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
            double_from_truth_arcsec=FromTruth(float(truth.max()), float(truth[-1])) if truth.size else None,
            needs=[NeedsRow.of(name, budget) for name, budget in study.needs.items()],
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


def _load(needs: Sequence[NeedsRow]) -> TextTable:
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
