"""Reports what a described system navigates on several back ends."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from strapgen.navigation.systems.budget import Budget
from strapgen.navigation.systems.system_study import NavigationErrors, SystemStudy
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable
from strapgen.targets.lines import fill

_ARCSEC = math.degrees(1) * 3600
_SPEC = ".3g"
#: What the papers print, AGARD LS-133.
_PRINTED = (
    "printed in 1984: LTR-81 had a Z-8002 with 40,960 bytes of program and 6,144 of scratch for its whole task, and "
    "the M6800 of the gyro module of LCIGS, with 1,433 bytes of program and 143 of memory, was busy 85 % of the time"
)
_HEADERS = (
    ("attitude_arcsec", "largest", "attitude, arcsec"),
    ("attitude_end_arcsec", "at the end", "attitude, arcsec"),
    ("velocity_m_s", "largest", "velocity, m/s"),
    ("velocity_end_m_s", "at the end", "velocity, m/s"),
    ("position_m", "largest", "position, m"),
    ("position_end_m", "at the end", "position, m"),
)


def system_study_report(study: SystemStudy) -> Report:
    """Return the study as a report."""
    return Report(lambda: "\n".join(_lines(study)) + "\n", lambda: _data(study), lambda: _table(study, False))


def _row(errors: NavigationErrors) -> dict[str, float | None]:
    """Return the largest difference of each kind, and that at the end."""
    row: dict[str, float | None] = {}
    for (largest, last), values, scale in (
        (("attitude_arcsec", "attitude_end_arcsec"), errors.attitude, _ARCSEC),
        (("velocity_m_s", "velocity_end_m_s"), errors.velocity, 1.0),
        (("position_m", "position_end_m"), errors.position, 1.0),
    ):
        row[largest] = float(values.max()) * scale if values.size else None
        row[last] = float(values[-1]) * scale if values.size else None
    return row


def _data(study: SystemStudy) -> dict[str, Any]:
    truth = study.against_truth * _ARCSEC
    return {
        "system": study.description.system.name,
        "sample_hz": float(study.description.system.sample_hz),
        "seconds": study.seconds,
        "double_from_truth_arcsec": {"largest": float(truth.max()), "end": float(truth[-1])}
        if truth.size
        else None,
        "needs": [{"backend": name, **_need(budget)} for name, budget in study.needs.items()],
        "from_double": [{"backend": errors.backend, **_row(errors)} for errors in study.errors],
    }


def _need(needs: Budget) -> dict[str, float | str | None]:
    """Return memory, code and load of a back end in C."""
    sizes = [stage.code_bytes for rate in needs.rates for stage in rate.stages]
    executed = needs.executed_per_second
    return {
        "memory_bytes": needs.memory_bytes,
        "constant_bytes": needs.constant_bytes,
        "operations_per_s": float(needs.per_second),
        "cpu": needs.cpu or None,
        "code_bytes": None if None in sizes else sum(filter(None, sizes)),
        "instructions_per_s": None if executed is None else float(executed),
    }


def _table(study: SystemStudy, grouped: bool = True) -> TextTable:
    columns = [Column("back end" if grouped else "backend", "<")]
    columns += [
        Column(word, spec=_SPEC, group=group) if grouped else Column(key) for key, word, group in _HEADERS
    ]
    return TextTable(columns, [[errors.backend, *_row(errors).values()] for errors in study.errors])


def _lines(study: SystemStudy) -> Iterator[str]:
    system = study.description.system
    yield f"{system.title}: {study.seconds:g} s at {float(system.sample_hz):g} Hz"
    if study.against_truth.size:
        truth = study.against_truth * _ARCSEC
        yield (
            f"attitude in double: {truth.max():{_SPEC}} arcsec from the truth at most, {truth[-1]:{_SPEC}} at the end"
        )
    if study.errors:
        yield from ["", "differences from double, in one closed run", "", *_table(study).lines()]
    yield from ["", *_load(study).lines(), "", *fill(_PRINTED, "", 100).splitlines()]


def _load(study: SystemStudy) -> TextTable:
    """Return memory, code and load of each back end in C."""
    cpu = next((needs.cpu for needs in study.needs.values() if needs.cpu), "")
    columns = [Column("back end", "<"), Column("state, bytes"), Column("constants, bytes")]
    columns += [Column("operations/s", spec=",.0f")]
    columns += [Column(f"code on {cpu}, bytes"), Column("instructions/s", spec=",.0f")] if cpu else []
    rows = []
    for name, needs in study.needs.items():
        row = _need(needs)
        measured = [row["code_bytes"], row["instructions_per_s"]] if cpu else []
        rows.append([name, row["memory_bytes"], row["constant_bytes"], row["operations_per_s"], *measured])
    return TextTable(columns, rows)
