"""Separates rate and acceleration: six torques of three mass-unbalanced gyros, inverted from a description of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from typing import Any

import sympy as sp

from strapgen.ir.exceptions import InputError
from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder

MICHELIN = (
    "J. L. Michelin and P. Masson, Strapdown Inertial Systems for Tactical Missiles Using Mass Unbalanced Two-Axis "
    "Rate Gyros, AGARD Lecture Series 133 (1984)"
)
#: The mass unbalance that all gyros of a layout share, in rad/s per m/s^2; a kernel takes its reciprocal.
UNBALANCE = sp.Symbol("B", positive=True)

X, Y, Z = (sp.Matrix(axis) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)))

TORQUES = Signal.labelled(
    "torque_increment",
    "M",
    ("x1", "y1", "x2", "y2", "x3", "y3"),
    unit="rad",
    meaning="angle increments of the cycle about the torquer axes x and y of gyros 1, 2 and 3, mass unbalance included",
    bound=Fraction(1, 2),
    over="cycle",
)
RECIPROCAL = Signal.scalar(
    "unbalance_reciprocal",
    unit="(m/s)/rad",
    meaning="1/B, the reciprocal of the mass unbalance of the gyros",
    bound=Fraction(1024),
)
UNBALANCE_INPUT = Signal.scalar(
    "unbalance",
    unit="rad/(m/s)",
    meaning="B, the mass unbalance of the gyros",
    bound=Fraction(1, 32),
)
INCREMENT = Signal.vector(
    "increment",
    "d",
    unit="rad",
    meaning="angle increment of the cycle, body axes",
    bound=Fraction(3, 10),
    frame="b",
    over="cycle",
)
VELOCITY_INCREMENT = Signal.vector(
    "velocity_increment",
    "dv",
    unit="m/s",
    meaning="velocity increment of the cycle, body axes",
    bound=Fraction(4),
    frame="b",
    over="cycle",
)


@dataclass(frozen=True)
class TwoAxisGyro:
    """A gyro with two torquer axes and a mass unbalance along its spin axis.

    >>> TwoAxisGyro(X, Y, 2 * UNBALANCE).spin.T
    Matrix([[0, 0, 1]])
    """

    #: Its torquer axes as unit vectors in body axes; the spin axis is x cross y
    x: sp.Matrix
    y: sp.Matrix
    #: Its mass unbalance in rad/s per m/s^2: an exact number, or a multiple of `UNBALANCE`
    unbalance: sp.Expr

    def __post_init__(self) -> None:
        axes = [sp.Matrix(axis).applyfunc(sp.sympify) for axis in (self.x, self.y)]
        for name, axis in zip("xy", axes, strict=True):
            if axis.shape != (3, 1) or sp.simplify(axis.dot(axis) - 1) != 0:
                raise InputError(f"torquer axis {name} is {list(axis)}; a vector of length 1 is needed")
            object.__setattr__(self, name, sp.ImmutableMatrix(axis))
        if sp.simplify(axes[0].dot(axes[1])) != 0:
            raise InputError(
                f"torquer axes {list(axes[0])} and {list(axes[1])} are not perpendicular, as they must be"
            )
        object.__setattr__(self, "unbalance", sp.sympify(self.unbalance))

    @property
    def spin(self) -> sp.Matrix:
        """The spin axis in body axes."""
        return sp.Matrix(self.x).cross(sp.Matrix(self.y)).applyfunc(sp.simplify)

    def turned(self, angle: Any) -> TwoAxisGyro:
        """Return the gyro with its torquers turned about the spin axis by an exact angle in rad.

        >>> TwoAxisGyro(X, Y, 0).turned(sp.pi / 2).x.T
        Matrix([[0, 1, 0]])
        """
        cosine, sine = sp.cos(angle), sp.sin(angle)
        return TwoAxisGyro(cosine * self.x + sine * self.y, cosine * self.y - sine * self.x, self.unbalance)


def canonical_layout(second: Any = UNBALANCE, third: Any = -UNBALANCE) -> tuple[TwoAxisGyro, ...]:
    """Return the gyros of section 3.1, torquers along body axes, with the unbalances of gyros 2 and 3; B1 is 0."""
    return (TwoAxisGyro(Z, -Y, 0), TwoAxisGyro(X, -Z, second), TwoAxisGyro(Y, -X, third))


def diagonal_layout() -> tuple[TwoAxisGyro, ...]:
    """Return the gyros of (4.7), torquers at 45 degrees to the body axes; B1 is 0 and B2 = -B3 = B."""
    c = sp.sqrt(2) / 2
    return (
        TwoAxisGyro(-c * (Y + Z), -c * (Y - Z), 0),
        TwoAxisGyro(c * (X - Y), -c * (X + Y), UNBALANCE),
        TwoAxisGyro(-c * (X - Z), c * (X + Z), -UNBALANCE),
    )


def measurement_matrix(gyros: Sequence[TwoAxisGyro], sign: int) -> sp.Matrix:
    """Return the matrix from rate and acceleration to torques: M = W + s B A on every torquer axis.

    `sign`: s: -1 as in section 3.1 of the source, or 1 as in its section 4.
    """
    if len(gyros) != 3:
        raise InputError(f"the layout has {len(gyros)} gyros; three are needed")
    if sign not in (-1, 1):
        raise InputError(f"sign is {sign}; 1 or -1 is needed")
    return sp.Matrix(
        [[*axis, *(sign * gyro.unbalance * axis)] for gyro in gyros for axis in (gyro.x, gyro.y)]
    )


def separation_matrix(gyros: Sequence[TwoAxisGyro], sign: int) -> sp.Matrix:
    """Return the inverse of `measurement_matrix`: rate and acceleration from torques.

    >>> separation_matrix(canonical_layout(), -1)[0, :]
    Matrix([[0, 0, 1/2, 0, 0, -1/2]])
    """
    return _separation_matrix(tuple(gyros), sign).as_mutable()


@cache
def _separation_matrix(gyros: tuple[TwoAxisGyro, ...], sign: int) -> sp.ImmutableMatrix:
    """Return the inverse, which takes seconds, once for each layout."""
    matrix = measurement_matrix(gyros, sign)
    return (_covariance(gyros, sign) * matrix.T).applyfunc(sp.simplify).as_immutable()


@cache
def _covariance(gyros: tuple[TwoAxisGyro, ...], sign: int) -> sp.ImmutableMatrix:
    """Return the covariance of rates and accelerations for equal, independent noise of 1 on all torques.

    It is the inverse of M^T M, to which a gyro adds its unbalance and the projection across its spin axis alone: the
    angle of the torquers about it cancels.
    """
    gram = _gram(gyros, sign)
    if _vanishes(sp.expand(gram.det(method="berkowitz"))):
        motion = [sp.simplify(element) for element in gram.nullspace(simplify=True)[0]]
        raise InputError(
            f"the layout is singular: no torquer measures the rate {tuple(motion[:3])} together with the acceleration "
            f"{tuple(motion[3:])}; unbalances are {', '.join(str(gyro.unbalance) for gyro in gyros)}"
        )
    return gram.inv().applyfunc(sp.simplify).as_immutable()


def _vanishes(expanded: sp.Expr) -> bool:
    """Return whether an expression is 0: a polynomial with rational coefficients is not, if it has terms."""
    symbols = sorted(expanded.free_symbols, key=str)
    if symbols and expanded.is_polynomial() and sp.Poly(expanded, *symbols).domain in (sp.ZZ, sp.QQ):
        return False
    return bool(sp.simplify(expanded) == 0)


def _gram(gyros: Sequence[TwoAxisGyro], sign: int) -> sp.Matrix:
    """Return M^T M, 6 x 6, of the matrix M from rate and acceleration to torques."""
    measurement_matrix(gyros, sign)  # refuses what is no layout
    total = sp.zeros(6, 6)
    for gyro in gyros:
        across = sp.eye(3) - gyro.spin * gyro.spin.T
        factors = sp.Matrix([1, sign * gyro.unbalance])
        total += sp.kronecker_product(factors * factors.T, across)
    return total.applyfunc(sp.expand)


def determinant(gyros: Sequence[TwoAxisGyro], sign: int) -> sp.Expr:
    """Return the magnitude of the determinant of `measurement_matrix`, which the angles of the torquers leave alone.

    >>> determinant(diagonal_layout(), 1)
    2*B**3
    """
    return sp.sqrt(sp.factor(sp.simplify(_gram(gyros, sign).det(method="berkowitz"))))


def noise_gains(gyros: Sequence[TwoAxisGyro], sign: int) -> tuple[sp.Expr, ...]:
    """Return the noise of rates and accelerations for equal, independent noise of 1 on all torques.

    Returns: three gains of the rates, without unit, and three of the accelerations, in m/s^2 per rad/s.

    >>> noise_gains(canonical_layout(), -1)
    (sqrt(2)/2, 1, 1, sqrt(2)/(2*B), sqrt(2)/B, sqrt(2)/B)
    """
    squares = _covariance(tuple(gyros), sign).diagonal()
    return tuple(sp.simplify(sp.sqrt(sp.factor(square))) for square in squares)


def separating_kernel(name: str, title: str, source: str, gyros: Sequence[TwoAxisGyro], sign: int) -> Kernel:
    """Return the kernel that separates rate and acceleration for a layout.

    Returns: input ``torque_increment`` (6,) in rad and, where the unbalances are multiples of B,
    ``unbalance_reciprocal`` 1/B in m/s per rad; where they have other symbols or numbers beside B, each symbol
    itself, as `measuring_kernel` takes it. Outputs ``increment`` (3,) in rad and ``velocity_increment`` (3,) in
    m/s, body axes.
    """
    inverse = separation_matrix(gyros, sign)
    build = KernelBuilder()
    torques = build.input(TORQUES)
    if all(gyro.unbalance.coeff(UNBALANCE) * UNBALANCE == gyro.unbalance for gyro in gyros):
        reciprocal = build.scalar(RECIPROCAL)
        inverse = inverse.applyfunc(sp.expand).subs(UNBALANCE, 1 / reciprocal)
    else:
        inverse = _with_inputs(build, inverse)
    motion = inverse * torques
    build.output(INCREMENT, motion[:3])
    build.output(VELOCITY_INCREMENT, [sp.factor_terms(element) for element in motion[3:]])
    return build.kernel(name, title, source)


def _with_inputs(build: KernelBuilder, matrix: sp.Matrix) -> sp.Matrix:
    """Return a matrix with an input in the place of every symbol of an unbalance."""
    values = {}
    for symbol in sorted(matrix.free_symbols, key=str):
        name = f"{UNBALANCE_INPUT.name}_{symbol.name.removeprefix('B')}".rstrip("_")
        signal = replace(UNBALANCE_INPUT, name=name, elements=(name,))
        if symbol != UNBALANCE:
            signal = replace(signal, meaning=f"{symbol}, a mass unbalance of the gyros")
        values[symbol] = build.scalar(signal)
    return matrix.subs(values)


def measuring_kernel(name: str, title: str, source: str, gyros: Sequence[TwoAxisGyro], sign: int) -> Kernel:
    """Return the inverse of `separating_kernel`: the torques that true increments make.

    Returns: inputs ``increment`` (3,) in rad, ``velocity_increment`` (3,) in m/s, body axes, and every symbol
    of the unbalances in rad per m/s: ``unbalance`` for B, ``unbalance_2`` for B2; output ``torque_increment``
    (6,) in rad.
    """
    matrix = measurement_matrix(gyros, sign)
    build = KernelBuilder()
    motion = sp.Matrix.vstack(build.input(INCREMENT), build.input(VELOCITY_INCREMENT))
    matrix = _with_inputs(build, matrix)
    build.output(TORQUES, [sp.expand(element) for element in matrix * motion])
    return build.kernel(name, title, source)


#: Layouts of the source: the gyros, the sign, words for titles and for the source of the kernel.
_LAYOUTS = {
    "canonical": (canonical_layout, -1, "torquers along body axes", "section 3.1, printed"),
    "45": (diagonal_layout, 1, "torquers at 45 degrees", "(4.7) and (4.8), repaired"),
}


def separate(layout: str) -> Kernel:
    """Return the separation of a layout of the source.

    `layout`: "canonical", section 3.1, or "45", (4.7).
    """
    gyros, sign, words, equations = _LAYOUTS[layout]
    title = f"Separation of rate and acceleration: {words}"
    return separating_kernel(f"separate-{layout}", title, f"{MICHELIN}, {equations}", gyros(), sign)


def measure(layout: str) -> Kernel:
    """Return the torques of a layout of the source, which `separate` takes apart; parameters are its."""
    gyros, sign, words, equations = _LAYOUTS[layout]
    title = f"Torques of mass-unbalanced gyros: {words}"
    return measuring_kernel(f"torques-{layout}", title, f"{MICHELIN}, {equations}", gyros(), sign)
