"""Calibration of an inertial measurement unit at rest and by turning: rank, covariance and estimates of coefficients.

A unit is put into many positions, turned about its axes, and all that at several temperatures; each time, the errors of
its rate and of its acceleration are measured. They are linear in the coefficients of the error model, D = a X, and the
least squares are X = (a'a)^-1 a'D with the covariance sigma^2 (a'a)^-1. The rows of a are derivatives of the kernel
`imu-errors`, and of the even and odd parts U and V of the scale factors of the gyros:

    U = U1 |w| + U2 w^2,    V = V0 sign w + V1 w + V2 w |w|,    error of the rate w: w (K + U + V)
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

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

if TYPE_CHECKING:
    from strapgen.navigation.turntable import SimulatedRun

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


#: deg/h of 1e-6 of a deg/s.
_PPM = sp.Rational(3600, 10**6)


@cache
def _columns(quantity: str) -> dict[str, sp.Matrix]:
    """Return what each coefficient adds to an error in deg/h or micro-g, by a rate in deg/s about an axis, and by g."""
    columns = {
        name: column * _PPM if name[0] == "K" else column
        for name, column in error_derivatives(quantity).items()
        if name[0] not in "JH"  # products of rates about two axes
    }
    if quantity == "rate":
        for number, (axis, w) in enumerate(zip("xyz", RATE, strict=True)):
            size, unit = sp.Abs(w), _PPM * sp.eye(3)[:, number]
            parts = {"U1": w * size, "U2": w * size**2, "V0": size, "V1": w**2, "V2": w**2 * size}
            columns |= {f"{name}_{axis}": part * unit for name, part in parts.items()}
    return columns


def at_rest(quantity: str) -> tuple[str, ...]:
    """Return the names of the coefficients of a quantity that a unit at rest can show, in the order of the model."""
    return tuple(Scheme("", ()).columns(quantity))


@dataclass(frozen=True)
class Scheme:
    """Positions of a unit at rest, turns about its axes, and the temperatures at which all are measured."""

    name: str
    #: The specific force in body axes in the unit of gravity, as exact numbers
    positions: tuple[tuple[sp.Expr, ...], ...]
    #: Axes that point up and are turned, and their rates in deg/s, as exact numbers
    turns: tuple[tuple[int, sp.Expr], ...] = ()
    #: In deg C; without one, the temperature is always the same
    temperatures: tuple[float, ...] = ()

    def columns(self, quantity: str) -> dict[str, sp.Matrix]:
        """Return what such a scheme can show, by coefficient: functions of rate in deg/s and specific force in g."""
        turned = {axis for axis, _ in self.turns}
        still = {w: sp.S.Zero for axis, w in enumerate(RATE) if axis not in turned}
        powers = len({abs(rate) for _, rate in self.turns})
        columns = {
            name: column.xreplace(still)
            for name, column in _columns(quantity).items()
            if name[0] not in "UV" or int(name[1]) < powers
        }
        return {name: column for name, column in columns.items() if any(column)}

    def design(self, quantity: str) -> sp.Matrix:
        """Return the matrix a of a quantity: three rows for each position and turn, a column for each coefficient."""
        whole, identity = sp.Matrix.hstack(*self.columns(quantity).values()), sp.eye(3)
        states = [((0, 0, 0), position) for position in self.positions]
        states += [(rate * identity[axis, :], identity[axis, :]) for axis, rate in self.turns]
        rows = []
        for rate, position in states:
            values = map(sp.sympify, (*rate, *position))
            rows.append(whole.xreplace(dict(zip((*RATE, *ACCELERATION), values, strict=True))))
        return sp.Matrix.vstack(*rows)


@dataclass(frozen=True)
class Calibration:
    """Observability and covariance of the coefficients of one quantity in a scheme."""

    #: A key of `QUANTITIES`
    quantity: str
    #: The coefficients, in the order of the model
    names: tuple[str, ...]
    #: Exact rank of the matrix a
    rank: int
    #: Combinations of coefficients that leave no trace in any measurement, as exact numbers by the coefficient's
    #: name
    unseen: tuple[dict[str, sp.Expr], ...]
    design: sp.Matrix
    #: In deg C
    temperatures: tuple[float, ...] = ()

    @property
    def lost(self) -> tuple[str, ...]:
        """The coefficients that cannot be estimated: those in a combination that is not observable."""
        return tuple(name for name in self.names if any(name in one for one in self.unseen))

    @property
    def labels(self) -> tuple[str, ...]:
        """The coefficients, at several temperatures those at the first, and then what each gains by a degree."""
        return self.names + tuple(f"{name}{PER_DEGREE}" for name in self.names if self.temperatures)

    @cached_property
    def _inverse(self) -> Array:
        """(a'a)^-1 a', (N, rows)."""
        return np.asarray(np.linalg.pinv(np.array(self.design.evalf(30).tolist(), float), rcond=1e-9))

    @cached_property
    def _regression(self) -> Array:
        """The least squares of a straight line through values at the temperatures, (1 or 2, temperatures)."""
        if not self.temperatures:
            return np.ones((1, 1))
        warmer = np.array(self.temperatures) - self.temperatures[0]
        return np.asarray(np.linalg.pinv(np.stack([np.ones_like(warmer), warmer], axis=1)))

    @cached_property
    def covariance(self) -> Array:
        """(a'a)^-1 of the coefficients that can be estimated, zero for the others, (N, N)."""
        seen = np.array([name not in self.lost for name in self.names])
        result: Array = self._inverse @ self._inverse.T * np.outer(seen, seen)
        return result * float(self._regression[0] @ self._regression[0])

    @property
    def deviations(self) -> dict[str, float | None]:
        """Standard deviation of each coefficient in that of a measurement; None for one that cannot be estimated."""
        return self.deviations_by(np.ones(self.design.rows))

    def deviations_by(self, variances: Array) -> dict[str, float | None]:
        """Return the standard deviations of the coefficients by the variances of the rows of `design`, (rows,)."""
        lines = (self._regression**2).sum(axis=1)
        roots = np.sqrt(np.outer(lines, self._inverse**2 @ variances)).ravel()
        return {
            name: None if name.removesuffix(PER_DEGREE) in self.lost else float(root)
            for name, root in zip(self.labels, roots, strict=True)
        }

    def estimate(self, errors: Any) -> dict[str, float]:
        """Return the least squares of measured errors.

        `errors` (N, 3): the error of each position and turn, in the order of the scheme, for one temperature after the
        other.
        """
        if self.unseen:
            raise InputError(
                f"the scheme cannot see {', '.join(self.lost)} of the {self.quantity}; other positions are needed"
            )
        return self.solved(errors)

    def solved(self, errors: Any) -> dict[str, float]:
        """Return the least squares of the coefficients that are seen, as `estimate`."""
        rows = np.asarray(errors, float).reshape(-1)
        needed = self._inverse.shape[1] * self._regression.shape[1]
        if len(rows) != needed:
            raise InputError(f"{len(rows) // 3} rows of errors are there for {needed // 3} measurements")
        values = self._regression @ rows.reshape(-1, self._inverse.shape[1]) @ self._inverse.T
        found = zip(self.labels, map(float, values.ravel()), strict=True)
        return {name: value for name, value in found if name.removesuffix(PER_DEGREE) not in self.lost}

    def error_covariance(self, rate: Sequence[float], acceleration: Sequence[float]) -> Array:
        """Return the covariance of a quantity after compensation with estimated coefficients, (3, 3).

        `rate, acceleration` (3,): in rad/s, and in the unit of gravity, body axes. Coefficients that the scheme cannot
        show are taken for exact.
        """
        values = dict(zip((*RATE, *ACCELERATION), (*np.degrees(rate), *acceleration), strict=True))
        columns = _columns(self.quantity)
        parts = [np.array(columns[name].subs(values).tolist(), float)[:, 0] for name in self.names]
        jacobian = np.stack(parts, axis=1)
        result: Array = jacobian @ self.covariance @ jacobian.T
        return result


def calibrated(scheme: Scheme, quantity: str) -> Calibration:
    """Analyse a scheme for the coefficients of a quantity.

    >>> one = calibrated(Scheme("up and down", ((0, 0, 1), (0, 0, -1))), "rate")
    >>> one.rank, len(one.names)
    (6, 15)
    """
    design, names = scheme.design(quantity), tuple(scheme.columns(quantity))
    matrix = sp.polys.matrices.DomainMatrix.from_Matrix(design, extension=True).to_field()
    null = matrix.nullspace().to_Matrix()
    unseen = []
    for k in range(null.rows):
        row = null.row(k)
        first = next(value for value in row if value != 0)
        unseen.append(
            {name: sp.nsimplify(value / first) for name, value in zip(names, row, strict=True) if value != 0}
        )
    rank = len(names) - null.rows
    return Calibration(quantity, names, rank, tuple(unseen), design, scheme.temperatures)


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
#: How the name of what a coefficient gains by a degree ends.
PER_DEGREE = " per C"
#: Axes that are turned.
_AXES = ("x", "y", "z", "xy", "xz", "yz", "xyz")
#: By how much the length of a position may differ from 1.
_LENGTH = 1e-6

Rows = tuple[tuple[float, float, float], ...]


@dataclass(frozen=True)
class PositionsFile:
    """Positions of a unit at rest, turns of it at temperatures and headings, and the errors measured in them."""

    positions: Annotated[
        tuple[tuple[Number, Number, Number], ...],
        Key("Specific force in body axes, of length 1", "g", least=1, most=2000),
    ] = ()
    name: Annotated[str, Key("Name of the scheme; by default that of the file")] = ""
    rates_deg_s: Annotated[
        tuple[Fraction, ...],
        Key("Rates to both sides about each axis, which points up; 0.01 to 1000", "deg/s", least=1, most=40),
    ] = ()
    axes: Annotated[str, Key("Axes that are turned", choices=_AXES)] = _AXES[-1]
    temperatures_c: Annotated[
        tuple[float, ...], Key("Temperatures at which all is measured", "deg C", least=2, most=40)
    ] = ()
    headings_deg: Annotated[
        tuple[float, ...], Key("Headings of a level table that finds north", "deg", least=2, most=360)
    ] = ()
    latitude_deg: Annotated[float, Key("Latitude of the table", "deg", least=-89, most=89)] = 45.0
    duration_s: Annotated[
        int, Key("Time of a measurement; at a rate the nearest whole turns", "s", least=1, most=100000)
    ] = 360
    pause_s: Annotated[int, Key("Rest before each", "s", least=0, most=100000)] = 0
    rate_sigma_deg_h: Annotated[float, Key("Standard deviation of a measured rate", "deg/h", above=0)] = 1.0
    acceleration_sigma_micro_g: Annotated[
        float, Key("Standard deviation of a measured acceleration", "micro-g", above=0)
    ] = 1.0
    rate_errors_deg_h: Annotated[
        Rows | None, Key("Error of the rate in each position, then turn, indicated less true", "deg/h")
    ] = None
    acceleration_errors_micro_g: Annotated[
        Rows | None, Key("Error of the acceleration in each of them, indicated less true", "micro-g")
    ] = None

    def __post_init__(self) -> None:
        if not (self.positions or self.rates_deg_s or self.headings_deg):
            needed = "a list of lists of 3 numbers, rates_deg_s or headings_deg"
            raise InputError(f"positions is missing; {needed} is needed")
        for number, position in enumerate(self.positions, 1):
            length = math.hypot(*map(float, position))
            if abs(length - 1) > _LENGTH:
                raise InputError(
                    f"positions[{number}] has the length {length:.6g}; 1 is needed, the unit of gravity"
                )
        for number, rate in enumerate(self.rates_deg_s, 1):
            if not Fraction(1, 100) <= rate <= 1000:
                raise InputError(f"rates_deg_s[{number}] is {float(rate):g}; 0.01 to 1000 is needed")
        for name in ("rates_deg_s", "temperatures_c", "headings_deg"):
            if len({*getattr(self, name)}) < len(getattr(self, name)):
                raise InputError(f"{name} has a number twice")
        turns = np.exp(1j * np.radians(self.headings_deg))
        if len(turns) and abs(turns.mean()) > 1 - _LENGTH:
            raise InputError("headings_deg are all the same direction; two that differ are needed")
        count = (len(self.positions) + len(self.scheme.turns)) * max(1, len(self.temperatures_c))
        for quantity, unit in UNITS.items():
            rows = getattr(self, key := f"{quantity}_errors_{unit}")
            if rows is not None and len(rows) != count:
                raise InputError(
                    f"{key} has {len(rows)} rows; one for each of {count} measurements is needed"
                )

    @property
    def scheme(self) -> Scheme:
        """The positions and turns as exact numbers."""
        positions = tuple(tuple(map(sp.sympify, row)) for row in self.positions)
        turned = (
            (axis, sign * sp.sympify(rate))
            for axis in map("xyz".index, self.axes)
            for rate in self.rates_deg_s
            for sign in (1, -1)
        )
        return Scheme(self.name, positions, tuple(turned), self.temperatures_c)

    @property
    def sigma(self) -> dict[str, float]:
        """Standard deviation of a measurement by quantity, in `UNITS`."""
        return {quantity: getattr(self, f"{quantity}_sigma_{unit}") for quantity, unit in UNITS.items()}

    @property
    def errors(self) -> dict[str, Rows]:
        """Rows of three errors, indicated less true, by quantity, in `UNITS`; of those that were measured."""
        rows = {quantity: getattr(self, f"{quantity}_errors_{unit}") for quantity, unit in UNITS.items()}
        return {quantity: stated for quantity, stated in rows.items() if stated is not None}


POSITIONS = UserFile("a scheme of positions", PositionsFile, 1 << 20)


def read(path: str | Path) -> PositionsFile:
    """Read a scheme of positions and turns."""
    file = POSITIONS.read(path)
    return file if file.name else replace(file, name=Path(path).stem)


#: Units as a reader has them, and those of a coefficient by the letters of its name.
_SHOWN = {"rate": "deg/h", "acceleration": "micro-g"}
_UNITS = {
    "D0": "deg/h", "K": "ppm", "B": "deg/h/g", "E": "deg/h/g^2", "U1": "ppm/(deg/s)", "U2": "ppm/(deg/s)^2",
    "V0": "ppm", "V1": "ppm/(deg/s)", "V2": "ppm/(deg/s)^2",
    "A0": "micro-g", "G": "micro-g/(deg/s)", "M": "micro-g/g", "N": "micro-g/g^2",
}  # fmt: skip


def _texts(unseen: Mapping[str, Sequence[Mapping[str, Any]]]) -> dict[str, list[dict[str, str]]]:
    return {
        quantity: [{name: str(value) for name, value in row.items()} for row in rows]
        for quantity, rows in unseen.items()
    }


@dataclass(frozen=True)
class CoefficientRow:
    """Observability, deviation and estimate of a coefficient, and what simulated runs make of it."""

    quantity: str
    coefficient: str = field(metadata=entry("coefficient", align="<"))
    unit: str = field(metadata=entry("unit", align="<"))
    #: Standard deviation for noise of 1; None if the coefficient cannot be estimated
    deviation: float | None = field(metadata=entry("deviation", ".5f"))
    #: The same for the noise of the file, or of the sensors that are simulated, in the unit
    uncertainty: float | None = field(metadata=entry("uncertainty", ".3g"))
    #: From the errors of the file, in the unit
    estimate: float | None = field(metadata=entry("estimate", ".6g"))
    #: Mean of the estimates of simulated runs, and standard deviation of their errors, in the unit
    mean: float | None = field(metadata=entry("mean of runs", ".4g"))
    runs_deviation: float | None = field(metadata=entry("error in runs", ".3g"))

    @staticmethod
    def of(
        one: Calibration,
        uncertainties: Mapping[str, float | None],
        estimates: Mapping[str, float],
        runs: Sequence[SimulatedRun],
    ) -> Iterator[CoefficientRow]:
        """Yield the coefficients of a quantity."""
        for name, deviation in one.deviations.items():
            unit = _UNITS[name.partition("_")[0]] + "/C" * name.endswith(PER_DEGREE)
            mean = scatter = None
            if runs and deviation is not None:
                mean = float(np.mean([run.estimates[name] for run in runs]))
                scatter = float(np.std([run.errors[name] for run in runs], ddof=1))
            known = deviation, uncertainties[name], estimates.get(name), mean, scatter
            yield CoefficientRow(one.quantity, name, unit, *known)


@dataclass(frozen=True)
class HeadingRow:
    """Error of the heading that a level unit finds by the rotation of the earth."""

    headings: int = field(metadata=entry("headings"))
    #: Standard deviation to first order, by the noise alone without sensors that are simulated
    uncertainty_deg: float = field(metadata=entry("uncertainty", ".4g", unit="deg"))
    #: Mean and standard deviation in simulated runs
    mean_deg: float | None = field(metadata=entry("mean of runs", ".4g", unit="deg"))
    runs_deviation_deg: float | None = field(metadata=entry("in runs", ".4g", unit="deg"))


@dataclass(frozen=True)
class CalibrationResult(Result):
    """Observability, deviations and estimates of the coefficients of an inertial measurement unit."""

    rows_in = "coefficients"
    drawn_by: ClassVar[str] = f"{__name__}:calibration_image"

    file: PositionsFile = field(metadata=INTERNAL)
    several: Sequence[Calibration] = field(metadata=INTERNAL)
    name: str
    #: Number of positions
    positions: int
    #: Number of turns, to either side, and of temperatures
    turns: int
    temperatures: int
    #: Number of simulated runs
    runs: int
    #: Number of coefficients that are seen, by quantity
    rank: dict[str, int]
    #: Combinations that leave no trace, by quantity: factors by coefficient
    unseen: Mapping[str, Sequence[Mapping[str, Any]]] = field(
        metadata=entry(write=_texts, kind=dict[str, list[dict[str, str]]])
    )
    coefficients: list[CoefficientRow]
    #: Heading at the first heading alone, where a bias is taken for none, and with biases at all headings
    gyrocompass: list[HeadingRow]
    #: Covariance of the compensated quantity in flight, in squares of its unit; empty without a flight
    remaining: Mapping[str, Any] = field(
        metadata=entry(key="remaining_covariance", kind=dict[str, list[list[float]]])
    )

    @staticmethod
    def of(
        file: PositionsFile,
        several: Sequence[Calibration],
        estimates: Mapping[str, Mapping[str, float]],
        remaining: Mapping[str, Any],
        gyrocompass: Sequence[HeadingRow] = (),
        variances: Mapping[str, Array] | None = None,
        runs: Sequence[SimulatedRun] = (),
    ) -> CalibrationResult:
        """Return the calibration of each quantity by a file, and by runs on sensors whose noise has variances."""
        rows: list[CoefficientRow] = []
        for one in several:
            noise = variances or {one.quantity: np.full(one.design.rows, file.sigma[one.quantity] ** 2)}
            uncertainties = one.deviations_by(noise[one.quantity].ravel()[: one.design.rows])
            rows += CoefficientRow.of(one, uncertainties, estimates.get(one.quantity, {}), runs)
        return CalibrationResult(
            file=file,
            several=several,
            name=file.name,
            positions=len(file.positions),
            turns=len(file.scheme.turns),
            temperatures=len(file.temperatures_c),
            runs=len(runs),
            rank={one.quantity: one.rank for one in several},
            unseen={one.quantity: one.unseen for one in several},
            coefficients=rows,
            gyrocompass=[*gyrocompass],
            remaining=remaining,
        )

    def text(self) -> str:
        """Return the observable coefficients of each quantity with their deviations."""
        measured = (self.positions + self.turns) * max(1, self.temperatures)
        lines = [self.name + f": least squares of {3 * measured} errors of each quantity" * (measured > 0)]
        for one in self.several:
            unit = _SHOWN[one.quantity]
            seen = f"{one.rank} of {len(one.names)} coefficients are seen"
            lost = "; ".join(_combination(row) for row in one.unseen)
            seen += f"; no {'turn or ' if self.turns else ''}position shows {lost}" if lost else ""
            noise = f", noise {self.file.sigma[one.quantity]:g} {unit}" if not self.runs else ""
            lines += ["", f"{one.quantity}{noise}: {seen}", ""]
            rows = [row for row in self.coefficients if row.quantity == one.quantity]
            names = ["coefficient", "unit", "deviation", "uncertainty"]
            for name in ("estimate", "mean", "runs_deviation"):
                names += [name] if any(getattr(row, name) is not None for row in rows) else []
            lines += reader_table(rows, CoefficientRow, *names).lines()
        if measured:
            noise = "of the sensors" if self.runs else "of the file"
            meaning = (
                f"deviation: for noise of 1; uncertainty: times the noise {noise}; -: cannot be estimated"
            )
            lines += ["", meaning]
        if self.gyrocompass:
            lines += ["", f"heading at {self.file.latitude_deg:g} deg of latitude", ""]
            lines += reader_table(self.gyrocompass, HeadingRow).lines()
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
    """Return the uncertainty of every coefficient as bars, with runs as points; unseen ones are marked."""
    several = [one.quantity for one in result.several]
    units = {quantity: f"{_SHOWN[quantity]}, or unit of the coefficient" for quantity in several}
    units |= {"heading": "deg, by so many headings"} if result.gyrocompass else {}
    rows = [(r.quantity, r.coefficient, r.uncertainty, r.runs_deviation) for r in result.coefficients]
    found = result.gyrocompass
    rows += [("heading", f"{r.headings}", r.uncertainty_deg, r.runs_deviation_deg) for r in found]
    height = max(5.0, *(0.2 * sum(row[0] == name for row in rows) for name in units))
    figure, grid = figures.grid_of_axes(1, len(units), (5.2 * len(units), height))
    for axes, (quantity, unit) in zip(grid[0], units.items(), strict=True):
        for _, name, value, scatter in [row for row in rows[::-1] if row[0] == quantity]:
            axes.barh(name, value or 0.0, color=figures.COLOURS[0], height=0.6)
            if value and scatter:
                axes.plot(scatter, name, ".", color=figures.COLOURS[1])
            if value is None:
                style = {"va": "center", "fontsize": 8, "color": figures.COLOURS[1]}
                axes.text(0, name, "  cannot be seen", transform=axes.get_yaxis_transform(), **style)
        if result.turns and any(row[2] for row in rows if row[0] == quantity):  # from ppm to ppm/(deg/s)^2
            axes.set_xscale("log")
        figures.style(axes)
        axes.set_title(quantity, loc="left", fontsize=10)
        axes.set_xlabel(f"uncertainty, {unit}")
    figures.title(figure, f"{result.name}: uncertainty of the coefficients, one standard deviation")
    return figures.image(figure, path)
