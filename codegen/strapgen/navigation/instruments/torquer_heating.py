"""Derives the scale factors of gyros whose torquers heat up, as a recursion on their deviations."""

from __future__ import annotations

from fractions import Fraction

import sympy as sp

from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import Signal, after
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.instruments.imu_errors import CYCLE_RATE
from strapgen.navigation.instruments.separation import MICHELIN, TORQUES

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
    build.output(after(DEVIATION), u + decay * (steady - u))
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
        recursion=Recursion(((DEVIATION.name, after(DEVIATION).name),), retained=(DEVIATION.name,)),
        notes=(
            "The scale factor is 1 + deviation at the start of the cycle.",
            "(6.8) and (6.9) are the solution for one constant rate and no recursion: they never decay.",
        ),
    )
