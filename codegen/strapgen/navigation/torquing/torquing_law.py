"""Derives the control law that torques a gyro with pulses, so that its float stays where it is."""

from __future__ import annotations

from fractions import Fraction

from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import Signal, after
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.instruments.pulses import GILMORE

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
    build.output(after(FILTERED), [lag_gain * error + lag_pole * filtered])
    leaked = build.output(after(INTEGRATED), [(integrated + integral_gain * angle) * (1 - leak)])
    build.output(COMMAND, [gain * (error + leaked[0])])
    names = (FILTERED.name, INTEGRATED.name)
    return build.kernel(
        "pulse-torque",
        "Control law of a pulse torquing loop",
        _SOURCE,
        recursion=Recursion(tuple((name, f"next_{name}") for name in names), retained=names),
        notes=(
            "The torquer has a limit of its own; the command is rounded and limited where it is handed over.",
        ),
    )
