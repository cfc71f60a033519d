"""Reports the frontier of attitude algorithms: what each costs, and how it drifts on every motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from strapgen.design.frontier.frontier import CONES, MOTIONS, Motions, Standing
from strapgen.results.report import Report
from strapgen.results.table import ANGLE, Column, TextTable

#: Format of a drift, and of a count for each sample.
_DRIFT, _COUNT = ANGLE, ".5g"


def frontier_report(
    standings: Sequence[Standing], sample_hz: float, duration_s: float, motions: Motions = MOTIONS
) -> Report:
    """Return standings as a report.

    `sample_hz, duration_s`: sampling rate in Hz, and length of the runs in s.
    """

    def data() -> dict[str, Any]:
        return {
            "sample_hz": sample_hz,
            "duration_s": duration_s,
            "motions": {label: {"motion": name, **settings} for label, (name, settings) in motions.items()},
            "algorithms": [_as_dict(standing, sample_hz) for standing in standings],
        }

    return Report(
        lambda: frontier_text(standings, sample_hz, duration_s, motions),
        data,
        lambda: _flat(standings, sample_hz),
        lambda: TextTable(
            [Column("algorithm", "<"), *_COST, *(Column(label, spec=_DRIFT) for label in motions)],
            [
                [one.name, *_cost(one, sample_hz), *(one.drifts[label] for label in motions)]
                for one in standings
            ],
        ),
    )


#: Columns of what an algorithm costs for each sample.
_COST = (
    Column("multiply", spec=_COUNT),
    Column("add", spec=_COUNT),
    Column("other", spec=_COUNT),
    Column("multiply/s", spec=_COUNT),
)


def frontier_text(
    standings: Sequence[Standing], sample_hz: float, duration_s: float, motions: Motions = MOTIONS
) -> str:
    """Return standings as tables for a reader: one of costs, and one for each kind of motion."""
    lines = [
        f"largest angle from the true attitude over {duration_s:g} s, divided by that time, in deg/h,",
        f"with exact increments at {sample_hz:g} Hz; every figure is measured here,",
        "what rounding could hide again in 40 digits; random rates and slews, integrated to 5e-13 rad, cannot be",
        "",
        "operations for each sample, counted from the program; other: divisions, roots, sines, cosines, choices",
        "N+P+L: samples of a step, from before it, from after it",
        "",
        *TextTable(
            [Column("algorithm", "<"), *_COST],
            [[one.name, *_cost(one, sample_hz)] for one in standings],
        ).lines(),
    ]
    for title, columns in _tables() if motions == MOTIONS else _table_of(motions):
        rows = [[one.name, *(one.drifts[label] for label in columns)] for one in standings]
        table = TextTable([Column("", "<"), *columns.values()], rows)
        lines += ["", title, "", *table.lines()]
    lines += ["", "sources", ""]
    sources: dict[str, list[str]] = {}
    for one in standings:
        sources.setdefault(one.source, []).append(one.name)
    return "\n".join([*lines, *(f"{', '.join(names)}: {source}" for source, names in sources.items())])


def _tables() -> list[tuple[str, dict[str, Column]]]:
    """Return the tables of drifts: a title, and the column of each motion by its label."""
    angles, frequencies = CONES
    tables = []
    for pair in (angles[:2], angles[2:]):
        columns = {
            f"cone {angle}/{frequency}": Column(f"{frequency} Hz", spec=_DRIFT, group=f"cone of {angle} deg")
            for angle in pair
            for frequency in frequencies
        }
        tables.append((f"drift on cones, half-angle {' and '.join(pair)} deg", columns))
    rest = [label for label in MOTIONS if not label.startswith("cone ")]
    title = "drift on cones of a body that spins, at deg/s on half-angle/Hz; random rates, at deg/s; slews"
    return [*tables, (title, {label: Column(label, spec=_DRIFT) for label in rest})]


def _table_of(motions: Motions) -> list[tuple[str, dict[str, Column]]]:
    """Return the table of drifts on motions that a user states."""
    words = "; ".join(
        ", ".join([name, *(f"{key}={value}" for key, value in settings.items())])
        for name, settings in motions.values()
    )
    return [(f"drift on {words}", {label: Column(label, spec=_DRIFT) for label in motions})]


def _cost(standing: Standing, sample_hz: float) -> list[float]:
    """Return multiplications, additions and other operations for each sample, and multiplications a second."""
    counts = (standing.multiply, standing.add, standing.other)
    return [*(count / standing.increments for count in counts), standing.per_second(sample_hz)]


def _as_dict(standing: Standing, sample_hz: float) -> dict[str, Any]:
    multiply, add, other, per_second = _cost(standing, sample_hz)
    return {
        "algorithm": standing.name,
        "title": standing.title,
        "source": standing.source,
        "increments": standing.increments,
        "multiply_per_sample": multiply,
        "add_per_sample": add,
        "other_per_sample": other,
        "multiply_per_s": per_second,
        "drift_deg_h": dict(standing.drifts),
    }


def _flat(standings: Sequence[Standing], sample_hz: float) -> TextTable:
    """Return all figures, a row for each algorithm."""
    rows = [_as_dict(standing, sample_hz) for standing in standings]
    names = [name for name in rows[0] if name != "drift_deg_h"] if rows else []
    labels = standings[0].drifts if standings else ()
    columns = [*names, *(f"{label} deg/h" for label in labels)]
    return TextTable(
        [Column(name) for name in columns],
        [[*(row[name] for name in names), *row["drift_deg_h"].values()] for row in rows],
    )
