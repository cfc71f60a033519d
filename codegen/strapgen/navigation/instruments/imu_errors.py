"""Derives the compensation of an inertial measurement unit, and its errors, from one structure of the error model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction

import sympy as sp

from strapgen.ir.exceptions import InputError
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import exact
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.instruments.gyro_model import LETTERS, ErrorStructure, products, source_structure
from strapgen.navigation.instruments.separation import INCREMENT, MICHELIN, VELOCITY_INCREMENT

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
