"""Derives the compensation of pulse counts with polarity and temperature, and the sensor that makes the counts."""

from __future__ import annotations

from fractions import Fraction

import sympy as sp

from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.instruments.imu_errors import CYCLE, CYCLE_RATE
from strapgen.navigation.instruments.separation import MICHELIN, TORQUES

GILMORE = (
    "J. P. Gilmore, Modular Strapdown Guidance Unit with Embedded Microprocessors, "
    "AGARD Lecture Series 133 (1984)"
)
#: What a sensor counts: the unit of its increments and that of its rate.
_UNITS = {"": ("m/s", "m/s^2", "velocity", Fraction(4)), "gyro": ("rad", "rad/s", "angle", Fraction(3, 10))}


def _coefficients(build: KernelBuilder, rate: str, electronics: bool) -> dict[str, sp.Expr]:
    """Declare the coefficients of a sensor as inputs, and return their symbols by the names of the source."""
    bias = Fraction(1, 4) if rate == "m/s^2" else Fraction(1, 256)
    stated = [("K0a", "bias", rate, "K0a, bias of the sensor", bias)]
    if electronics:
        stated.append(("Vos", "offset", rate, "Vos, offset of the converter", bias / 2))
    stated.append(("dK1a", "scale_error", "1", "dK1a, scale factor error of the sensor", Fraction(1, 64)))
    for sign, name in (("+", "plus"), ("-", "minus")):
        about = f"dK1VF, scale factor error of the converter for counts of sign {sign}"
        stated.append((f"dK1VF{sign}", f"scale_error_{name}", "1", about, Fraction(1, 64)))
    symbols: dict[str, sp.Expr] = {
        key: build.scalar(Signal.scalar(name, unit=unit, meaning=f"{about}, sensor axis", bound=bound))
        for key, name, unit, about, bound in stated
    }
    return {"Vos": sp.S.Zero, **symbols}


def pulse_compensate(exact_bias: bool = False, sensor: str = "") -> Kernel:
    """Return the compensation of a pulse count, equations (7) to (9).

    `exact_bias`: whether the offset of the converter is divided by the scale factor, which inverts (4) to (6)
    exactly; the source adds it undivided.
    """
    unit, rate, word, bound = _UNITS[sensor]
    build = KernelBuilder()
    meaning = f"raw {word} increment, count times quantum, sensor axis"
    raw = build.scalar(Signal.scalar("count", unit=unit, meaning=meaning, bound=bound, over="cycle"))
    cycle = build.scalar(CYCLE)
    values = _coefficients(build, rate, not sensor)
    polar = sp.Piecewise((values["dK1VF+"], raw >= 0), (values["dK1VF-"], True))
    converter = 1 + build.value("polar_scale_error", polar, "scale factor error of the converter by polarity")
    gain = (1 + values["dK1a"]) * converter  # 1 + dK1 of (9)
    electronic = values["Vos"] / (1 + values["dK1a"]) if exact_bias else converter * values["Vos"]
    correction = build.value("scale_correction", 1 / gain - 1, "dSF")
    bias = build.value("bias_correction", -(values["K0a"] + electronic), f"Bc in {rate}")
    signal = Signal.scalar(
        "compensated", unit=unit, meaning=f"compensated {word} increment, sensor axis", over="cycle"
    )
    build.output(signal, [raw + correction * raw + bias * cycle])
    name = "-".join(filter(None, (sensor, "pulse-compensate", "exact" if exact_bias else "")))
    return build.kernel(
        name,
        f"Compensation of the pulses of {'a gyro' if sensor else 'an accelerometer'}"
        + (", exact inverse" if exact_bias else ""),
        f"{GILMORE}, (7) to (9), "
        + ("variant derived, not the paper's" if exact_bias else "printed, sign of (8) repaired"),
    )


