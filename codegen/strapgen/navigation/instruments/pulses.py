"""Derives the compensation of pulse counts with polarity and temperature, and the sensor that makes the counts."""

from __future__ import annotations

from fractions import Fraction

import sympy as sp

from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.instruments.imu_errors import CYCLE

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
