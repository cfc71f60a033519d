"""Kernels of redundant sensors: parity equations, failures, triads, all sensors, moment arm and boresight."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any

import sympy as sp

from strapgen.catalogue import toml_models
from strapgen.catalogue.coefficients import Number, root
from strapgen.catalogue.kinematics import DCM
from strapgen.catalogue.toml_models import Key, UserFile
from strapgen.ir import checks
from strapgen.ir.signals import ANY, CYCLE, Signal
from strapgen.kernel.algebra import cross
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.frame.frame_rates import FENNER
from strapgen.navigation.redundancy.geometry import HEXAD, Axes, SensorGeometry, Triad, of_rows

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
        """The increments in words."""
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
    """Return the removal of biases from parity: their mean at rest, and the parity less the mean.

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
    build.feedback(bias, b + share * (p - b))
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


_HALF = sp.Rational(1, 2)


def _flag(condition: sp.Expr) -> sp.Expr:
    """Return 1 where an expression is at least zero, else 0."""
    return sp.Piecewise((1, condition >= 0), (0, True))


def _flags(name: str, prefix: str, labels: list[str], meaning: str) -> Signal:
    return Signal.labelled(name, prefix, labels, meaning=f"{meaning}: 1 or 0", bound=Fraction(1))


def select(sensors: SensorSet = HEXAD_SET) -> Kernel:
    """Return the detection and the selection.

    An equation fails where its parity reaches its trip level. The failed sensor is the one in all equations that fail,
    if only one is. The triad is the one whose sensors are in the fewest; among equals, the one of the least noise.

    Returns: inputs ``parity`` (M,) and ``trip`` (M,), the trip levels of the integer equations, in rad or m/s,
    and ``excluded`` (N,), 1 for a sensor that no longer counts, else 0; outputs ``detected``, 1 if an equation
    fails, ``failed`` (N,), 1 for the sensor that is isolated, and ``triad``, the number of the selected triad.
    """
    geometry = sensors.geometry
    labels = [str(number) for number in sensors.all_sensors]
    build = KernelBuilder()
    p = build.input(sensors.parity)
    trip = build.input(
        Signal.labelled(
            "trip",
            "t",
            map(equation_label, geometry.equations),
            unit=sensors.unit,
            meaning="trip levels of the parity equations",
            bound=sensors.parity.bound,
        )
    )
    excluded = build.input(_flags("excluded", "x", labels, "sensors that no longer count"))
    out = build.stage(
        _flags("out", "out", labels, "sensors that do not count"), [_flag(x - _HALF) for x in excluded]
    )
    names = list(map(equation_label, geometry.equations))
    fail = build.stage(
        _flags("fail", "f", names, "equations that fail"),
        [_fails(e, p[k], trip[k], out) for k, e in enumerate(geometry.equations)],
    )
    counts = [sum(fail[k] for k, e in enumerate(geometry.equations) if e[s]) for s in sensors.all_sensors]
    count = build.stage(
        Signal.labelled("count", "n", labels, meaning="failing equations of a sensor"), counts
    )
    total = build.value("total", sum(fail), "failing equations")
    candidates = [
        sp.Piecewise((0, _HALF - total >= 0), (1, n - total + _HALF >= 0), (0, True)) for n in count
    ]
    suspect = build.stage(_flags("suspect", "s", labels, "sensors in all failing equations"), candidates)
    several = build.value("several", sum(suspect), "number of suspects")
    isolated = build.stage(
        _flags("isolated", "isolated", labels, "the only suspect"),
        [sp.Piecewise((0, several - 1 - _HALF >= 0), (s, True)) for s in suspect],
    )
    penalty = len(geometry.equations) + 1
    cost = build.stage(
        Signal.labelled("cost", "cost", labels, meaning="what speaks against a sensor"),
        [n + penalty * (o + f) for n, o, f in zip(count, out, isolated, strict=True)],
    )
    best = _number_of_least(build, [sum(cost[k] for k in triad.sensors) for triad in geometry.triads])
    build.output(
        Signal.scalar("detected", meaning="whether an equation fails: 1 or 0"), [_flag(total - _HALF)]
    )
    build.output(
        Signal.labelled("failed", "failed", labels, meaning="the sensor that is isolated: 1 or 0"), isolated
    )
    build.output(Signal.scalar("triad", meaning="number of the selected triad"), [best])
    return build.kernel(
        f"select-{sensors.name}",
        "Failed sensor and selected triad",
        f"{SEBRING}, tables by failure directions described, rule derived",
        arguments=sensors.command,
        notes=(
            "Triads are numbered from 0 by their noise, then by the numbers of their sensors.",
            "Without a single suspect no sensor is isolated; detected is 1 all the same.",
        ),
    )


