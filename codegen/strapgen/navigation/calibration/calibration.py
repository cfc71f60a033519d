"""What a scheme of positions tells of the coefficients of an inertial measurement unit: rank, covariance, estimates.

A unit at rest is turned into many positions; in each, the errors of its rate and of its acceleration are measured.
They are linear in the coefficients of the error model, D = a X, and the least squares of all positions are
X = (a'a)^-1 a'D with the covariance sigma^2 (a'a)^-1. The rows of a are derivatives of the kernel `imu-errors`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from strapgen import catalogue, pipeline
from strapgen.ir.exceptions import InputError
from strapgen.kernel.kernel import evaluate_stages

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
    """What a scheme tells of the coefficients of one quantity."""

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
        """The coefficients that cannot be estimated: those in a combination that leaves no trace."""
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
        """Return the covariance of the compensated quantity that estimated coefficients leave, (3, 3).

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
    """Return what a scheme tells of the coefficients of a quantity.

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
