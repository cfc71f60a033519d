"""The overview compares algorithms by order, leading error terms, operations of a step and error at equal work."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import sympy as sp

from strapgen import catalogue, pipeline
from strapgen.analysis.growth import contraction
from strapgen.analysis.series.constant_rate import constant_rate
from strapgen.analysis.series.error_rate import accumulate
from strapgen.analysis.series.invariants import covariant_text, intervals_text
from strapgen.analysis.series.motion_rates import is_plain, parameters
from strapgen.analysis.series.series import series
from strapgen.catalogue import Choice
from strapgen.catalogue.methods.tableaux import TABLEAUX
from strapgen.results.records import Properties, Record, entry, properties, reader_table
from strapgen.results.result import Result
from strapgen.results.table import ERROR, Column, TextTable

#: Highest order of a series in the overview; with higher orders the error is far below that of any gyro.
_HIGHEST_SERIES = 8
#: Rates a, b and g of coning in deg/s, and step in s, for numerical values: those of table 5 of the thesis.
CONING_DEG_S, STEP_S = 10.0, 0.125
#: Operations per second at equal work: those of the fourth-order step of Euler parameters at `STEP_S`.
WORK = 544.0


@dataclass(frozen=True)
class OverviewRow(Record):
    """The errors and the operations of one algorithm."""

    computed: ClassVar[Properties] = properties(
        constant_term=entry("constant", align="<", internal=True),
        coning_drift_deg_h=entry("coning, deg/h", ERROR),
        drift_per_operation_rad=entry("per operation", ".2e"),
        drift_at_equal_work_deg_h=entry("equal work", ".2e"),
    )

    kernel: str = field(metadata=entry("algorithm", align="<"))
    increments: int
    #: Order of the step on a general motion
    order: int | None = field(metadata=entry("order"))
    #: Operations of a step, of all kinds
    operations: int = field(metadata=entry("operations"))
    #: At a constant rate the angle in rad lost in a step is ``constant x^constant_power`` with x = |w| h; None
    #: if no angle is lost
    constant_power: int | None
    constant: sp.Expr | None
    #: On coning the secular drift rate is the vector (0, b + g, a) times ``coning h^coning_power``; None if
    #: there is no drift
    coning_power: int | None
    coning: sp.Expr | None
    #: Leading term of the drift of a step on a general motion
    general: str
    #: Angles of a step, in rad, at which no state grows
    contractive: str = field(metadata=entry("contractive", align="<"))

    def coning_rate(self, step: float = STEP_S) -> float | None:
        """Return the leading secular drift rate in rad/s on the motion of table 5 of the thesis, for a step in s.

        `step`: in s.
        """
        if self.coning is None or self.coning_power is None:
            return None
        rate = math.radians(CONING_DEG_S)
        factor = float(self.coning.subs({name: rate for name in parameters("coning")}))
        return abs(factor) * step**self.coning_power * math.sqrt(5) * rate

    @property
    def constant_term(self) -> str | None:
        """The angle that a step loses at a constant rate, with the power of x."""
        return _term(self.constant, self.constant_power)

    @property
    def coning_drift_deg_h(self) -> float | None:
        """Leading secular drift rate on the motion of table 5 of the thesis."""
        return _deg_h(self.coning_rate())

    @property
    def drift_per_operation_rad(self) -> float | None:
        """That drift of a step, divided by the operations of the step."""
        rate = self.coning_rate()
        return None if rate is None else rate * STEP_S / self.operations

    @property
    def drift_at_equal_work_deg_h(self) -> float | None:
        """That drift rate at the step with which all algorithms need the same number of operations a second."""
        return _deg_h(self.coning_rate(self.operations / WORK))


def _deg_h(rate: float | None) -> float | None:
    """Return a rate in rad/s in deg/h."""
    return None if rate is None else math.degrees(rate) * 3600


def _term(number: sp.Expr | None, power: int | None) -> str | None:
    if number is None or power is None:
        return None
    size = sp.Rational(number) if number.is_Rational else None
    if size is None or size.q > 10**9:
        return f"{float(number):.4g} x^{power}"
    return f"{size} x^{power}"


def methods() -> list[str]:
    """Return the methods of the catalogue, without series of very high order."""
    others = [
        name for name, integrator in catalogue.INTEGRATORS.items() if integrator.order <= _HIGHEST_SERIES
    ]
    return [*TABLEAUX, *others]


def choices(
    algorithms: Sequence[str] = tuple(catalogue.ALGORITHMS), names: Iterable[str] | None = None
) -> list[Choice]:
    """Return every algorithm with every method, on as many increments as its order needs."""
    return [
        catalogue.choose(algorithm, name, catalogue.enough(name))
        for algorithm in algorithms
        for name in (methods() if names is None else names)
    ]


def overview(chosen: Iterable[Choice]) -> Iterator[OverviewRow]:
    """Derive the rows of a comparison.

    >>> (row,) = overview([catalogue.choose("dcm", "rk2", 1)])
    >>> row.order, row.constant_power, row.constant, row.general
    (2, 3, -1/6, '-1/6 |w0|^2 w0 + 1/12 w0 x w1')
    """
    for choice in chosen:
        yield _row(choice)


def _row(choice: Choice) -> OverviewRow:
    kernel = pipeline.derive(choice)
    general = series(choice, "general", 1)
    fixed = constant_rate(choice)
    lost = fixed.series(1)
    run = accumulate(choice, "coning", 1)
    constant_power = next(iter(lost), None)
    coning_power, coning = next(iter(run.secular.items()), (None, None))
    a = parameters("coning")[0]
    drift = min(general.drift, default=None)
    counts = pipeline.program(choice).operations
    return OverviewRow(
        kernel.name,
        choice.increments_per_step,
        general.order,
        sum(counts.values()),
        constant_power,
        None if constant_power is None else lost[constant_power],
        coning_power,
        None if coning is None else _along(coning, a),
        "0" if drift is None else covariant_text(general.invariant[drift].drift),
        intervals_text(contraction(fixed)),
    )


def _along(vector: sp.Matrix, a: sp.Symbol) -> sp.Expr:
    """Return the factor of a vector along the axis (0, b + g, a)."""
    factor = vector[2] / a
    return sp.factor(sp.cancel(factor)) if is_plain(factor) else factor


#: Most terms of a vector that are written out.
_MOST_TERMS = 3
_COLUMNS = (
    *("kernel", "order", "operations", "constant_term", "coning_drift_deg_h", "drift_per_operation_rad"),
    *("drift_at_equal_work_deg_h", "contractive"),
)
_NOTES = (
    "constant       angle in rad that a step loses at a constant rate, x = |w| h; - none",
    f"coning         leading secular drift rate for a = b = g = {CONING_DEG_S:g} deg/s, step {STEP_S:g} s",
    "per operation  that drift of a step in rad, over the operations of the step",
    f"equal work     the drift rate in deg/h where the step is so long that {WORK:g} operations a second do",
    "contractive    angles x of a step at which no state grows; kept: its length is kept exactly",
)


@dataclass(frozen=True)
class OverviewResult(Result):
    """Orders, leading errors and operations side by side: a row for each algorithm and method."""

    rows_in = "algorithms"
    row: ClassVar[type | None] = OverviewRow

    algorithms: Sequence[OverviewRow]

    def reader(self) -> TextTable:
        """Return the columns that fit side by side."""
        return reader_table(self.algorithms, OverviewRow, *_COLUMNS)

    def text(self) -> str:
        """Return the table, what its columns mean, and the drift of a step of each algorithm."""
        drifts = [(row.kernel, _general(row)) for row in self.algorithms]
        return "\n".join(
            [
                *self.reader().lines(),
                "",
                *_NOTES,
                "",
                "drift of a step, leading term for the rate w0 + w1 t + w2 t^2/2 + ...",
                *TextTable([Column(align="<")] * 2, drifts).lines("  "),
            ]
        )


def _general(row: OverviewRow) -> str:
    terms = len(row.general.replace(" - ", " + ").split(" + "))
    return row.general if terms <= _MOST_TERMS else f"{terms} terms: strapgen series, or --format json"