def _fails(equation: tuple[int, ...], parity: sp.Symbol, trip: sp.Symbol, out: sp.Matrix) -> sp.Expr:
    """Return 1 where an equation fails that needs no sensor that is out, else 0."""
    invalid = sum(out[sensor] for sensor, value in enumerate(equation) if value) - _HALF
    return sp.Piecewise((0, invalid >= 0), (1, sp.Abs(parity) - trip >= 0), (0, True))


def _number_of_least(build: KernelBuilder, costs: list[sp.Expr]) -> sp.Expr:
    """Return the number of the first triad of least cost."""
    least, best = build.value("least_0", costs[0], "least cost so far"), sp.S.Zero
    for number, expression in enumerate(costs[1:], 1):
        cost = build.value(f"triad_cost_{number}", expression)
        best = build.value(f"best_{number}", sp.Piecewise((best, cost - least >= 0), (number, True)))
        least = build.value(f"least_{number}", -sp.Max(-least, -cost))
    return best


INCREMENT = Signal.vector(
    "increment",
    "d",
    unit="rad",
    meaning="angle increment of the cycle, body axes",
    bound=Fraction(1, 8),
    frame="b",
    over=CYCLE,
)
PREVIOUS = replace(
    INCREMENT,
    name="previous_increment",
    elements=tuple(f"previous_{name}" for name in INCREMENT.elements),
    meaning="angle increment of the cycle before, body axes",
)


def moment_arm() -> Kernel:
    """Return the velocity increment at the end of a moment arm: a + w' x r + w x (w x r), w' by differences.

    Returns: inputs ``velocity_increment`` (3,) in m/s, ``increment`` and ``previous_increment`` (3,) in rad,
    ``arm`` (3,) in m, all body axes, and ``cycle_rate`` 1/T in 1/s; outputs ``arm_velocity_increment`` (3,) in
    m/s and ``next_previous_increment``.
    """
    build = KernelBuilder()
    velocity = Signal.vector(
        "velocity_increment",
        "dv",
        unit="m/s",
        meaning="velocity increment of the cycle, body axes",
        bound=Fraction(4),
        frame="b",
        over=CYCLE,
    )
    arm = Signal.vector(
        "arm",
        "r",
        unit="m",
        meaning="from the sensors to the other place, body axes",
        bound=Fraction(4),
        frame="b",
    )
    dv, d, before, r = map(build.input, (velocity, INCREMENT, PREVIOUS, arm))
    rate = build.scalar(
        Signal.scalar("cycle_rate", unit="1/s", meaning="1/T, cycles in a second", bound=Fraction(128))
    )
    turned = build.stage(
        Signal.vector("turned", "turned", unit="m rad", meaning="displacement by the turn"), cross(d, r)
    )
    change = cross(d - before, r) + cross(d, turned)
    build.output(
        replace(velocity, name="arm_velocity_increment", elements=("arm_x", "arm_y", "arm_z"), bound=None),
        dv + rate * change,
    )
    build.feedback(PREVIOUS, d)
    return build.kernel(
        "moment-arm",
        "Velocity increment at the end of a moment arm",
        f"{SEBRING}, arm printed, equations lost and derived",
        notes=("The rate of change is the difference of two cycles, and so that of half a cycle before.",),
    )


