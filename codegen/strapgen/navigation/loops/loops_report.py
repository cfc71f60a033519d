"""The loops of an attitude and heading reference through their schedule, as a result and drawn."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

from strapgen.navigation.loops.loop_schedule import LoopMode, LoopSchedule
from strapgen.navigation.loops.loops_study import UNITS, LoopCourse, LoopDesign, LoopErrors, factors
from strapgen.results import figures
from strapgen.results.records import INTERNAL, entry, properties
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable

_GAIN, _STATE = ".9g", ".7g"


@dataclass(frozen=True)
class LoopState:
    """A state of a case at the end of a mode."""

    loop: str
    mode: str
    time_s: float
    #: What disturbs the loop
    case: str
    quantity: str
    unit: str
    #: By the kernel
    run: float
    matrix_exponential: float
    #: The former less the latter
    difference: float


@dataclass(frozen=True)
class LoopGains:
    """The gains of a loop in a mode."""

    mode: str
    loop: str
    reference: str
    #: Time constant
    tau_s: float | None
    slowest_pole_s: float | None
    gains: list[float]
    #: The same exactly
    exact: tuple[Fraction, ...] = field(metadata=entry(kind=list[str]))

    @staticmethod
    def of(design: LoopDesign) -> LoopGains:
        """Return the gains of a design."""
        tau = design.setting.time_constant_s
        return LoopGains(
            mode=design.mode,
            loop=design.loop,
            reference=design.setting.reference,
            tau_s=None if tau is None else float(tau),
            slowest_pole_s=design.slowest_s,
            gains=[float(value) for value in design.gains],
            exact=tuple(design.gains),
        )


@dataclass(frozen=True)
class LoopsResult(Result):
    """The loops of an attitude and heading reference through their schedule."""

    rows_in = "states"
    computed = properties(title=entry(), cycle_s=entry(), gains=entry(), states=entry(key="rows"))
    drawn_by = f"{__name__}:loops_image"

    schedule: LoopSchedule = field(metadata=INTERNAL)
    #: Those that were run
    modes: tuple[LoopMode, ...] = field(metadata=INTERNAL)
    #: What disturbs the loops
    errors: LoopErrors
    designs: Sequence[LoopDesign] = field(metadata=INTERNAL)
    courses: Sequence[LoopCourse] = field(metadata=INTERNAL)

    @property
    def title(self) -> str:
        """Title of the schedule."""
        return self.schedule.title

    @property
    def cycle_s(self) -> float:
        """Time of a cycle."""
        return float(self.schedule.cycle_s)

    @property
    def gains(self) -> list[LoopGains]:
        """The gains of all modes."""
        return list(map(LoopGains.of, self.designs))

    @property
    def states(self) -> list[LoopState]:
        """Every state of every case at the end of every mode."""
        return list(self._states())

    def _states(self) -> Iterator[LoopState]:
        for course in self.courses:
            run, exact = (array * factors(course.loop) for array in (course.run, course.exact))
            for mode, end in zip(self.modes, course.ends, strict=True):
                for k, case in enumerate(course.cases):
                    for number, (quantity, (unit, _)) in enumerate(UNITS[course.loop].items()):
                        one, other = float(run[end, k, number]), float(exact[end, k, number])
                        facts = (course.loop, mode.name, float(course.times[end]), case, quantity, unit)
                        yield LoopState(*facts, one, other, one - other)

    def text(self) -> str:
        """Return the gains, and the states of each loop."""
        return "\n".join(_lines(self))


def _lines(study: LoopsResult) -> Iterator[str]:
    schedule = study.schedule
    yield f"{schedule.title or 'schedule'}: cycle {float(schedule.cycle_s):g} s"
    yield ""
    yield from _gains(study).lines()
    for course in study.courses:
        yield ""
        yield f"{course.loop} loop at the end of each mode: by the kernel, and by the matrix exponential"
        yield ""
        yield from _states(study, course).lines()


def _gains(study: LoopsResult) -> TextTable:
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


def _states(study: LoopsResult, course: LoopCourse) -> TextTable:
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


def loops_image(result: LoopsResult, path: str | Path) -> bytes:
    """Return the courses of the loops over time: the kernel as a line, the matrix exponential dashed."""
    figure, grid = figures.grid_of_axes(len(result.courses), 2, (11.0, 2.9 * len(result.courses)))
    for row, course in zip(grid, result.courses, strict=True):
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
    figures.title(figure, f"{result.schedule.title or 'schedule'}; dashed: matrix exponential")
    return figures.image(figure, path)
