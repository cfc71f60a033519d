"""Reports and draws the loops of an attitude and heading reference through their schedule."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from strapgen.navigation.loops.loop_schedule import LoopMode, LoopSchedule
from strapgen.navigation.loops.loops_study import UNITS, LoopCourse, LoopDesign, LoopErrors, factors
from strapgen.results import figures
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable

_GAIN, _STATE = ".9g", ".7g"
_KEYS = ("loop", "mode", "time_s", "case", "quantity", "unit", "run", "matrix_exponential", "difference")


@dataclass(frozen=True)
class LoopStudy:
    """A schedule, the gains of its modes, and the courses of its loops."""

    schedule: LoopSchedule
    #: Those that were run
    modes: tuple[LoopMode, ...]
    errors: LoopErrors
    designs: Sequence[LoopDesign]
    courses: Sequence[LoopCourse]

    def rows(self) -> Iterator[tuple[Any, ...]]:
        """Yield every state of every case at the end of every mode, in the order of the columns."""
        for course in self.courses:
            run, exact = (array * factors(course.loop) for array in (course.run, course.exact))
            for mode, end in zip(self.modes, course.ends, strict=True):
                for k, case in enumerate(course.cases):
                    for number, (quantity, (unit, _)) in enumerate(UNITS[course.loop].items()):
                        one, other = float(run[end, k, number]), float(exact[end, k, number])
                        time = float(course.times[end])
                        yield course.loop, mode.name, time, case, quantity, unit, one, other, one - other


def loops_report(study: LoopStudy) -> Report:
    """Return the study as a report."""
    return Report(
        lambda: "\n".join(_lines(study)) + "\n",
        lambda: _data(study),
        lambda: TextTable([Column(key, spec=".9g") for key in _KEYS], list(study.rows())),
    )


def _lines(study: LoopStudy) -> Iterator[str]:
    schedule = study.schedule
    yield f"{schedule.title or 'schedule'}: cycle {float(schedule.cycle_s):g} s"
    yield ""
    yield from _gains(study).lines()
    for course in study.courses:
        yield ""
        yield f"{course.loop} loop at the end of each mode: by the kernel, and by the matrix exponential"
        yield ""
        yield from _states(study, course).lines()


def _gains(study: LoopStudy) -> TextTable:
    """Return the gains of all modes."""
    columns = [Column(name, "<") for name in ("mode", "loop", "reference")]
    columns += [Column("tau, s", spec="g"), Column("slowest pole, s", spec=".6g")]
    columns += [Column(name, spec=_GAIN) for name in ("k1", "k2", "k3")]
    rows = []
    for design in study.designs:
        tau = design.setting.time_constant_s
        values = [float(value) for value in design.gains] if tau is not None else []
        gains: list[float | None] = [*values, *[None] * (3 - len(values))]
        head = (design.mode, design.loop, design.setting.reference)
        rows.append([*head, None if tau is None else float(tau), design.slowest_s, *gains])
    return TextTable(columns, rows)


def _states(study: LoopStudy, course: LoopCourse) -> TextTable:
    """Return the states of a loop, a line for each mode and case."""
    columns = [Column("mode", "<"), Column("time, s", spec="g"), Column("case", "<")]
    for quantity, (unit, _) in UNITS[course.loop].items():
        columns += [
            Column(header, spec=_STATE, group=f"{quantity}, {unit}") for header in ("kernel", "exponential")
        ]
    run, exact = (array * factors(course.loop) for array in (course.run, course.exact))
    rows = []
    for mode, end in zip(study.modes, course.ends, strict=True):
        for k, case in enumerate(course.cases):
            states = [float(value) for pair in zip(run[end, k], exact[end, k], strict=True) for value in pair]
            rows.append([mode.name, float(course.times[end]), case, *states])
    return TextTable(columns, rows)


def _data(study: LoopStudy) -> dict[str, Any]:
    return {
        "title": study.schedule.title,
        "cycle_s": float(study.schedule.cycle_s),
        "errors": asdict(study.errors),
        "gains": [
            {
                "mode": design.mode,
                "loop": design.loop,
                "reference": design.setting.reference,
                "tau_s": _float(design.setting.time_constant_s),
                "slowest_pole_s": design.slowest_s,
                "gains": [float(value) for value in design.gains],
                "exact": [str(value) for value in design.gains],
            }
            for design in study.designs
        ],
        "rows": [dict(zip(_KEYS, row, strict=True)) for row in study.rows()],
    }


def _float(value: Any) -> float | None:
    """Return a number, or None for none."""
    return None if value is None else float(value)


def loops_image(study: LoopStudy, path: str | Path) -> bytes:
    """Return the courses of the loops over time: the kernel as a line, the matrix exponential dashed."""
    figure, grid = figures.grid_of_axes(len(study.courses), 2, (11.0, 2.9 * len(study.courses)))
    for row, course in zip(grid, study.courses, strict=True):
        quantities = list(UNITS[course.loop].items())
        which = [number for number, (name, _) in enumerate(quantities) if name not in ("velocity", "climb")]
        for axes, number in zip(row, which, strict=True):
            quantity, (unit, factor) = quantities[number]
            colours = figures.several_colours(len(course.cases))
            for k, (case, colour) in enumerate(zip(course.cases, colours, strict=True)):
                axes.plot(course.times, factor * course.run[:, k, number], color=colour, label=case)
                axes.plot(
                    course.times, factor * course.exact[:, k, number], "--", color="0.25", linewidth=0.8
                )
            for end in course.ends[:-1]:
                axes.axvline(course.times[end], color="0.75", linewidth=0.8, zorder=0)
            axes.set_ylabel(f"{quantity}, {unit}")
            axes.set_title(f"{course.loop} loop: {quantity}", loc="left", fontsize=10)
            figures.style(axes)
        row[0].legend(fontsize=8, frameon=False)
    for axes in grid[-1]:
        axes.set_xlabel("time, s")
    figures.title(figure, f"{study.schedule.title or 'schedule'}; dashed: matrix exponential")
    return figures.image(figure, path)