def boresight() -> Kernel:
    """Return the mean of the relative attitudes of two units over alignments, (C_B^n)' C_A^n.

    Returns: inputs ``attitude_a`` and ``attitude_b`` (3, 3), C_A^n and C_B^n, ``mean`` (3, 3), a state, and
    ``share``, 1/k in alignment k; output ``next_mean``. `dcm-orthonormalize-optimal` makes a rotation of the
    mean.
    """
    build = KernelBuilder()
    attitudes = [
        replace(
            DCM.state,
            name=f"attitude_{unit}",
            elements=tuple(name.replace(name.split("_")[0], unit) for name in DCM.state.elements),
            meaning=f"attitude of unit {unit.upper()} from its alignment, its axes to navigation axes",
        )
        for unit in "ab"
    ]
    a, b = map(build.input, attitudes)
    mean = Signal.matrix(
        "mean",
        "mean",
        meaning="mean of the relative attitude, axes of A to axes of B",
        bound=Fraction(1),
    )
    c = build.input(mean)
    share = build.scalar(Signal.scalar("share", meaning="1/k in alignment k", bound=Fraction(1)))
    build.feedback(mean, c + share * (b.T * a - c))
    return build.kernel(
        "boresight",
        "Mean relative attitude of two units",
        f"{SEBRING}, printed; running mean derived",
    )


def median_of_three() -> Kernel:
    """Return the median of three units, element by element, and which of them are off it.

    Returns: inputs ``unit_1`` to ``unit_3`` (3,) and ``trip``, in one unit; outputs ``median`` (3,), and ``off`` (3,),
    1 for a unit of which an element is ``trip`` or more from the median, else 0.
    """
    build = KernelBuilder()
    units = [
        build.input(
            Signal.vector(f"unit_{n}", f"u{n}", unit=ANY, meaning=f"vector of unit {n}, any axes", frame=ANY)
        )
        for n in (1, 2, 3)
    ]
    trip = build.scalar(Signal.scalar("trip", unit=ANY, meaning="distance from the median that is a failure"))
    signal = Signal.vector("median", "median", unit=ANY, meaning="median of the units, any axes", frame=ANY)
    # The larger of the smaller two: max(min(a, b), min(max(a, b), c)).
    median = build.output(
        signal, [sp.Max(-sp.Max(-a, -b), -sp.Max(-sp.Max(a, b), -c)) for a, b, c in zip(*units, strict=True)]
    )
    labels = [str(n) for n in (1, 2, 3)]
    apart = [sp.Max(*(sp.Abs(x - m) for x, m in zip(unit, median, strict=True))) for unit in units]
    build.output(_flags("off", "off", labels, "units off the median"), [_flag(a - trip) for a in apart])
    return build.kernel(
        "median-3",
        "Median of three units",
        f"{FENNER}: three units named, median derived",
        notes=(
            "Of angles that turn, the differences from one of the units.",
            "A unit that sends no finite number is to be left out before: in floating point it may pass as the median.",
        ),
    )


_NAME = Key(
    "Ending of the names of kernels; by default that of the file",
    pattern="[a-z][a-z0-9]{0,7}",
    form="at most eight small letters and digits, a letter first,",
)


@dataclass(frozen=True)
class GeometryFile:
    """Redundant sensors: their axes, their kind, and what they measure."""

    axes: Axes
    name: Annotated[str, _NAME] = ""
    sensor: Annotated[str, Key("Kind of the sensors", choices=tuple(KINDS))] = "gyro"
    range: Annotated[
        Fraction | None,
        Key("Largest increment of a cycle; by default 1/8 rad or 4 m/s", "rad or m/s", above=0),
    ] = None


GEOMETRY = UserFile("a geometry", GeometryFile, 1 << 16)


def read(path: str | Path) -> SensorSet:
    """Read the geometry of sensors; a row of axes is read as by `geometry`."""
    place = checks.path("path", path)
    stem = re.sub(r"[^a-z0-9]", "", place.stem.lower())[:8]

    def sensors(file: GeometryFile) -> SensorSet:
        largest = file.range or (Fraction(1, 8) if file.sensor == "gyro" else Fraction(4))
        name = file.name or toml_models.parse(Annotated[str, _NAME], stem, "name")
        command = f"strapgen redundancy {shlex.quote(place.as_posix())}"
        return SensorSet(name, of_rows(file.axes), file.sensor, largest, command)

    return GEOMETRY.convert(path, sensors)


def kernels(sensors: SensorSet) -> Iterator[Kernel]:
    """Yield the kernels of a set of sensors: parity, its bias, the selection, all sensors, and each triad."""
    yield parity(sensors)
    yield parity_rest(sensors)
    yield select(sensors)
    yield all_sensors(sensors)
    for number in range(len(sensors.geometry.triads)):
        yield triad(number, sensors)
