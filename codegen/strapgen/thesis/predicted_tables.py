"""Predicts the tables of the thesis from error series and sets them beside simulations."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from strapgen import catalogue
from strapgen.analysis.series.prediction import Prediction, predict
from strapgen.lab.motions.motions import motion
from strapgen.lab.simulate.runs import simulate
from strapgen.results.records import Record, entry, properties
from strapgen.run.backends import backend
from strapgen.thesis.printed_tables import ALGORITHMS, ORDERS, TABLES, Table, agrees
from strapgen.thesis.thesis_tables import DURATION, INTERVAL, STEP, drift_deg, printed_number


@dataclass(frozen=True)
class PredictedEntry(Record):
    """One figure of a table."""

    computed = properties(thesis_printed=entry(), deviation=entry())

    table: int
    algorithm: str
    #: Order of the integration
    order: int
    #: Predicted drift in degrees, and its ratio to that of the direction cosine matrix, as in the table
    drift_deg: float
    normalised: float
    #: The same two numbers from a run in numpy
    simulated_deg: float
    simulated: float
    #: The ratio as the thesis prints it
    thesis: str = field(metadata=entry(write=printed_number, kind=float))
    #: Whether `normalised` has the printed digits
    agrees: bool
    #: As for `TableEntry`
    scan: str | None = None
    repairs: tuple[str, ...] = ()

    @property
    def agrees_simulated(self) -> bool:
        """Whether `simulated` has the printed digits."""
        return agrees(self.simulated, self.thesis)

    @property
    def deviation(self) -> float:
        """Relative difference of the predicted ratio from the simulated one."""
        return self.normalised / self.simulated - 1

    @property
    def thesis_printed(self) -> str:
        """The figure as the thesis prints it."""
        return self.thesis


def predicted(tables: Sequence[Table] = TABLES) -> Iterator[PredictedEntry]:
    """Predict tables from two powers of the error rate, and compare them with the simulation."""
    for table in tables:
        profile = motion(table.motion, **table.settings)
        drifts, runs = {}, {}
        for algorithm in ALGORITHMS:
            for order in ORDERS:
                choice = catalogue.choose(algorithm, f"rk{order}", 2)
                expected = predict(choice, profile, STEP, DURATION, INTERVAL, INTERVAL)
                drifts[algorithm, order] = _drift_deg(table, expected)
                stepper = backend(algorithm, f"rk{order}", 2, "numpy")
                runs[algorithm, order] = drift_deg(
                    table, simulate(stepper, profile, STEP, DURATION, INTERVAL, INTERVAL)
                )
                base = ("dcm", order if table.by_order else 1)
                printed = table.printed[algorithm][ORDERS.index(order)]
                normalised = drifts[algorithm, order] / drifts[base]
                yield PredictedEntry(
                    table.number,
                    algorithm,
                    order,
                    drifts[algorithm, order],
                    normalised,
                    runs[algorithm, order],
                    runs[algorithm, order] / runs[base],
                    printed,
                    agrees(normalised, printed),
                    None if (repair := table.repair(algorithm, order)) is None else repair.scan,
                    tuple(each.sentence for each in table.repairs_behind(algorithm, order)),
                )


def _drift_deg(table: Table, expected: Prediction) -> float:
    """Return the drift of a prediction as the table reports it."""
    return math.degrees(expected.mean_drift if table.mean else max(expected.drift_by_axis))
