"""Derives the compensation of an inertial measurement unit, and its errors, from one structure of the error model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache

import sympy as sp

from strapgen.ir.exceptions import InputError
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import exact
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.instruments.separation import (
    INCREMENT,
    MICHELIN,
    UNBALANCE,
    VELOCITY_INCREMENT,
    TwoAxisGyro,
    diagonal_layout,
    separation_matrix,
)

CYCLE = Signal.scalar("cycle", unit="s", meaning="length of the cycle", bound=Fraction(1, 5))
CYCLE_RATE = Signal.scalar("cycle_rate", unit="1/s", meaning="1/cycle, cycles a second", bound=Fraction(500))

#: Name, unit, meaning and bound of the coefficients of every term, body axes: bounds are ten times those of a unit
#: whose biases are 3e-4 rad/s and 3e-3 m/s^2.
_COEFFICIENTS = {
    "D0": ("rate_bias", "rad/s", "constant error of the rate", Fraction(3, 1000)),
    "K": ("rate_scale", "1", "scale factors and misalignments of the rate", Fraction(9, 1000)),
    "J": ("anisoinertia", "s", "error of the rate by products of rates", Fraction(3, 1000)),
    "B": ("g_sensitivity", "(rad/s)/(m/s^2)", "error of the rate by acceleration", Fraction(7, 100000)),
    "E": (
        "anisoelasticity",
        "(rad/s)/(m/s^2)^2",
        "error of the rate by products of accelerations",
        Fraction(5, 10**6),
    ),
    "A0": ("acceleration_bias", "m/s^2", "constant error of the acceleration", Fraction(3, 100)),
    "G": ("rate_sensitivity", "(m/s)/rad", "error of the acceleration by rate", Fraction(9, 100)),
    "H": ("rate_products", "m", "error of the acceleration by products of rates", Fraction(3, 100)),
    "M": (
        "acceleration_scale",
        "1",
        "scale factors and misalignments of the acceleration",
        Fraction(9, 1000),
    ),
    "N": (
        "acceleration_products",
        "1/(m/s^2)",
        "error of the acceleration by products of accelerations",
        Fraction(6, 10**5),
    ),
}
_NOTES = (
    "The coefficients of products follow the order yz, zx, xy: J_xy is that of the rate x by rates z and x.",
    "cycle times cycle_rate is 1.",
)


class ErrorModel:
    """The error model (4.9) in increments, under construction in a kernel: its inputs, and the errors of a motion."""

    def __init__(
        self, build: KernelBuilder, structure: ErrorStructure, constants: Mapping[str, Fraction]
    ) -> None:
        known = {"cycle", *(symbol.name for symbol in structure.forms)}
        if unknown := sorted(set(constants) - known):
            raise InputError(
                f"the error model has no coefficient {unknown[0]}; allowed: {', '.join(sorted(known))}"
            )
        self.build = build
        self.structure = structure
        values = {name: exact(Fraction(value)) for name, value in constants.items()}
        if "cycle" in values:
            if values["cycle"] <= 0:
                raise InputError(f"cycle is {values['cycle']} s; a number above 0 is needed")
            self.cycle, self.cycle_rate = values["cycle"], 1 / values["cycle"]
        else:
            self.cycle, self.cycle_rate = build.scalar(CYCLE), build.scalar(CYCLE_RATE)
        self.values = {sp.Symbol(name, real=True): value for name, value in values.items()}
        self._declare_coefficients()

    def _declare_coefficients(self) -> None:
        """Declare the coefficients that are no constants as inputs, those of a term together."""
        for letter, (name, unit, meaning, bound) in _COEFFICIENTS.items():
            members = [s for s in self.structure.coefficients(letter) if s not in self.values]
            labels = [symbol.name.partition("_")[2] for symbol in members]
            if labels:
                about = f"{meaning}, body axes"
                self.build.input(
                    Signal.labelled(name, letter, labels, unit=unit, meaning=about, bound=bound, frame="b")
                )

    def errors(self, d: sp.Matrix, dv: sp.Matrix, suffix: str = "") -> tuple[sp.Matrix, sp.Matrix]:
        """Return the errors of an angle increment in rad and of a velocity increment in m/s.

        `d, dv`: increments of the cycle, rad and m/s, body axes.
        """
        p, r = (
            self.build.stage(
                Signal.labelled(
                    f"{name}_products{suffix}",
                    f"{prefix}{suffix}",
                    ("yz", "zx", "xy"),
                    unit=unit,
                    meaning=about,
                    frame="b",
                ),
                self.cycle_rate * products(vector),
            )
            for name, prefix, unit, about, vector in (
                ("angle", "p", "rad^2/s", "products of two angle increments over the cycle, body axes", d),
                (
                    "velocity",
                    "r",
                    "m^2/s^3",
                    "products of two velocity increments over the cycle, body axes",
                    dv,
                ),
            )
        )
        terms = (sp.Matrix([self.cycle]), d, p, dv, r)
        angle, velocity = (
            sum(
                (self._matrix(letter) * term for letter, term in zip(letters, terms, strict=True)),
                sp.zeros(3, 1),
            )
            for letters in LETTERS
        )
        return angle, velocity

    def _matrix(self, letter: str) -> sp.Matrix:
        return self.structure.matrices[letter].subs(self.values)


def _result(signal: Signal, name: str, meaning: str) -> Signal:
    """Return an output like an increment, with another name and meaning."""
    elements = tuple(f"{name}_{element}" for element in signal.elements)
    return replace(signal, name=f"{name}_{signal.name}", elements=elements, meaning=meaning, bound=None)


def _measured(signal: Signal, what: str) -> Signal:
    return replace(signal, meaning=f"{what} {signal.meaning}")


def imu_compensate(
    passes: int = 1,
    constants: Mapping[str, Fraction] | None = None,
    structure: ErrorStructure | None = None,
) -> Kernel:
    """Return the compensation of measured increments by the error model (4.9): true = measured - error.

    `constants`: exact values of coefficients, as "K_xx", and of "cycle" in s, which take the place of inputs.

    >>> imu_compensate().outputs[0].signal.unit
    'rad'
    """
    if passes not in (1, 2):
        raise InputError(f"passes is {passes}; 1 or 2 is needed")
    build = KernelBuilder()
    d, dv = (build.input(_measured(signal, "measured")) for signal in (INCREMENT, VELOCITY_INCREMENT))
    model = ErrorModel(build, structure or source_structure(), constants or {})
    angle, velocity = model.errors(d, dv)
    if passes == 2:
        first = [
            build.stage(_result(signal, "first", f"{signal.meaning}, after the first pass"), value)
            for signal, value in ((INCREMENT, d - angle), (VELOCITY_INCREMENT, dv - velocity))
        ]
        angle, velocity = model.errors(first[0], first[1], "_again")
    for signal, value in ((INCREMENT, d - angle), (VELOCITY_INCREMENT, dv - velocity)):
        build.output(_result(signal, "compensated", f"compensated {signal.meaning}"), value)
    return build.kernel(
        "imu-compensate" if passes == 1 else "imu-compensate-2",
        f"Compensation of an inertial measurement unit{'' if passes == 1 else ' in two passes'}",
        f"{MICHELIN}, (4.9) and Fig. 20, {'printed' if passes == 1 else 'second pass derived'}; structure derived "
        "from (4.1) to (4.8), (4.2) and (4.3) repaired",
        notes=_NOTES,
    )


def imu_errors(
    constants: Mapping[str, Fraction] | None = None, structure: ErrorStructure | None = None
) -> Kernel:
    """Return the errors of a unit by the error model (4.9): measured = true + error at the true values."""
    build = KernelBuilder()
    d, dv = (build.input(_measured(signal, "true")) for signal in (INCREMENT, VELOCITY_INCREMENT))
    model = ErrorModel(build, structure or source_structure(), constants or {})
    angle, velocity = model.errors(d, dv)
    for signal, value in ((INCREMENT, d + angle), (VELOCITY_INCREMENT, dv + velocity)):
        build.output(_result(signal, "measured", f"measured {signal.meaning}"), value)
    return build.kernel(
        "imu-errors",
        "Errors of an inertial measurement unit",
        f"{MICHELIN}, (4.9) and Fig. 20, printed; structure derived from (4.1) to (4.8), (4.2) and (4.3) repaired",
        notes=_NOTES,
    )


#: Error parameters of a gyro: scale factors, spin and torquer misalignments, fixed torques, cross unbalances,
#: anisoelasticities, anisoinertia and the deviation of the unbalance.
PARAMETERS = ("Sx", "Sy", "ax", "ay", "xx", "xy", "Gbx", "Gby", "Vx", "Vy", "dP", "D", "E", "J", "dB")

RATE = sp.Matrix(sp.symbols("W_x W_y W_z", real=True))
ACCELERATION = sp.Matrix(sp.symbols("A_x A_y A_z", real=True))


def products(vector: sp.Matrix) -> sp.Matrix:
    """Return the products of two elements of a vector, in the order yz, zx, xy."""
    x, y, z = vector
    return sp.Matrix([y * z, z * x, x * y])


#: The monomials of the error model in the order of its terms: constant, linear and products, of rate and acceleration.
TERMS = {
    "constant": sp.Matrix([1]),
    "rate": RATE,
    "rate products": products(RATE),
    "acceleration": ACCELERATION,
    "acceleration products": products(ACCELERATION),
}
#: The letters of the coefficients of (4.9): errors of the rate, then of the acceleration.
LETTERS = ("D0", "K", "J", "B", "E"), ("A0", "G", "H", "M", "N")


def parameters(number: int) -> dict[str, sp.Symbol]:
    """Return the symbols of the error parameters of a gyro by their names in `PARAMETERS`."""
    return {name: sp.Symbol(f"{name}{number}", real=True) for name in PARAMETERS}


def gyro_torques(W: sp.Matrix, A: sp.Matrix, unbalance: sp.Expr, error: dict[str, sp.Expr]) -> sp.Matrix:
    """Return the torques of one gyro, equations (4.1) and (4.2).

    `W, A`: rate in rad/s and acceleration in m/s^2 in the axes of the gyro: torquers x and y, spin z.
    `unbalance`: mass unbalance in rad/s per m/s^2.
    """
    e, B = error, unbalance + error["dB"]
    M = W + B * A
    elastic_x = (e["D"] * A[1] - e["E"] * A[0]) * A[2]
    elastic_y = (e["D"] * A[0] + e["E"] * A[1]) * A[2]  # the scans print a minus before it in (4.2)
    torque_x = e["Gbx"] + e["Vx"] * A[2] + e["dP"] * A[0] - elastic_x
    torque_y = e["Gby"] + e["Vy"] * A[2] + e["dP"] * A[1] + elastic_y
    return sp.Matrix(
        [
            (1 + e["Sx"]) * M[0] + e["J"] * W[0] * W[2] - e["ay"] * M[2] + e["xx"] * M[1] + torque_y,
            (1 + e["Sy"]) * M[1] + e["J"] * W[1] * W[2] + e["ax"] * M[2] - e["xy"] * M[0] - torque_x,
        ]
    )


def gyro_errors(number: int, W: sp.Matrix, A: sp.Matrix, unbalance: sp.Expr) -> sp.Matrix:
    """Return the errors of the torques of a gyro to first order in its error parameters, equation (4.3).

    Parameters are those of `gyro_torques`; the number of the gyro, 1 to 3, marks its error parameters.
    """
    symbols = parameters(number)
    none = dict.fromkeys(PARAMETERS, sp.S.Zero)
    exact = gyro_torques(W, A, unbalance, none)
    result = sp.zeros(2, 1)
    for name, symbol in symbols.items():
        # Only one parameter at a time, so that products of two of them do not appear.
        one = gyro_torques(W, A, unbalance, none | {name: symbol})
        result += (one - exact).applyfunc(sp.expand)
    return result


@dataclass(frozen=True)
class ErrorStructure:
    """The coefficients of the error model (4.9), and their positions in its matrices."""

    #: The matrix of every term by its letter, rows x, y, z: an entry is 0 or a multiple of a coefficient's
    #: symbol
    matrices: dict[str, sp.Matrix]
    #: Each coefficient as a linear form of the error parameters of the gyros
    forms: dict[sp.Symbol, sp.Expr]

    def coefficients(self, letter: str) -> tuple[sp.Symbol, ...]:
        """Return the coefficients of a term in row-major order."""
        entries = self.matrices[letter]
        return tuple(symbol for symbol in self.forms if entries.has(symbol))


def _coefficient_name(letter: str, row: int, column: int, columns: int) -> str:
    return f"{letter}_{'xyz'[row]}" + ("xyz"[column] if columns > 1 else "")


def _shared_entry(form: sp.Expr, forms: dict[sp.Symbol, sp.Expr], members: list[sp.Symbol]) -> sp.Expr | None:
    """Return an entry as a multiple of a coefficient before it; None if its linear form is a new one."""
    for symbol in members:
        before = forms[symbol]
        if before.free_symbols == form.free_symbols:
            parameter = min(form.free_symbols - {UNBALANCE}, key=str)
            ratio = sp.radsimp(form.coeff(parameter) / before.coeff(parameter))
            if ratio.is_number and sp.expand(form - ratio * before) == 0:
                return ratio * symbol
    return None


def _terms(error: sp.Expr, motion: list[sp.Symbol]) -> dict[tuple[int, ...], sp.Expr]:
    """Return the coefficients of an expanded error that are not 0, by the powers of rate and acceleration."""
    terms: dict[tuple[int, ...], sp.Expr] = {}
    for term in sp.Add.make_args(error):
        factors = term.as_powers_dict()
        powers = tuple(int(factors.get(symbol, 0)) for symbol in motion)
        rest = term / sp.prod(symbol**power for symbol, power in zip(motion, powers, strict=True))
        terms[powers] = terms.get(powers, sp.S.Zero) + rest
    return {powers: form for powers, form in terms.items() if form != 0}


def _errors(gyros: Sequence[TwoAxisGyro], sign: int) -> sp.Matrix:
    """Return the errors of the separated rate and acceleration, expanded."""
    errors = []
    for number, gyro in enumerate(gyros, 1):
        axes = [sp.Matrix(gyro.x), sp.Matrix(gyro.y), gyro.spin]
        W, A = (sp.Matrix([axis.dot(vector) for axis in axes]) for vector in (RATE, ACCELERATION))
        errors += [*gyro_errors(number, W, A, sign * gyro.unbalance)]
    return (separation_matrix(gyros, sign) * sp.Matrix(errors)).applyfunc(sp.expand)


def error_structure(gyros: Sequence[TwoAxisGyro], sign: int) -> ErrorStructure:
    """Derive the structure of the error model of a layout from the equations of its gyros.

    The errors of the torques (4.3) go through the separation of the layout. Entries of a matrix that are multiples of
    each other for any errors of the gyros share one coefficient, which is named after the first of them.

    >>> error_structure(diagonal_layout(), 1).matrices["J"]
    Matrix([
    [0, J_xy, J_xz],
    [0,    0, J_yz],
    [0, J_yz,    0]])
    """
    errors = _errors(gyros, sign)
    motion = [*RATE, *ACCELERATION]
    matrices: dict[str, sp.Matrix] = {}
    forms: dict[sp.Symbol, sp.Expr] = {}
    for first, letters in zip((0, 3), LETTERS, strict=True):
        remaining = [_terms(error, motion) for error in errors[first : first + 3, :]]
        for letter, monomials in zip(letters, TERMS.values(), strict=True):
            matrix = sp.zeros(3, len(monomials))
            members: list[sp.Symbol] = []
            for row, column in ((row, column) for row in range(3) for column in range(len(monomials))):
                powers = sp.Poly(monomials[column], *motion).monoms()[0]
                form = remaining[row].pop(powers, None)
                if form is None:
                    continue
                entry = _shared_entry(form, forms, members)
                if entry is None:
                    entry = sp.Symbol(_coefficient_name(letter, row, column, len(monomials)), real=True)
                    members.append(entry)
                    forms[entry] = form
                matrix[row, column] = entry
            matrices[letter] = matrix
        left = [powers for terms in remaining for powers in terms]
        if left:
            powers = left[0]
            monomial = sp.prod(symbol**power for symbol, power in zip(motion, powers, strict=True))
            raise InputError(f"the errors of this layout hold {monomial}, which (4.9) has no term for")
    return ErrorStructure(matrices, forms)


@cache
def source_structure() -> ErrorStructure:
    """Return the structure of (4.9) for the layout of the source, (4.7): Fig. 20."""
    return error_structure(diagonal_layout(), 1)
