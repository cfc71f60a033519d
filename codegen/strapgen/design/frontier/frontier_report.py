"""The frontier of attitude algorithms as a result: what each costs, and how it drifts on every motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from strapgen.design.frontier.frontier import CONES, MOTIONS, Motions, Standing
from strapgen.results.records import INTERNAL, entry, plain_record, properties, reader_table
from strapgen.results.result import Result
from strapgen.results.table import ANGLE, Column, TextTable

#: Format of a drift, and of a count for each sample.
_DRIFT, _COUNT = ANGLE, ".5g"


@dataclass(frozen=True)
class AlgorithmCost:
    """What an algorithm costs for each sample, and how it drifts."""

    algorithm: str = field(metadata=entry("algorithm", align="<"))
    title: str
    #: Where it comes from
    source: str
    #: Samples of a step
    increments: int
    multiply_per_sample: float = field(metadata=entry("multiply", _COUNT))
    add_per_sample: float = field(metadata=entry("add", _COUNT))
    #: Divisions, roots, sines and cosines, choices
    other_per_sample: float = field(metadata=entry("other", _COUNT))
    multiply_per_s: float = field(metadata=entry("multiply/s", _COUNT))
    #: The drift on each motion; None where the attitude leaves the range of its numbers
    drift_deg_h: Mapping[str, float | None]


@dataclass(frozen=True)
class FrontierResult(Result):
    """What attitude algorithms cost, and how they drift on every motion."""

    computed = properties(motions=entry(), algorithms=entry())
    drawn_by = "strapgen.design.frontier.frontier_plot:frontier_image"

    standings: Sequence[Standing] = field(metadata=INTERNAL)
    #: Sampling rate
    sample_hz: float
    #: Length of the runs
    duration_s: float
    described: Motions = field(default_factory=lambda: MOTIONS, metadata=INTERNAL)

    @property
    def motions(self) -> dict[str, dict[str, str]]:
        """The motions by their labels: the name of each, and its parameters."""
        return {label: {"motion": name, **settings} for label, (name, settings) in self.described.items()}

    @property
    def algorithms(self) -> list[AlgorithmCost]:
        """The algorithms, with their costs for each sample."""
        return [
            AlgorithmCost(
                algorithm=one.name,
                title=one.title,
                source=one.source,
                increments=one.increments,
                multiply_per_sample=one.multiply / one.increments,
                add_per_sample=one.add / one.increments,
                other_per_sample=one.other / one.increments,
                multiply_per_s=one.per_second(self.sample_hz),
                drift_deg_h=one.drifts,
            )
            for one in self.standings
        ]

    def rows(self) -> list[dict[str, Any]]:
        """Return all figures, a row for each algorithm."""
        rows = []
        for one in self.algorithms:
            row = plain_record(one)
            drifts = row.pop("drift_deg_h")
            rows.append(row | {f"{label} deg/h": drift for label, drift in drifts.items()})
        return rows

    def reader(self) -> TextTable:
        """Return costs and drifts."""
        costs = reader_table(self.algorithms, AlgorithmCost)
        columns = [*costs.columns, *(Column(label, spec=_DRIFT) for label in self.described)]
        rows = zip(costs.rows, self.standings, strict=True)
        return TextTable(columns, [[*row, *one.drifts.values()] for row, one in rows])

    def text(self) -> str:
        """Return a table of costs, and one for each kind of motion."""
        lines = [
            f"largest angle from the true attitude over {self.duration_s:g} s, divided by that time, in deg/h,",
            f"with exact increments at {self.sample_hz:g} Hz; every figure is measured here,",
            "what rounding could hide again in 40 digits; random rates and slews, integrated to 5e-13 rad, cannot be",
            "",
            "operations for each sample, counted from the program; other: divisions, roots, sines, cosines, choices",
            "N+P+L: samples of a step, from before it, from after it",
            "",
            *reader_table(self.algorithms, AlgorithmCost).lines(),
        ]
        for title, columns in _tables() if self.described == MOTIONS else _table_of(self.described):
            rows = [[one.name, *(one.drifts[label] for label in columns)] for one in self.standings]
            table = TextTable([Column("", "<"), *columns.values()], rows)
            lines += ["", title, "", *table.lines()]
        lines += ["", "sources", ""]
        sources: dict[str, list[str]] = {}
        for one in self.standings:
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
