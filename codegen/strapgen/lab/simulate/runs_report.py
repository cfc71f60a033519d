"""Reports runs and recordings in every format."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from strapgen.lab.recordings.recording import History
from strapgen.lab.simulate.runs import Run
from strapgen.results.report import Report
from strapgen.results.table import Column, TextTable

if TYPE_CHECKING:
    from strapgen.catalogue import Choice
    from strapgen.ir.signals import Signal
    from strapgen.run.backends import Backend

AXES = ("x", "y", "z")
ANGLES = ("roll", "pitch", "heading")
#: The planes of skew about the axes x, y, z, as the thesis names them.
SKEW_PLANES = ("y-z", "z-x", "x-y")
_PLACES = [f"{row}{column}" for row in "123" for column in "123"]
_MOST_ROWS = 36
#: Digits of the numbers in Markdown.
_DIGITS = ".9g"
#: Parts of an error matrix, and the unit in the names of their columns.
_PARTS = (("scale", ""), ("skew", "_deg"), ("drift", "_deg"))


def _three(group: str, names: Sequence[str], spec: str) -> list[Column]:
    """Return three columns of numbers close together, under one title."""
    return [Column(name, spec=spec, least=12, gap=1 if k else 2, group=group) for k, name in enumerate(names)]


_ERROR_COLUMNS = (
    Column("s", spec=".3f", least=9, group="time"),
    *_three("scale", AXES, ".4e"),
    *_three("skew, deg", SKEW_PLANES, ".4e"),
    *_three("drift, deg", AXES, ".4e"),
)
_MATRIX_TITLES = [
    Column(title, "<", least=38) for title in ("computed C", "true C", "computed - true", "error matrix E")
]
_MATRIX_COLUMNS = [
    column for spec in (".9f", ".9f", ".4e", ".4e") for column in _three("", ("", "", ""), spec)
]
TIME_COLUMN = Column("time, s", spec=".4f", least=10)


def step_facts(backend: Backend, choice: Choice) -> dict[str, Any]:
    """Return what a result states of the step that ran."""
    facts: dict[str, Any] = {"algorithm": choice.name, "method": choice.method_name}
    facts |= {"rates_at": list(backend.nodes)} if backend.nodes else {"increments": backend.increments}
    if backend.previous:
        facts["previous"] = backend.previous
    if backend.ahead:
        facts["ahead"] = backend.ahead
    return facts | {"backend": backend.name}


def run_data(run: Run, settings: dict[str, Any]) -> dict[str, Any]:
    """Return a run as plain JSON data after the settings that it was made with."""
    return settings | {
        "time_s": run.time.tolist(),
        "scale": run.scale.tolist(),
        "skew_deg": np.degrees(run.skew).tolist(),
        "drift_deg": np.degrees(run.drift).tolist(),
        "mean_drift_deg": float(np.degrees(run.mean_drift)),
    }


@dataclass(frozen=True)
class RunLayout:
    """How a run is reported."""

    #: The motion with its parameters in words, for the text
    motion: str
    title: str | None = None
    #: Whether all matrices follow in JSON
    matrices: bool = False
    #: Records from one print of the matrices to the next in the text; by default those at the end are printed
    every: int | None = None


def run_report(run: Run, settings: dict[str, Any], layout: RunLayout) -> Report:
    """Return a run as a report."""

    def text() -> str:
        lines = [] if layout.title is None else [layout.title, ""]
        return "\n".join([*lines, run_text(run, settings | {"motion": layout.motion}, layout.every)])

    def data() -> dict[str, Any]:
        title = {} if layout.title is None else {"title": layout.title}
        return title | run_data(run, settings) | (matrices_data(run) if layout.matrices else {})

    def markdown() -> TextTable:
        return TextTable(_ERROR_COLUMNS, _error_rows(run, range(len(run.time))))

    return Report(text, data, lambda: run_table(run), markdown, indented=False)


def matrices_data(run: Run) -> dict[str, Any]:
    """Return the matrices of a run as plain JSON data."""
    return {
        "computed": run.computed.tolist(),
        "true": run.true.tolist(),
        "difference": (run.computed - run.true).tolist(),
        "error": run.error.tolist(),
    }


def run_table(run: Run) -> TextTable:
    """Return a run as a table: the nine errors and all matrices at each record."""
    header = ["time_s"]
    header += [f"{kind}_{axis}{unit}" for kind, unit in _PARTS for axis in AXES]
    header += [
        f"{matrix}_{place}" for matrix in ("computed", "true", "difference", "error") for place in _PLACES
    ]
    flat = [m.reshape(-1, 9) for m in (run.computed, run.true, run.computed - run.true, run.error)]
    columns = [run.time[:, None], run.scale, np.degrees(run.skew), np.degrees(run.drift), *flat]
    return table_of(header, np.hstack(columns).tolist())


def largest_table(run: Run) -> TextTable:
    """Return the largest errors of a run by axis, for a reader."""
    parts = (("scale", AXES, run.scale), ("skew, deg", SKEW_PLANES, np.degrees(run.skew)))
    rows = [
        (f"{kind} {name}", float(np.abs(values[:, k]).max()), float(values[-1, k]))
        for kind, names, values in (*parts, ("drift, deg", AXES, np.degrees(run.drift)))
        for k, name in enumerate(names)
    ]
    columns = (Column("error", "<"), Column("largest", spec=".4g"), Column("at the end", spec=".4g"))
    return TextTable(columns, rows)


def history_elements(history: History) -> tuple[str, ...]:
    """Return the names of the elements of a history's states; numbers where it has no names."""
    return history.elements or tuple(
        f"state_{k}" for k in range(1, 1 + int(np.prod(history.states.shape[1:])))
    )


