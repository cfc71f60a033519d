"""A Kalman filter as a result: states, matrices, observability, gains, bounds and costs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import sympy as sp

from strapgen.ir.formats import float_above
from strapgen.ir.sources import Sources
from strapgen.navigation.kalman import gain_tables
from strapgen.navigation.kalman.error_bound import run_bound
from strapgen.navigation.kalman.kalman_filter import KalmanFilter
from strapgen.navigation.kalman.kalman_model import Observability
from strapgen.results.records import INTERNAL, entry, reader_table
from strapgen.results.result import Result
from strapgen.results.table import Column, TextTable

#: A number, or an expression in inputs and states as text.
Entry = float | str


@dataclass(frozen=True)
class StateRow:
    """A state of a filter."""

    name: str = field(metadata=entry("state", align="<"))
    unit: str = field(metadata=entry("unit", align="<"))
    #: Its derivative, with numbers for parameters
    derivative: str = field(metadata=entry("derivative", align="<"))
    #: Standard deviation before the first step
    deviation: float = field(metadata=entry("deviation", ".4g"))
    #: Largest magnitude
    range: float | None = field(metadata=entry("range", ".4g"))
    #: Standard deviation of gains that are computed before: steady, or after the last step of the schedule
    last_deviation: float | None = field(metadata=entry("at the end", ".4g"))
    #: Format in fixed point
    format: str | None = field(metadata=entry("format", align="<"))
    #: Certified error of the estimate in fixed point, over the steps of `bound_steps`
    error: float | None = field(metadata=entry("error of a run", ".3g"))


@dataclass(frozen=True)
class MeasurementRow:
    """A measurement of a filter."""

    name: str = field(metadata=entry("measurement", align="<"))
    unit: str = field(metadata=entry("unit", align="<"))
    #: What is measured, with numbers for parameters
    expression: str = field(metadata=entry("expression", align="<"))
    deviation: float = field(metadata=entry("deviation", ".4g"))
    #: Steps from one to the next
    every: int = field(metadata=entry("every"))


@dataclass(frozen=True)
class KernelRow:
    """A generated kernel."""

    kernel: str = field(metadata=entry("kernel", align="<"))
    #: Operations of a call by kind
    operations: Mapping[str, int] = field(
        metadata=entry(
            "operations",
            align="<",
            cell=lambda counts: ", ".join(f"{n} {kind}" for kind, n in counts.items() if n),
        )
    )
    #: Number of values on the way
    temporaries: int = field(metadata=entry("temporaries"))


@dataclass(frozen=True)
class GainRow:
    """The gains of a measurement, by the state."""

    measurement: str
    #: Rows of the schedule; 1 for steady gains
    rows: int
    #: Of the first row
    first: Mapping[str, float]
    #: Of the last row
    last: Mapping[str, float]
    #: Largest error by rounding to the numbers of the target; None where gains are constants of the code
    rounding: Mapping[str, float] | None


@dataclass(frozen=True)
class KalmanResult(Result):
    """A Kalman filter: states, matrices, observability, gains, bounds and costs."""

    name: str
    title: str
    kind: str
    #: Form of the covariance; None where the gains are computed before
    form: str | None
    target: str
    #: Length of a step
    interval_s: float
    #: Steps of the schedule
    steps: int | None
    states: list[StateRow]
    measurements: list[MeasurementRow]
    #: Derivatives of the states' derivatives by the states
    F: list[list[Entry]] = field(metadata=entry(kind=list[list[float | str]]))
    #: The same by the noise
    G: list[list[Entry]] = field(metadata=entry(kind=list[list[float | str]]))
    #: Derivatives of the measurements by the states
    H: list[list[Entry]] = field(metadata=entry(kind=list[list[float | str]]))
    #: Transition of a step; None where it depends on inputs or states
    transition: list[list[float]] | None
    #: Covariance of the noise of a step; None as for the transition
    Q: list[list[float]] | None
    #: Highest power of the step in the series of the transition
    order: int
    #: Bound of what the series leaves out, by ranges or else deviations of the states; None where an input has no range
    left_out: float | None
    observability: Observability
    gains: list[GainRow]
    #: Bound of the change of the steady covariance by a step, by the deviations
    residual: float | None
    #: Steps for which the errors of the states hold; None for any number, or where there is none
    bound_steps: int | None
    kernels: list[KernelRow]
    files: Sequence[Path]
    model: KalmanFilter = field(metadata=INTERNAL)

    @staticmethod
    def of(
        model: KalmanFilter, sources: Sequence[Sources], target: str, files: Sequence[Path]
    ) -> KalmanResult:
        """Return the result of a filter and its code."""
        text, constant, solved = model.text, model.is_constant, model.solved
        interfaces = [one.fixed for one in sources if one.fixed is not None]
        bound = run_bound(model, interfaces) if interfaces else None
        formats = {one.signal.name: str(one.format) for one in interfaces[0].inputs} if interfaces else {}
        tables = {one.measurement: one for one in gain_tables.tables(model, sources[1:], target)}
        return KalmanResult(
            name=text.name,
            title=text.title,
            kind=text.kind,
            form=None if model.is_fixed_gain else text.form,
            target=target,
            interval_s=float(text.interval),
            steps=text.steps,
            states=[
                StateRow(
                    *(one.name, one.unit, shown(one.expression), float(one.deviation)),
                    None if one.range is None else float(one.range),
                    None if solved is None else float(solved.deviations[place]),
                    formats.get(one.name),
                    bound.errors[one.name] if bound else None,
                )
                for place, one in enumerate(text.states)
            ],
            measurements=[
                MeasurementRow(one.name, one.unit, shown(one.expression), float(one.deviation), one.every)
                for one in text.measurements
            ],
            F=_entries(model.F),
            G=_entries(model.G),
            H=_entries(model.H),
            transition=_entries(model.transition) if constant else None,
            Q=_entries(model.Q) if constant else None,
            order=model.order,
            left_out=model.left_out,
            observability=model.observability,
            gains=[
                GainRow(
                    name,
                    len(rows),
                    _by_state(model, rows[0]),
                    _by_state(model, rows[-1]),
                    {state: float_above(x) for state, x in tables[name].errors.items()} if tables else None,
                )
                for name, rows in (solved.rows if solved else {}).items()
                if rows
            ],
            residual=None if solved is None or solved.residual is None else float_above(solved.residual),
            bound_steps=bound.steps if bound else None,
            kernels=[KernelRow(one.kernel, one.operations, one.temporaries) for one in sources],
            files=files,
            model=model,
        )

    def text(self) -> str:
        """Return the filter for a reader."""
        return "\n".join([*self._lines(), *(f"  {path}" for path in self.files)])

    def _lines(self) -> Iterator[str]:
        how = self.kind if self.form is None else f"{self.kind}, {self.form}"
        length = "" if self.steps is None else f", {self.steps} steps"
        yield f"{self.name}: {self.title}; {how}, every {self.interval_s:g} s{length}"
        yield ""
        known = self._columns()
        yield reader_table(self.states, StateRow, *known).as_text()
        yield ""
        yield reader_table(self.measurements, MeasurementRow).as_text()
        names, noise = [one.name for one in self.states], [str(one) for one in self.model.text.noise]
        yield from _matrix("F, derivatives by the states", names, names, self.F)
        if noise:
            yield from _matrix("G, derivatives by the noise", names, noise, self.G)
        yield from _matrix("H", [one.name for one in self.measurements], names, self.H)
        left = "nothing" if self.left_out == 0 else "what is not bounded, for want of ranges"
        left = f"at most {self.left_out:.2g} of the ranges, or deviations at first" if self.left_out else left
        about = f"a series to the power {self.order} of F T, which leaves out {left}"
        if self.transition is None or self.Q is None:
            yield ""
            yield f"Phi and Q are computed in every step: {about}"
        else:
            yield from _matrix(f"Phi, {about}", names, names, self.transition)
            yield from _matrix("Q", names, names, self.Q)
        yield ""
        yield f"observability: rank {self.observability.rank} of {len(names)}"
        for one in self.observability.unobservable:
            yield f"  no measurement shows a change together of {one}"
        yield from self._gain_lines(names)
        yield ""
        yield reader_table(self.kernels, KernelRow).as_text()
        if self.states[0].error is not None:
            steps = "a run of any length" if self.bound_steps is None else f"{self.bound_steps} steps"
            yield f"errors of a run are certified for {steps} without a refused value, on the same words"
        elif self.states[0].format is not None:
            yield "no error of a run is certified: errors last too long, or a bound of them in double does not hold"

    def _columns(self) -> list[str]:
        """Return the columns of the states in which something stands."""
        names = ["name", "unit", "derivative", "deviation", "range", "last_deviation", "format", "error"]
        return [name for name in names if any(getattr(one, name) is not None for one in self.states)]

    def _gain_lines(self, names: list[str]) -> Iterator[str]:
        for one in self.gains:
            rows: list[list[Any]] = [["gain", *one.last.values()]]
            if one.rows > 1:
                rows = [["first gain", *one.first.values()], ["last gain", *one.last.values()]]
            if one.rounding is not None:
                rows.append(["rounded by", *one.rounding.values()])
            yield ""
            yield f"gains of {one.measurement}" + ("" if one.rows == 1 else f", {one.rows} rows")
            yield TextTable([Column("", "<"), *(Column(name, spec=".6g") for name in names)], rows).as_text()
        if self.residual is not None:
            yield f"a step changes the steady covariance by at most {self.residual:.2g} of it"


def _by_state(model: KalmanFilter, row: Sequence[Fraction]) -> dict[str, float]:
    return {state: float(gain) for state, gain in zip(model.states, row, strict=True)}


def shown(expression: sp.Expr) -> str:
    """Return an expression with six digits of its numbers."""
    rounded = {one: sp.Float(one, 6) for one in expression.atoms(sp.Rational) if not one.is_Integer}
    return str(expression.xreplace(rounded))


def _entries(matrix: sp.Matrix) -> list[list[Any]]:
    return [[float(x) if x.is_number else shown(x) for x in matrix[i, :]] for i in range(matrix.rows)]


def _matrix(
    title: str, rows: Sequence[str], columns: Sequence[str], entries: Sequence[Sequence[Any]]
) -> Iterator[str]:
    yield ""
    yield title
    table = TextTable(
        [Column("", "<"), *(Column(name, spec=".6g") for name in columns)],
        [[name, *row] for name, row in zip(rows, entries, strict=True)],
    )
    yield table.as_text()
