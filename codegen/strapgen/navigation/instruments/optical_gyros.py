"""Gyros of light: scale factors of the ring laser and the fibre, its signal without a loop, and lock-in.

The ring turns a fringe for every angle `ring_fringe_angle`, and the loop of a fibre gyro a cycle for every
`fibre_count_angle`: with such a quantum the kernel ``angle-counts`` makes angle increments of both.
"""

from __future__ import annotations

import math
from fractions import Fraction

import sympy as sp

from strapgen.ir import checks
from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.instruments.imu_errors import CYCLE

SENSORS = "P. G. Savage, Advances in Strapdown Sensors, AGARD Lecture Series 133 (1984)"
#: Speed of light in m/s.
_LIGHT = 299_792_458
_RATE = Signal.vector(
    "rate", "w", unit="rad/s", meaning="rates of the gyros, body axes", bound=Fraction(8), frame="b"
)
_PHASE = Signal.scalar(
    "phase_scale", unit="s", meaning="phase of a rate, 2 pi L D/(lambda c)", bound=Fraction(1, 10)
)
_SIGNAL = Signal.vector(
    "signal",
    "s",
    unit="1",
    meaning="sine of the phases, from the demodulators, body axes",
    bound=Fraction(1),
    frame="b",
)


def ring_fringe_angle(area_m2: float, perimeter_m: float, wavelength_m: float) -> float:
    """Return the angle in rad of a fringe of a ring laser, lambda L/(4 A): 2 pi of the phase in equation (1).

    >>> side = 0.1125
    >>> angle = ring_fringe_angle(3**0.5 / 4 * side**2, 3 * side, 0.63e-6)
    >>> round(math.degrees(angle) * 3600, 2)
    2.0
    """
    area, perimeter, wavelength = _lengths(
        area_m2=area_m2, perimeter_m=perimeter_m, wavelength_m=wavelength_m
    )
    return wavelength * perimeter / (4 * area)


def fibre_phase_scale(length_m: float, diameter_m: float, wavelength_m: float) -> float:
    """Return the phase in rad between the beams of a fibre for a rate of 1 rad/s, 2 pi L D/(lambda c): equation (3).

    >>> round(fibre_phase_scale(400, 0.1, 0.82e-6), 3)
    1.022
    """
    length, diameter, wavelength = _lengths(
        length_m=length_m, diameter_m=diameter_m, wavelength_m=wavelength_m
    )
    return 2 * math.pi * length * diameter / (wavelength * _LIGHT)


def fibre_count_angle(diameter_m: float, wavelength_m: float) -> float:
    """Return the angle in rad of a cycle of a fibre gyro in a loop, lambda/D: F2 - F1 = D w/lambda, equation (5).

    The frequencies make the phase 2 pi (F2 - F1) L/c, which takes away that of equation (3).

    >>> round(math.degrees(fibre_count_angle(0.1, 0.82e-6)) * 3600, 3)
    1.691
    """
    diameter, wavelength = _lengths(diameter_m=diameter_m, wavelength_m=wavelength_m)
    return wavelength / diameter


def _lengths(**values: float) -> list[float]:
    return [float(checks.number(name, value, positive=True)) for name, value in values.items()]


def fibre_signal() -> Kernel:
    """Return the demodulated signals of fibre gyros without a loop, sin(phase)."""
    build = KernelBuilder()
    rate, scale = build.input(_RATE), build.scalar(_PHASE)
    build.output(_SIGNAL, [sp.sin(scale * w) for w in rate])
    return build.kernel(
        "fibre-signal", "Signals of fibre gyros without a loop", f"{SENSORS}, (3); demodulation derived"
    )


def fibre_rate() -> Kernel:
    """Return the rates of fibre gyros without a loop from their signals, the inverse up to a phase of pi/2."""
    build = KernelBuilder()
    signal = build.input(_SIGNAL)
    inverse = build.scalar(
        Signal.scalar(
            "phase_scale_reciprocal", unit="1/s", meaning="1 over the phase of a rate", bound=Fraction(10_000)
        )
    )
    build.output(
        Signal.vector("rate", "w", unit="rad/s", meaning="rates of the gyros, body axes", frame="b"),
        [inverse * sp.atan2(s, sp.sqrt(sp.Max(1 - s**2, 0))) for s in signal],
    )
    return build.kernel(
        "fibre-rate",
        "Rates of fibre gyros without a loop",
        f"{SENSORS}, (3); inverse derived",
        notes=(
            "A phase beyond a quarter of a turn comes out as one below: the source's remedy is the loop.",
        ),
    )


def lock_in_errors() -> Kernel:
    """Return the increments of ring lasers that lock in, of rates that change slowly: sign(w) sqrt(w^2 - L^2).

    It is the mean of w - L sin(psi), in which the phase psi between the beams is driven by the same rate.
    """
    build = KernelBuilder()
    true = build.input(
        Signal.vector(
            "increment",
            "d",
            unit="rad",
            meaning="true angle increments, body axes",
            bound=Fraction(3, 10),
            frame="b",
            over="cycle",
        )
    )
    cycle = build.scalar(CYCLE)
    lock_in = build.input(
        Signal.vector(
            "lock_in",
            "L",
            unit="rad/s",
            meaning="lock-in rates of the gyros, body axes",
            bound=Fraction(1, 100),
        )
    )
    measured = []
    for axis, d, rate in zip("xyz", true, lock_in, strict=True):
        below = build.value(f"zone_{axis}", rate * cycle, "angle of the lock-in rate")
        size = build.value(
            f"size_{axis}", sp.sqrt(sp.Max(d**2 - below**2, 0)), "what is measured, without its sign"
        )
        measured.append(sp.Piecewise((size, d >= 0), (-size, True)))
    build.output(
        Signal.vector(
            "locked",
            "locked",
            unit="rad",
            meaning="measured angle increments, body axes",
            frame="b",
            over="cycle",
        ),
        measured,
    )
    return build.kernel(
        "lock-in-errors",
        "Increments of ring lasers that lock in",
        f"{SENSORS}, Figure 7 drawn; equation derived from the coupling of the beams",
        notes=(
            "For rates that change slowly: a dither that passes the zone quickly leaves a random angle instead.",
        ),
    )