def run_text(run: Run, settings: dict[str, Any], every: int | None = None) -> str:
    """Return a run as a report: the nine errors in time, the matrices at the end or every so often, the mean drift."""
    shown = thinned(len(run.time))
    lines = [
        settings_text(settings),
        "",
        *TextTable(_ERROR_COLUMNS, _error_rows(run, shown)).lines(),
    ]
    if len(shown) < len(run.time):
        lines.append(
            f"({len(shown)} of {len(run.time)} records; --format csv prints all, --record S thins them)"
        )
    largest = ", ".join(
        f"{axis} {value:.6g}" for axis, value in zip(AXES, np.degrees(run.drift_by_axis), strict=True)
    )
    return "\n".join(
        [
            *lines,
            "",
            *(line for record in _printed(run, every) for line in _matrix_lines(run, record)),
            f"largest drift, deg: {largest}",
            f"mean drift, deg: {np.degrees(run.mean_drift):.6g}",
        ]
    )


def _error_rows(run: Run, records: Iterable[int]) -> list[tuple[float, ...]]:
    """Return the time and the nine errors of some records."""
    parts = np.hstack([run.scale, np.degrees(run.skew), np.degrees(run.drift)])
    return [(run.time[k], *parts[k]) for k in records]


def _printed(run: Run, every: int | None) -> list[int]:
    """Return the records whose matrices are printed, the last one among them."""
    last = len(run.time) - 1
    return [last] if every is None else sorted({*range(0, len(run.time), every), last})


def _matrix_lines(run: Run, record: int) -> list[str]:
    """Return the matrices at a record of a run side by side, and an empty line."""
    computed, true = run.computed[record], run.true[record]
    rows = np.hstack([computed, true, computed - true, run.error[record]])
    table = TextTable(_MATRIX_TITLES, []).lines() + TextTable(_MATRIX_COLUMNS, rows.tolist()).lines()
    return [f"at {run.time[record]:g} s", *table, ""]


def settings_text(settings: dict[str, Any]) -> str:
    """Return settings that have values as text."""
    return ", ".join(f"{key} {value}" for key, value in settings.items() if value is not None)


def history_table(history: History, elements: Sequence[str]) -> TextTable:
    """Return an attitude history as a table."""
    rows = np.column_stack([history.time, history.states.reshape(len(history.time), -1)]).tolist()
    return table_of(["time_s", *elements], rows)


def history_report(history: History, elements: Sequence[str], settings: dict[str, Any]) -> Report:
    """Return an attitude history as a report."""
    return Report(
        lambda: history_text(history, elements, settings),
        lambda: history_data(history, elements, settings),
        lambda: history_table(history, elements),
        indented=False,
    )


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
    shown = thinned(len(history.time))
    states = history.states.reshape(len(history.time), -1)
    columns = [TIME_COLUMN, *(Column(element, spec=".9f", least=12, gap=1) for element in elements)]
    rows = [(history.time[k], *states[k]) for k in shown]
    lines = [settings_text(settings), "", *TextTable(columns, rows).lines()]
    if len(shown) < len(history.time):
        lines.append(f"({len(shown)} of {len(history.time)} records; --format csv prints all)")
    if history.unused:
        lines.append(f"{history.unused} increments at the end make no whole step and were not used")
    return "\n".join(lines)


def places(signal: Signal) -> list[str]:
    """Return short names of the elements of a signal."""
    if signal.shape == (3, 3):
        return list(_PLACES)
    return [element.rpartition("_")[2] for element in signal.elements]


def thinned(count: int) -> list[int]:
    """Return at most so many record numbers, evenly spread, with the first and the last."""
    if count <= _MOST_ROWS + 1:
        return list(range(count))
    return sorted({round(k * (count - 1) / _MOST_ROWS) for k in range(_MOST_ROWS + 1)})


def table_of(names: Iterable[str], rows: Sequence[Sequence[float]]) -> TextTable:
    """Return rows of numbers under names as a table."""
    return TextTable([Column(name, spec=_DIGITS) for name in names], rows)