def pulse_errors(sensor: str = "") -> Kernel:
    """Return the count of a sensor, equations (4) to (6), in increments."""
    unit, rate, word, bound = _UNITS[sensor]
    build = KernelBuilder()
    meaning = f"true {word} increment, sensor axis"
    true = build.scalar(Signal.scalar("increment", unit=unit, meaning=meaning, bound=bound, over="cycle"))
    cycle = build.scalar(CYCLE)
    values = _coefficients(build, rate, not sensor)
    voltage = (1 + values["dK1a"]) * (values["K0a"] * cycle + true) + values["Vos"] * cycle
    voltage = build.value(
        "voltage", voltage, f"output of the sensor with the offset of the converter in {unit}"
    )
    # As a multiple of the part above zero the polarity is continuous, so that rounding turns nothing over.
    positive = build.value(
        "positive", sp.Max(voltage, 0), "the output of the sensor where it is positive, else zero"
    )
    count = voltage + values["dK1VF-"] * voltage + (values["dK1VF+"] - values["dK1VF-"]) * positive
    meaning = f"raw {word} increment, count times quantum, sensor axis"
    build.output(Signal.scalar("count", unit=unit, meaning=meaning, over="cycle"), [count])
    return build.kernel(
        "-".join(filter(None, (sensor, "pulse-errors"))),
        f"Pulses of {'a gyro' if sensor else 'an accelerometer'} with its errors",
        f"{GILMORE}, (4) to (6), printed",
    )


def temperature_coefficient() -> Kernel:
    """Return a coefficient at a temperature by two slopes, equation (10)."""
    build = KernelBuilder()
    nominal, above, below, difference = (
        build.scalar(Signal.scalar(name, unit=unit, meaning=meaning, bound=bound))
        for name, unit, meaning, bound in (
            ("nominal", "1", "KN, coefficient at the nominal temperature", Fraction(1, 4)),
            (
                "slope_above",
                "1/K",
                "slope of the coefficient above the nominal temperature",
                Fraction(1, 256),
            ),
            (
                "slope_below",
                "1/K",
                "slope of the coefficient below the nominal temperature",
                Fraction(1, 256),
            ),
            ("difference", "K", "temperature less the nominal temperature", Fraction(64)),
        )
    )
    slope = build.value("slope", sp.Piecewise((above, difference >= 0), (below, True)), "slope that applies")
    build.output(
        Signal.scalar("coefficient", unit="1", meaning="coefficient at the temperature"),
        [nominal + slope * difference],
    )
    return build.kernel(
        "temperature-coefficient",
        "Coefficient of a sensor at a temperature, two slopes",
        f"{GILMORE}, (10), printed",
        notes=("Unit 1 stands for the unit of the coefficient.",),
    )


_SOURCE = f"{GILMORE}, (1) to (3), ordering repaired, (2) derived"
#: Largest angle of the float in quanta of its converter, and what a filter and an integral of it can reach.
_ANGLE, _FILTERED, _INTEGRATED = Fraction(256), Fraction(128), Fraction(2048)

ANGLE = Signal.scalar(
    "angle", unit="1", meaning="angle of the float in quanta of its converter", bound=_ANGLE
)
FILTERED = Signal.scalar(
    "filtered", unit="1", meaning="float angle through the lag of the loop, in quanta", bound=_FILTERED
)
INTEGRATED = Signal.scalar(
    "integrated", unit="1", meaning="leaking integral of the float angle, in quanta", bound=_INTEGRATED
)
COMMAND = Signal.scalar(
    "command", unit="1", meaning="pulses of the torquer for the next cycle, before its limit"
)
_CONSTANTS = tuple(
    Signal.scalar(name, unit="1", meaning=meaning, bound=bound)
    for name, meaning, bound in (
        ("gain", "K_s, pulses for a quantum", Fraction(1)),
        ("lag_gain", "C1 = Kf/(1 + r), r = tau0/dt", Fraction(1, 4)),
        ("lag_pole", "C2 = r/(1 + r)", Fraction(1)),
        ("integral_gain", "C3 = Ki dt", Fraction(1)),
        ("leak", "K_L, part of the integral that is lost in a cycle", Fraction(1)),
    )
)


