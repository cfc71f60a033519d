"""Reports of runs and recordings: JSON data, comma-separated values, text."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from strapgen.simulation.recording import History
from strapgen.simulation.runs import Run

if TYPE_CHECKING:
    from strapgen.simulation.courses import Course

AXES = ("x", "y", "z")
ANGLES = ("roll", "pitch", "heading")
#: The planes of skew about the axes x, y, z, as the thesis names them.
SKEW_PLANES = ("y-z", "z-x", "x-y")
_PLACES = [f"{row}{column}" for row in "123" for column in "123"]
_MOST_ROWS = 36


def run_data(run: Run, settings: dict[str, Any]) -> dict[str, Any]:
    """Return a run as plain JSON data after the settings that it was made with."""
    return settings | {
        "time_s": run.time.tolist(),
        "scale": run.scale.tolist(),
        "skew_deg": np.degrees(run.skew).tolist(),
        "drift_deg": np.degrees(run.drift).tolist(),
        "mean_drift_deg": float(np.degrees(run.mean_drift)),
    }


def matrices_data(run: Run) -> dict[str, Any]:
    """Return the matrices of a run as plain JSON data."""
    return {
        "computed": run.computed.tolist(),
        "true": run.true.tolist(),
        "difference": (run.computed - run.true).tolist(),
        "error": run.error.tolist(),
    }


def run_csv(run: Run) -> str:
    """Return a run as comma-separated values: the nine errors and all matrices at each record."""
    header = ["time_s"]
    header += [f"{kind}_{axis}{unit}" for kind, unit in _PARTS for axis in AXES]
    header += [
        f"{matrix}_{place}" for matrix in ("computed", "true", "difference", "error") for place in _PLACES
    ]
    flat = [m.reshape(-1, 9) for m in (run.computed, run.true, run.computed - run.true, run.error)]
    columns = [run.time[:, None], run.scale, np.degrees(run.skew), np.degrees(run.drift), *flat]
    return _csv(header, np.hstack(columns).tolist())


_PARTS = (("scale", ""), ("skew", "_deg"), ("drift", "_deg"))


def run_text(run: Run, settings: dict[str, Any]) -> str:
    """Return a run as a report: the nine errors in time, the matrices at the end, the mean drift."""
    words = ", ".join(f"{key} {value}" for key, value in settings.items() if value is not None)
    lines = [words, ""]
    lines.append(f"{'time':>9}  {'scale':^38}  {'skew, deg':^38}  {'drift, deg':^38}")
    names = [f"{name:>12}" for name in (*AXES, *SKEW_PLANES, *AXES)]
    lines.append(f"{'s':>9}  {' '.join(names[:3])}  {' '.join(names[3:6])}  {' '.join(names[6:])}")
    shown = _thinned(len(run.time))
    for k in shown:
        parts = (run.scale[k], np.degrees(run.skew[k]), np.degrees(run.drift[k]))
        cells = "  ".join(" ".join(f"{value:12.4e}" for value in part) for part in parts)
        lines.append(f"{run.time[k]:9.3f}  {cells}")
    if len(shown) < len(run.time):
        lines.append(
            f"({len(shown)} of {len(run.time)} records; --format csv prints all, --record S thins them)"
        )
    lines += ["", f"at {run.time[-1]:g} s"]
    titles = ("computed C", "true C", "computed - true", "error matrix E")
    lines.append("  ".join(f"{title:<38}" for title in titles).rstrip())
    matrices = (run.computed[-1], run.true[-1], run.computed[-1] - run.true[-1], run.error[-1])
    for row in range(3):
        cells = "  ".join(" ".join(_cell(v, k > 1) for v in m[row]) for k, m in enumerate(matrices))
        lines.append(cells)
    largest = ", ".join(
        f"{axis} {value:.6g}" for axis, value in zip(AXES, np.degrees(run.drift_by_axis), strict=True)
    )
    lines += ["", f"largest drift, deg: {largest}", f"mean drift, deg: {np.degrees(run.mean_drift):.6g}"]
    return "\n".join(lines)


def _cell(value: float, small: bool) -> str:
    return f"{value:12.4e}" if small else f"{value:12.9f}"


def history_csv(history: History, elements: Sequence[str]) -> str:
    """Return an attitude history as comma-separated values."""
    rows = np.column_stack([history.time, history.states.reshape(len(history.time), -1)]).tolist()
    return _csv(["time_s", *elements], rows)


def history_data(history: History, elements: Sequence[str], settings: dict[str, Any]) -> dict[str, Any]:
    """Return an attitude history as plain JSON data after the settings that it was made with."""
    return settings | {
        "step_s": history.step,
        "duration_s": float(history.time[-1] - history.time[0]),
        "unused_increments": history.unused,
        "elements": list(elements),
        "time_s": history.time.tolist(),
        "attitude": history.states.reshape(len(history.time), -1).tolist(),
    }


def history_text(history: History, elements: Sequence[str], settings: dict[str, Any]) -> str:
    """Return an attitude history as a report."""
    lines = [", ".join(f"{key} {value}" for key, value in settings.items() if value is not None)]
    lines += ["", f"{'time, s':>10} " + " ".join(f"{element:>12}" for element in elements)]
    shown = _thinned(len(history.time))
    states = history.states.reshape(len(history.time), -1)
    for k in shown:
        lines.append(f"{history.time[k]:10.4f} " + " ".join(f"{value:12.9f}" for value in states[k]))
    if len(shown) < len(history.time):
        lines.append(f"({len(shown)} of {len(history.time)} records; --format csv prints all)")
    if history.unused:
        lines.append(f"{history.unused} increments at the end make no whole step and were not used")
    return "\n".join(lines)


def course_csv(course: Course) -> str:
    """Return attitude and velocity along a recording as comma-separated values."""
    count = len(course.time)
    columns = (
        course.time,
        course.states.reshape(count, -1),
        np.degrees(course.angles),
        course.velocity_changes,
    )
    header = [
        "time_s",
        *course.elements,
        *(f"{name}_deg" for name in ANGLES),
        *(f"dv{axis}_m_s" for axis in AXES),
    ]
    return _csv(header, np.column_stack(columns).tolist())


def course_data(course: Course, settings: dict[str, Any]) -> dict[str, Any]:
    """Return attitude and velocity along a recording as plain JSON data after the settings."""
    return settings | {
        "unused_increments": course.unused,
        "elements": list(course.elements),
        "time_s": course.time.tolist(),
        "attitude": course.states.reshape(len(course.time), -1).tolist(),
        **{
            f"{name}_deg": np.degrees(column).tolist()
            for name, column in zip(ANGLES, course.angles.T, strict=True)
        },
        "velocity_changes_m_s": course.velocity_changes.tolist(),
    }


def course_text(course: Course, settings: dict[str, Any]) -> str:
    """Return attitude and velocity along a recording as a report."""
    lines = [", ".join(f"{key} {value}" for key, value in settings.items())]
    titles = [*(f"{name}, deg" for name in ANGLES), *(f"dv{axis}, m/s" for axis in AXES)]
    lines += ["", f"{'time, s':>10} " + " ".join(f"{title:>13}" for title in titles)]
    shown = _thinned(len(course.time))
    rows = np.column_stack([np.degrees(course.angles), course.velocity_changes])
    for k in shown:
        lines.append(f"{course.time[k]:10.4f} " + " ".join(f"{value:13.8f}" for value in rows[k]))
    if len(shown) < len(course.time):
        lines.append(f"({len(shown)} of {len(course.time)} cycles; --format csv prints all)")
    if course.unused:
        lines.append(
            f"{course.unused} increments at the end make no whole navigation cycle and were not used"
        )
    return "\n".join(lines)


def _thinned(count: int) -> list[int]:
    """Return at most so many record numbers, evenly spread, with the first and the last."""
    if count <= _MOST_ROWS + 1:
        return list(range(count))
    return sorted({round(k * (count - 1) / _MOST_ROWS) for k in range(_MOST_ROWS + 1)})


def _csv(header: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue()
