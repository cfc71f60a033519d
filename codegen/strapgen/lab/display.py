"""How the objects of the lab show themselves: in a notebook, as data frames, as plots."""

from __future__ import annotations

import base64
import math
from typing import Any

import numpy as np

from strapgen.ir.exceptions import MissingExtraError
from strapgen.lab import comparison_report, convergence_report, runs_report
from strapgen.lab.comparison import Comparisons
from strapgen.lab.convergence import Convergence
from strapgen.lab.recordings.recording import History
from strapgen.lab.recordings.true_attitude import AttitudeError
from strapgen.lab.runs import Run
from strapgen.lab.runs_report import AXES, SKEW_PLANES
from strapgen.results import figures
from strapgen.results.display.frames import MATRIX, VECTOR, Variables, table, variables
from strapgen.results.display.objects import figure, html
from strapgen.results.records import keyed_table
from strapgen.results.table import TextTable


@html.register
def _(run: Run) -> str | None:
    table = runs_report.largest_table(run).as_html(f"mean drift {math.degrees(run.mean_drift):.3g} deg")
    try:
        content = figures.image(runs_report.run_figure(run, ""), "run.png")
    except MissingExtraError:
        return table
    picture = base64.b64encode(content).decode()
    return (
        f'{table}\n<img alt="errors of the run" style="max-width:100%" src="data:image/png;base64,{picture}">'
    )


@html.register
def _(rows: Comparisons) -> str | None:
    return comparison_report.comparison_table(rows).as_html()


@html.register
def _(ladder: Convergence) -> str | None:
    return convergence_report.ladder_table(ladder).as_html(f"{ladder.kernel} on {ladder.backend}")


@table.register
def _(run: Run) -> TextTable:
    return runs_report.run_table(run)


@table.register
def _(history: History) -> TextTable:
    return runs_report.history_table(history)


@table.register
def _(error: AttitudeError) -> TextTable:
    return runs_report.table_of(
        ["time_s", "error_deg", *(f"error_{axis}_deg" for axis in AXES)],
        np.degrees(np.column_stack([np.radians(error.time), error.angle, error.vector])).tolist(),
    )


@table.register
def _(rows: Comparisons) -> TextTable:
    return keyed_table(rows)


@table.register
def _(ladder: Convergence) -> TextTable:
    return convergence_report.ladder_table(ladder)


@variables.register
def _(run: Run) -> tuple[Variables, dict[str, Any]]:
    arrays: Variables = {
        "scale": (VECTOR, run.scale, "1"),
        "skew_deg": (("time_s", "plane"), np.degrees(run.skew), "deg"),
        "drift_deg": (VECTOR, np.degrees(run.drift), "deg"),
        "computed": (MATRIX, run.computed, "1"),
        "true": (MATRIX, run.true, "1"),
        "error": (MATRIX, run.error, "1"),
    }
    return arrays, {"axis": list(AXES), "plane": list(SKEW_PLANES), "row": [1, 2, 3], "column": [1, 2, 3]}


@variables.register
def _(history: History) -> tuple[Variables, dict[str, Any]]:
    states = history.states.reshape(len(history.time), -1)
    names = runs_report.history_elements(history)
    return {"attitude": (("time_s", "element"), states, "1")}, {"element": list(names)}


@variables.register
def _(error: AttitudeError) -> tuple[Variables, dict[str, Any]]:
    return {"error_deg": (VECTOR, np.degrees(error.vector), "deg")}, {"axis": list(AXES)}


@figure.register
def _(error: AttitudeError, title: str) -> Any:
    return runs_report.error_figure(error, title)


@figure.register
def _(run: Run, title: str) -> Any:
    return runs_report.run_figure(run, title)


@figure.register
def _(history: History, title: str) -> Any:
    return runs_report.history_figure(history, title)