def pulse_torque() -> Kernel:
    """Return a cycle of the control law: a proportional part less a lag, and a leaking integral.

    e = a - f, f' = C1 e + C2 f, i' = (i + C3 a)(1 - K_L), command = K_s (e + i').
    """
    build = KernelBuilder()
    filtered, integrated, angle = map(build.scalar, (FILTERED, INTEGRATED, ANGLE))
    gain, lag_gain, lag_pole, integral_gain, leak = map(build.scalar, _CONSTANTS)
    error = angle - filtered
    build.feedback(FILTERED, [lag_gain * error + lag_pole * filtered])
    leaked = build.feedback(INTEGRATED, [(integrated + integral_gain * angle) * (1 - leak)])
    build.output(COMMAND, [gain * (error + leaked[0])])
    return build.kernel(
        "pulse-torque",
        "Control law of a pulse torquing loop",
        _SOURCE,
        notes=(
            "The torquer has a limit of its own; the command is rounded and limited where it is handed over.",
        ),
    )


DEVIATION = Signal.labelled(
    "deviation",
    "u",
    "123",
    unit="1",
    meaning="relative deviations of the scale factors of gyros 1, 2 and 3 by heating; zero at switch-on",
    bound=Fraction(1, 256),
)
DECAY = Signal.scalar(
    "decay",
    unit="1",
    meaning="1 - exp(-T/tau), what decays of the deviations in a cycle",
    bound=Fraction(1, 8192),
)
GAIN = Signal.labelled(
    "heating_gain",
    "k",
    "123",
    unit="(rad/s)^-2",
    meaning="k_inf, steady deviations of the scale factors of gyros 1, 2 and 3 by the square of the rate",
    bound=Fraction(1, 2048),
)


def _torque(name: str, prefix: str, meaning: str, bound: Fraction | None) -> Signal:
    """Return a signal like `TORQUES`, with other names."""
    labels = [element.partition("_")[2] for element in TORQUES.elements]
    about = f"{meaning} of the cycle about the torquer axes x and y of gyros 1, 2 and 3"
    return Signal.labelled(name, prefix, labels, unit="rad", meaning=about, bound=bound, over="cycle")


def scale_factor_heating(errors: bool = False) -> Kernel:
    """Return the scale factor correction of three gyros for the heat of their torquers, equations (6.6) and (6.7)."""
    build = KernelBuilder()
    u = build.input(DEVIATION)
    kind = "true" if errors else "indicated"
    d = build.input(_torque("torque_increment", "M", f"{kind} angle increments", Fraction(3, 80)))
    decay = build.scalar(DECAY)
    gain = build.input(GAIN)
    cycle_rate = build.scalar(CYCLE_RATE)
    scale = sp.Matrix([1 + u[number // 2] for number in range(6)])
    if errors:
        signal = _torque("indicated", "indicated", "indicated angle increments", None)
        torqued = build.stage(signal, [x / factor for x, factor in zip(d, scale, strict=True)])
    else:
        torqued = d
    labels = [element.partition("_")[2] for element in TORQUES.elements]
    rate = build.stage(
        Signal.labelled("rate", "w", labels, unit="rad/s", meaning="torquer rates"), cycle_rate * torqued
    )
    squares = [rate[2 * number] ** 2 + rate[2 * number + 1] ** 2 for number in range(3)]
    steady = build.stage(
        Signal.labelled("steady", "steady", "123", meaning="deviations that the rates would lead to"),
        gain.multiply_elementwise(sp.Matrix(squares)),
    )
    build.feedback(DEVIATION, u + decay * (steady - u))
    if errors:
        signal = _torque("indicated_torque_increment", "measured", "indicated angle increments", None)
        build.output(signal, torqued)
    else:
        signal = _torque("compensated_torque_increment", "true", "true angle increments", None)
        build.output(signal, scale.multiply_elementwise(d))
    return build.kernel(
        "torquer-heating-errors" if errors else "scale-factor-heating",
        "Gyros whose torquers heat up" if errors else "Scale factors of gyros whose torquers heat up",
        f"{MICHELIN}, (6.2), (6.6) and (6.7), printed; recursion on the deviation derived",
        notes=(
            "The scale factor is 1 + deviation at the start of the cycle.",
            "(6.8) and (6.9) are the solution for one constant rate and no recursion: they never decay.",
        ),
    )
