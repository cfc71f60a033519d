"""The outputs of a described system along a course, as a result."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from strapgen.lab.runs import Array
from strapgen.lab.runs_report import (
    TIME_COLUMN,
    RunSettings,
    places,
    settings_text,
    table_of,
    thinned,
)
from strapgen.results.records import entry
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable

if TYPE_CHECKING:
    from strapgen.ir.signals import Signal
    from strapgen.navigation.systems.system_runs import SystemCourse


@dataclass(frozen=True)
class SystemRecords:
    """The outputs of a system along a recording."""

    #: Samples at the end that fill no cycle of all rates
    unused_samples: int
    time_s: Array
    #: Unit of each output
    units: dict[str, str]
    #: The outputs at each time
    outputs: dict[str, Array]

    @staticmethod
    def of(course: SystemCourse) -> SystemRecords:
        """Return the records of a course."""
        time, outputs = course.rows()
        return SystemRecords(
            course.unused, time, {name: signal.unit for name, signal in _signals(course).items()}, outputs
        )


def _signals(course: SystemCourse) -> dict[str, Signal]:
    return {name: course.system.cell(name).signal for name in course.rows()[1]}


@dataclass(frozen=True)
class SystemCourseResult(Result):
    """The outputs of a described system along an inertial recording."""

    indented = False

    settings: Mapping[str, Any] = field(metadata=entry(spread=True, kind=RunSettings))
    course: SystemCourse = field(metadata=entry(spread=True, write=SystemRecords.of, kind=SystemRecords))

    def rows(self) -> Any:
        """Return the records of the course, as their times."""
        return self.course.rows()[0]

    def table(self) -> TextTable:
        """Return the elements of all outputs at each time."""
        time, outputs = self.course.rows()
        names = [
            f"{name}_{element}" if signal.unit == "1" else f"{name}_{element}, {signal.unit}"
            for name, signal in _signals(self.course).items()
            for element in places(signal)
        ]
        values = np.column_stack([time, *(part.reshape(len(time), -1) for part in outputs.values())])
        return table_of(["time_s", *names], values.tolist())

    def text(self) -> str:
        """Return each output at most of the times that a reader looks at."""
        (time, outputs), signals = self.course.rows(), _signals(self.course)
        shown = thinned(len(time))
        lines = [settings_text({**self.settings})]
        for name, part in outputs.items():
            signal, flat = signals[name], part.reshape(len(time), -1)
            columns = [TIME_COLUMN, *(Column(p, spec=".9g", least=15, gap=1) for p in places(signal))]
            lines += ["", f"{name}, unit {signal.unit}{f', frame {signal.frame}' if signal.frame else ''}"]
            lines += TextTable(columns, np.column_stack([time, flat])[shown].tolist()).lines()
        if len(shown) < len(time):
            lines.append(f"({len(shown)} of {len(time)} rows; --format csv prints all)")
        if self.course.unused:
            lines.append(
                f"{self.course.unused} samples at the end fill no cycle of all rates and were not used"
            )
        return "\n".join(lines)
