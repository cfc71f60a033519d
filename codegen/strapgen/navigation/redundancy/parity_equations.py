"""Derives what redundant sensors give: parity equations and their means at rest, rates of triads and of all sensors."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy as sp

from strapgen.catalogue.coefficients import Number, root
from strapgen.ir import checks
from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import CYCLE, Signal, after
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.redundancy.geometry import HEXAD, SensorGeometry, Triad

SEBRING = (
    "D. L. Sebring, J. M. Perdzock and J. T. Young, Application of Multifunction Strapdown Inertial System, "
    "AGARD Lecture Series 133 (1984)"
)


@dataclass(frozen=True)
class SensorSet:
    """Sensors of one kind on a geometry."""

    #: What the names of its kernels end with
    name: str
    geometry: SensorGeometry
    #: A key of `KINDS`
    sensor: str = "gyro"
    #: Largest increment of a cycle that a sensor measures, in rad or m/s
    range: Fraction = Fraction(1, 8)
    #: The command that generates its kernels, if that is not ``strapgen generate``
    command: str = ""

    def __post_init__(self) -> None:
        checks.choice("sensor", self.sensor, KINDS)

    @property
    def unit(self) -> str:
        """Unit of the increments."""
        return KINDS[self.sensor][0]

    @property
    def word(self) -> str:
        """What the increments are."""
        return KINDS[self.sensor][1]

    def measurement(self, sensors: tuple[int, ...]) -> Signal:
        """Return the signal of the increments of some sensors."""
        about = f"{self.word} increments of the cycle, sensors {', '.join(map(str, sensors))}"
        return Signal.labelled(
            "measurement",
            "m",
            map(str, sensors),
            unit=self.unit,
            meaning=about,
            bound=self.range,
            over=CYCLE,
        )

    @property
    def all_sensors(self) -> tuple[int, ...]:
        """The numbers of the sensors."""
        return tuple(range(self.geometry.count))

    @property
    def parity(self) -> Signal:
        """The signal of the results of all parity equations."""
        largest = max(_whole_above(sum(map(abs, equation))) for equation in self.geometry.equations)
        return Signal.labelled(
            "parity",
            "p",
            map(equation_label, self.geometry.equations),
            unit=self.unit,
            meaning="results of the parity equations, zero without errors",
            bound=largest * self.range,
            over=CYCLE,
        )

    @property
    def increment(self) -> Signal:
        """The signal of the vector that the sensors measure."""
        meaning = f"{self.word} increment of the cycle, body axes"
        return Signal.vector("increment", "d", unit=self.unit, meaning=meaning, frame="b", over=CYCLE)


#: Kinds of sensors: the unit of their increments, and a word for it.
KINDS = {"gyro": ("rad", "angle"), "accelerometer": ("m/s", "velocity")}

#: The geometry of the source, with gyros.
HEXAD_SET = SensorSet("hexad", HEXAD)


def equation_label(equation: tuple[int, ...]) -> str:
    """Return the numbers of the sensors of an equation, such as 0123."""
    return "".join(str(number) for number, value in enumerate(equation) if value)


def _source(what: str, sensors: SensorSet) -> str:
    printed = "geometry printed, " if sensors.geometry == HEXAD else ""
    return f"{SEBRING}, {printed}{what} derived"


def parity(sensors: SensorSet = HEXAD_SET) -> Kernel:
    """Return the parity equations, which integers make exact in fixed point.

    Returns: input ``measurement`` (N,) in rad or m/s; output ``parity`` (M,) in the same unit, zero without
    errors.

    >>> parity().outputs[0].expressions[0]
    -2*m_0 - 2*m_1 + m_2 + 3*m_3
    """
    build = KernelBuilder()
    m = build.input(sensors.measurement(sensors.all_sensors))
    build.output(sensors.parity, sp.Matrix(sensors.geometry.equations) * m)
    return build.kernel(
        f"parity-{sensors.name}",
        "Parity equations",
        _source("null vectors", sensors),
        arguments=sensors.command,
    )


def parity_rest(sensors: SensorSet = HEXAD_SET) -> Kernel:
    """Return the removal of biases from parity: their mean at rest, and what is left without it.

    Returns: inputs ``parity`` and ``parity_bias`` (M,), a state, in rad or m/s, and ``share``, 1/k in cycle k
    of a mean, or 0 where the vehicle moves; outputs ``next_parity_bias`` and ``corrected`` (M,), before the
    update.
    """
    build = KernelBuilder()
    p = build.input(sensors.parity)
    bias = Signal.labelled(
        "parity_bias",
        "bias",
        map(equation_label, sensors.geometry.equations),
        unit=sensors.unit,
        meaning="mean of the parity at rest",
        bound=sensors.parity.bound,
        over=CYCLE,
    )
    b = build.input(bias)
    share = build.scalar(Signal.scalar("share", meaning="weight of the new parity", bound=Fraction(1)))
    build.output(after(bias), b + share * (p - b))
    corrected = Signal.labelled(
        "corrected",
        "c",
        map(equation_label, sensors.geometry.equations),
        unit=sensors.unit,
        meaning="parity without its bias",
        over=CYCLE,
    )
    build.output(corrected, p - b)
    return build.kernel(
        f"parity-rest-{sensors.name}",
        "Parity without its mean at rest",
        _source("mean", sensors),
        arguments=sensors.command,
        recursion=Recursion(((bias.name, after(bias).name),), retained=(bias.name,)),
    )


def triad(number: int, sensors: SensorSet = HEXAD_SET) -> Kernel:
    """Return the vector of a triad.

    Returns: input ``measurement`` (3,) of its sensors in rad or m/s; output ``increment`` (3,) in body axes.
    """
    one = sensors.geometry.triads[number]
    build = KernelBuilder()
    m = build.input(sensors.measurement(one.sensors))
    build.output(sensors.increment, _matrix(one.inverse) * m)
    return build.kernel(
        triad_name(one, sensors),
        f"Vector of the sensors {', '.join(map(str, one.sensors))}",
        _source("inverse", sensors),
        arguments=sensors.command,
        notes=(f"Noise of 1 on all sensors is {gain_text(one)} in x, y and z.",),
    )


def triad_name(one: Triad, sensors: SensorSet) -> str:
    """Return the name of the kernel of a triad."""
    return f"triad-{sensors.name}-{''.join(map(str, one.sensors))}"


def gain_text(one: Triad) -> str:
    """Return the noise gains of a triad, exactly."""
    return ", ".join(str(root(gain)) for gain in one.squared_gains)


def all_sensors(sensors: SensorSet = HEXAD_SET) -> Kernel:
    """Return the vector of all sensors by least squares.

    Returns: input ``measurement`` (N,) in rad or m/s; output ``increment`` (3,) in body axes.
    """
    build = KernelBuilder()
    m = build.input(sensors.measurement(sensors.all_sensors))
    build.output(sensors.increment, _matrix(sensors.geometry.least_squares) * m)
    return build.kernel(
        f"all-{sensors.name}",
        "Vector of all sensors, least squares",
        _source("least squares", sensors),
        arguments=sensors.command,
    )


def _matrix(rows: tuple[tuple[Number, ...], ...]) -> sp.Matrix:
    return sp.Matrix([[sp.sympify(value) for value in row] for row in rows])


def _whole_above(number: Any) -> int:
    """Return the smallest integer that is not below a number."""
    return int(sp.ceiling(number))
