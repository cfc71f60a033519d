"""Reports the outputs of a described system along a course."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from strapgen.lab.simulate.runs_report import TIME_COLUMN, places, settings_text, table_of, thinned
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable

if TYPE_CHECKING:
    from strapgen.navigation.systems.system_runs import SystemCourse


def system_course_report(course: SystemCourse, settings: dict[str, Any]) -> Report:
    """Return the outputs of a described system along a recording as a report."""
    time, rows = course.rows()
    units = {name: course.system.cell(name).signal for name in rows}
    names = [
        f"{name}_{element}" if signal.unit == "1" else f"{name}_{element}, {signal.unit}"
        for name, signal in units.items()
        for element in places(signal)
    ]
    values = np.column_stack([time, *(part.reshape(len(time), -1) for part in rows.values())])

    def table() -> TextTable:
        return table_of(["time_s", *names], values.tolist())

    def text() -> str:
        shown = thinned(len(time))
        lines = [settings_text(settings)]
        for name, part in rows.items():
            signal, flat = units[name], part.reshape(len(time), -1)
            columns = [TIME_COLUMN, *(Column(p, spec=".9g", least=15, gap=1) for p in places(signal))]
            lines += ["", f"{name}, unit {signal.unit}{f', frame {signal.frame}' if signal.frame else ''}"]
            lines += TextTable(columns, np.column_stack([time, flat])[shown].tolist()).lines()
        if len(shown) < len(time):
            lines.append(f"({len(shown)} of {len(time)} rows; --format csv prints all)")
        if course.unused:
            lines.append(f"{course.unused} samples at the end fill no cycle of all rates and were not used")
        return "\n".join(lines)

    def data() -> dict[str, Any]:
        outputs = {name: part.tolist() for name, part in rows.items()}
        return settings | {
            "unused_samples": course.unused,
            "time_s": time.tolist(),
            "units": {name: signal.unit for name, signal in units.items()},
            "outputs": outputs,
        }

    return Report(text, data, table, indented=False)
