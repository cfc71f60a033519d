"""Calibration of an inertial measurement unit by a set of positions: rank, covariance and estimates of coefficients.

A unit at rest is turned into many positions; in each, the errors of its rate and of its acceleration are measured.
They are linear in the coefficients of the error model, D = a X, and the least squares of all positions are
X = (a'a)^-1 a'D with the covariance sigma^2 (a'a)^-1. The rows of a are derivatives of the kernel `imu-errors`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from strapgen import catalogue, pipeline
from strapgen.catalogue.coefficients import Number
from strapgen.catalogue.toml_models import Key, UserFile
from strapgen.ir.exceptions import InputError
from strapgen.kernel.kernel import evaluate_stages
from strapgen.results import figures
from strapgen.results.records import INTERNAL, entry, reader_table
from strapgen.results.result import Result

Array = NDArray[np.float64]

#: The quantities whose errors are measured, with the output of the kernel, and the terms of the model at rest.
QUANTITIES = {"rate": ("measured_increment", "DBE"), "acceleration": ("measured_velocity_increment", "AMN")}
#: Symbols of the rate in rad/s and of the acceleration in the unit of gravity, body axes.
RATE, ACCELERATION = sp.symbols("w_x w_y w_z"), sp.symbols("a_x a_y a_z")


@cache
def error_derivatives(quantity: str) -> dict[str, sp.Matrix]:
    """Return the derivatives of the error of a quantity by the coefficients of the error model.

    >>> error_derivatives("rate")["B_yz"].T
    Matrix([[0, a_z, -a_y]])
    """
    kernel = pipeline.derive(catalogue.choose("imu-errors"))
    motion = dict(
        zip([*kernel.inputs[0].elements, *kernel.inputs[1].elements], (*RATE, *ACCELERATION), strict=True)
    )
    motion |= {"cycle": sp.S.One, "cycle_rate": sp.S.One}
    names = [name for signal in kernel.inputs for name in signal.elements if name not in motion]
    symbols = {name: sp.Symbol(name) for name in names}
    values = evaluate_stages([*kernel.stages, *kernel.outputs], {**motion, **symbols})
    output = next(stage.signal for stage in kernel.outputs if stage.signal.name == QUANTITIES[quantity][0])
    errors = [sp.expand(values[name]) for name in output.elements]
    derivatives = {
        name: sp.Matrix([sp.diff(error, symbol) for error in errors]) for name, symbol in symbols.items()
    }
    return {name: column for name, column in derivatives.items() if any(column)}


def at_rest(quantity: str) -> tuple[str, ...]:
    """Return the names of the coefficients of a quantity that a unit at rest can show, in the order of the model."""
    return tuple(_columns_at_rest(quantity))


@cache
def _columns_at_rest(quantity: str) -> dict[str, sp.Matrix]:
    """Return the derivatives that do not vanish at rest, by coefficient, as functions of the specific force."""
    still = dict.fromkeys(RATE, sp.S.Zero)
    columns = {name: column.xreplace(still) for name, column in error_derivatives(quantity).items()}
    return {name: column for name, column in columns.items() if any(column)}


@dataclass(frozen=True)
class Scheme:
    """Positions of a unit at rest."""

    name: str
    #: The specific force in body axes in the unit of gravity, as exact numbers
    positions: tuple[tuple[sp.Expr, ...], ...]

    def design(self, quantity: str) -> sp.Matrix:
        """Return the matrix a of a quantity: three rows for each position, a column for each coefficient."""
        whole = sp.Matrix.hstack(*_columns_at_rest(quantity).values())
        rows = []
        for position in self.positions:
            rows.append(whole.xreplace(dict(zip(ACCELERATION, map(sp.sympify, position), strict=True))))
        return sp.Matrix.vstack(*rows)


@dataclass(frozen=True)
class Calibration:
    """Observability and covariance of the coefficients of one quantity in a scheme of positions."""

    #: A key of `QUANTITIES`
    quantity: str
    #: The coefficients, in the order of the model
    names: tuple[str, ...]
    #: Exact rank of the matrix a
    rank: int
    #: Combinations of coefficients that leave no trace in any position, as exact numbers by the coefficient's
    #: name
    unseen: tuple[dict[str, sp.Expr], ...]
    design: sp.Matrix

    @property
    def lost(self) -> tuple[str, ...]:
        """The coefficients that cannot be estimated: those in a combination that is not observable."""
        return tuple(name for name in self.names if any(name in one for one in self.unseen))

    @cached_property
    def covariance(self) -> Array:
        """(a'a)^-1 of the coefficients that can be estimated, zero for the others, (N, N)."""
        places = [k for k, name in enumerate(self.names) if name not in self.lost]
        matrix = np.array(self.design.evalf(30).tolist(), float)
        whole = np.linalg.pinv(matrix.T @ matrix, rcond=1e-10)
        result = np.zeros_like(whole)
        result[np.ix_(places, places)] = whole[np.ix_(places, places)]
        return result

    @property
    def deviations(self) -> dict[str, float | None]:
        """Standard deviation of each coefficient in that of a measurement; None for one that cannot be estimated."""
        roots = np.sqrt(np.diag(self.covariance))
        return {
            name: None if name in self.lost else float(root)
            for name, root in zip(self.names, roots, strict=True)
        }

    def estimate(self, errors: Any) -> dict[str, float]:
        """Return the least squares of measured errors.

        `errors` (N, 3): the error of each position, in the order of the scheme.
        """
        if self.unseen:
            raise InputError(
                f"the scheme cannot see {', '.join(self.lost)} of the {self.quantity}; other positions are needed"
            )
        matrix = np.array(self.design.evalf(30).tolist(), float)
        rows = np.asarray(errors, float).reshape(-1)
        if len(rows) != len(matrix):
            raise InputError(f"{len(rows) // 3} rows of errors are there for {len(matrix) // 3} positions")
        solution, *_ = np.linalg.lstsq(matrix, rows, rcond=None)
        return dict(zip(self.names, map(float, solution), strict=True))

    def error_covariance(self, rate: Sequence[float], acceleration: Sequence[float]) -> Array:
        """Return the covariance of a quantity after compensation with estimated coefficients, (3, 3).

        `rate, acceleration` (3,): in rad/s, and in the unit of gravity, body axes. Coefficients that rest cannot
        show are taken for exact.
        """
        values = dict(zip((*RATE, *ACCELERATION), (*rate, *acceleration), strict=True))
        columns = error_derivatives(self.quantity)
        parts = [np.array(columns[name].subs(values).tolist(), float)[:, 0] for name in self.names]
        jacobian = np.stack(parts, axis=1)
        result: Array = jacobian @ self.covariance @ jacobian.T
        return result


def calibrated(scheme: Scheme, quantity: str) -> Calibration:
    """Analyse a scheme of positions for the coefficients of a quantity.

    >>> one = calibrated(Scheme("up and down", ((0, 0, 1), (0, 0, -1))), "rate")
    >>> one.rank, len(one.names)
    (6, 15)
    """
    design, names = scheme.design(quantity), at_rest(quantity)
    matrix = sp.polys.matrices.DomainMatrix.from_Matrix(design, extension=True).to_field()
    null = matrix.nullspace().to_Matrix()
    unseen = []
    for k in range(null.rows):
        row = null.row(k)
        first = next(value for value in row if value != 0)
        unseen.append(
            {name: sp.nsimplify(value / first) for name, value in zip(names, row, strict=True) if value != 0}
        )
    return Calibration(quantity, names, len(names) - null.rows, tuple(unseen), design)


def eight_about_each(without_xy: bool = False) -> Scheme:
    """Return positions every 45 deg about each of the three axes: 24, or 20 without those of a_x a_y other than 0.

    The axis positions come twice, as in the source's scheme.
    """
    rows = []
    for axis in range(3):
        for k in range(8):
            row = [sp.S.Zero] * 3
            row[(axis + 1) % 3], row[(axis + 2) % 3] = sp.cos(k * sp.pi / 4), sp.sin(k * sp.pi / 4)
            if not (without_xy and row[0] * row[1] != 0):
                rows.append(tuple(row))
    return Scheme(f"{len(rows)} positions", tuple(rows))


#: Units of the quantities, as keys end.
UNITS = {"rate": "deg_h", "acceleration": "micro_g"}
#: By how much the length of a position may differ from 1.
_LENGTH = 1e-6

Rows = tuple[tuple[float, float, float], ...]


@dataclass(frozen=True)
class PositionsFile:
    """Positions of a unit at rest, and the errors measured in them."""

    positions: Annotated[
        tuple[tuple[Number, Number, Number], ...],
        Key("Specific force in body axes, of length 1", "g", least=1, most=2000),
    ]
    name: Annotated[str, Key("Name of the scheme; by default that of the file")] = ""
    rate_sigma_deg_h: Annotated[float, Key("Standard deviation of a measured rate", "deg/h", above=0)] = 1.0
    acceleration_sigma_micro_g: Annotated[
        float, Key("Standard deviation of a measured acceleration", "micro-g", above=0)
    ] = 1.0
    rate_errors_deg_h: Annotated[
        Rows | None, Key("Error of the rate in each position, indicated less true", "deg/h")
    ] = None
    acceleration_errors_micro_g: Annotated[
        Rows | None, Key("Error of the acceleration in each position, indicated less true", "micro-g")
    ] = None

    def __post_init__(self) -> None:
        for number, position in enumerate(self.positions, 1):
            length = math.hypot(*map(float, position))
            if abs(length - 1) > _LENGTH:
                raise InputError(
                    f"positions[{number}] has the length {length:.6g}; 1 is needed, the unit of gravity"
                )
        for quantity, unit in UNITS.items():
            rows = getattr(self, key := f"{quantity}_errors_{unit}")
            if rows is not None and len(rows) != len(self.positions):
                raise InputError(
                    f"{key} has {len(rows)} rows; one for each of {len(self.positions)} positions is needed"
                )


@dataclass(frozen=True)
class CalibrationFile:
    """A scheme, the noise of its measurements, and the errors that were measured."""

    scheme: Scheme
    #: Standard deviation of a measurement by quantity, in `UNITS`
    sigma: dict[str, float]
    #: Rows of three errors, indicated less true, by quantity, in `UNITS`; of those that were measured
    errors: dict[str, Rows]


POSITIONS = UserFile("a scheme of positions", PositionsFile, 1 << 20)


def read(path: str | Path) -> CalibrationFile:
    """Read a scheme of positions."""
    file = POSITIONS.read(path)
    positions = tuple(tuple(map(sp.sympify, row)) for row in file.positions)
    sigma = {quantity: getattr(file, f"{quantity}_sigma_{unit}") for quantity, unit in UNITS.items()}
    errors = {quantity: getattr(file, f"{quantity}_errors_{UNITS[quantity]}") for quantity in QUANTITIES}
    stated = {quantity: rows for quantity, rows in errors.items() if rows is not None}
    return CalibrationFile(Scheme(file.name or Path(path).stem, positions), sigma, stated)


#: Units as a reader has them, and what follows them for a coefficient, by the letters of its name.
_SHOWN = {"rate": "deg/h", "acceleration": "micro-g"}
_FACTORS = {"D0": "", "B": "/g", "E": "/g^2", "A0": "", "M": "/g", "N": "/g^2"}


def _texts(unseen: Mapping[str, Sequence[Mapping[str, Any]]]) -> dict[str, list[dict[str, str]]]:
    return {
        quantity: [{name: str(value) for name, value in row.items()} for row in rows]
        for quantity, rows in unseen.items()
    }


@dataclass(frozen=True)
class CoefficientRow:
    """Observability, deviation and estimate of a coefficient."""

    quantity: str
    coefficient: str = field(metadata=entry("coefficient", align="<"))
    unit: str = field(metadata=entry("unit", align="<"))
    #: Standard deviation for noise of 1; None if the coefficient cannot be estimated
    deviation: float | None = field(metadata=entry("deviation", ".5f"))
    #: The same for the noise of the file, in the unit
    uncertainty: float | None = field(metadata=entry("uncertainty", ".3g"))
    #: From the errors of the file, in the unit
    estimate: float | None = field(metadata=entry("estimate", ".6g"))

    @staticmethod
    def of(
        file: CalibrationFile, one: Calibration, name: str, estimates: Mapping[str, Mapping[str, float]]
    ) -> CoefficientRow:
        """Return a coefficient of a quantity."""
        deviation = one.deviations[name]
        return CoefficientRow(
            quantity=one.quantity,
            coefficient=name,
            unit=f"{_SHOWN[one.quantity]}{_FACTORS[name.partition('_')[0]]}",
            deviation=deviation,
            uncertainty=None if deviation is None else deviation * file.sigma[one.quantity],
            estimate=estimates.get(one.quantity, {}).get(name),
        )


@dataclass(frozen=True)
class CalibrationResult(Result):
    """Observability, deviations and estimates of the coefficients of an inertial measurement unit."""

    rows_in = "coefficients"
    drawn_by: ClassVar[str] = f"{__name__}:calibration_image"

    file: CalibrationFile = field(metadata=INTERNAL)
    several: Sequence[Calibration] = field(metadata=INTERNAL)
    name: str
    #: Number of positions
    positions: int
    #: Number of coefficients that are seen, by quantity
    rank: dict[str, int]
    #: Combinations that leave no trace, by quantity: factors by coefficient
    unseen: Mapping[str, Sequence[Mapping[str, Any]]] = field(
        metadata=entry(write=_texts, kind=dict[str, list[dict[str, str]]])
    )
    coefficients: list[CoefficientRow]
    #: Covariance of the compensated quantity in flight, in squares of its unit; empty without a flight
    remaining: Mapping[str, Any] = field(
        metadata=entry(key="remaining_covariance", kind=dict[str, list[list[float]]])
    )

    @staticmethod
    def of(
        file: CalibrationFile,
        several: Sequence[Calibration],
        estimates: Mapping[str, Mapping[str, float]],
        remaining: Mapping[str, Any],
    ) -> CalibrationResult:
        """Return the calibration of each quantity by the positions of a file."""
        return CalibrationResult(
            file=file,
            several=several,
            name=file.scheme.name,
            positions=len(file.scheme.positions),
            rank={one.quantity: one.rank for one in several},
            unseen={one.quantity: one.unseen for one in several},
            coefficients=[
                CoefficientRow.of(file, one, name, estimates) for one in several for name in one.names
            ],
            remaining=remaining,
        )

    def text(self) -> str:
        """Return the observable coefficients of each quantity with their deviations."""
        lines = [
            f"{self.file.scheme.name}: least squares of {3 * len(self.file.scheme.positions)} errors of each quantity"
        ]
        for one in self.several:
            unit = _SHOWN[one.quantity]
            seen = f"{one.rank} of {len(one.names)} coefficients are seen"
            lost = "; ".join(_combination(row) for row in one.unseen)
            seen += f"; no position shows {lost}" if lost else ""
            lines += ["", f"{one.quantity}, noise {self.file.sigma[one.quantity]:g} {unit}: {seen}", ""]
            rows = [row for row in self.coefficients if row.quantity == one.quantity]
            names = ["coefficient", "unit", "deviation", "uncertainty"]
            names += ["estimate"] if any(row.estimate is not None for row in rows) else []
            lines += reader_table(rows, CoefficientRow, *names).lines()
        lines += [
            "",
            "deviation: for noise of 1; uncertainty: times the noise of the file; -: cannot be estimated",
        ]
        for quantity, covariance in self.remaining.items():
            sigmas = ", ".join(f"{value:.3g}" for value in np.sqrt(np.diag(covariance)))
            lines.append(
                f"left after compensation, {quantity} about or along x, y, z: {sigmas} {_SHOWN[quantity]}"
            )
        return "\n".join(lines)


def _combination(one: Mapping[str, Any]) -> str:
    """Return a combination of coefficients as text."""
    parts = [name if value == 1 else f"({value}) {name}" for name, value in one.items()]
    return " + ".join(parts)


def calibration_image(result: CalibrationResult, path: str | Path) -> bytes:
    """Return the uncertainty of every coefficient as bars, a panel for each quantity; unseen ones are marked."""
    file, several = result.file, result.several
    figure, grid = figures.grid_of_axes(1, len(several), (5.2 * len(several), 5.0))
    for axes, one in zip(grid[0], several, strict=True):
        names = list(one.names)[::-1]
        values = [(one.deviations[name] or 0.0) * file.sigma[one.quantity] for name in names]
        axes.barh(names, values, color=figures.COLOURS[0], height=0.6)
        for place, name in enumerate(names):
            if name in one.lost:
                axes.text(0, place, "  cannot be seen", va="center", fontsize=8, color=figures.COLOURS[1])
        figures.style(axes)
        axes.set_title(one.quantity, loc="left", fontsize=10)
        axes.set_xlabel(f"uncertainty, {_SHOWN[one.quantity]}")
    figures.title(figure, f"{file.scheme.name}: uncertainty of the coefficients, one standard deviation")
    return figures.image(figure, path)
