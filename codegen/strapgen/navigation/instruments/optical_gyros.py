"""Optical gyros: scale factors of the ring laser and the fibre, its signal without a loop, and lock-in.

The ring turns a fringe for every angle `ring_fringe_angle`, and the loop of a fibre gyro a cycle for every
`fibre_count_angle`: with such a quantum the kernel ``angle-counts`` makes angle increments of both.
"""

from __future__ import annotations

import math
from dataclasses import replace
from fractions import Fraction

import sympy as sp

from strapgen.ir import checks
from strapgen.ir.signals import Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.instruments.imu_errors import CYCLE

SENSORS = "P. G. Savage, Advances in Strapdown Sensors, AGARD Lecture Series 133 (1984)"
#: Speed of light in m/s.
_LIGHT = 299_792_458


def _vector(
    name: str, prefix: str, unit: str, meaning: str, bound: Fraction | None, over: str = ""
) -> Signal:
    """Return a signal of three gyros."""
    about = f"{meaning}, body axes"
    return Signal.vector(name, prefix, unit=unit, meaning=about, bound=bound, frame="b", over=over)


_RATE = _vector("rate", "w", "rad/s", "rates of the gyros", Fraction(8))
_SIGNAL = _vector("signal", "s", "1", "sine of the phases, from the demodulators", Fraction(1))


def ring_fringe_angle(area_m2: float, perimeter_m: float, wavelength_m: float) -> float:
    """Return the angle in rad of a fringe of a ring laser, lambda L/(4 A): 2 pi of the phase in equation (1)."""
    _require_lengths(area_m2=area_m2, perimeter_m=perimeter_m, wavelength_m=wavelength_m)
    return wavelength_m * perimeter_m / (4 * area_m2)


def fibre_phase_scale(length_m: float, diameter_m: float, wavelength_m: float) -> float:
    """Return the phase in rad between the beams of a fibre for a rate of 1 rad/s, 2 pi L D/(lambda c): equation (3)."""
    _require_lengths(length_m=length_m, diameter_m=diameter_m, wavelength_m=wavelength_m)
    return 2 * math.pi * length_m * diameter_m / (wavelength_m * _LIGHT)


def fibre_count_angle(diameter_m: float, wavelength_m: float) -> float:
    """Return the angle in rad of a cycle of a fibre gyro in a loop, lambda/D: F2 - F1 = D w/lambda, equation (5).

    The frequencies make the phase 2 pi (F2 - F1) L/c, which takes away that of equation (3).
    """
    _require_lengths(diameter_m=diameter_m, wavelength_m=wavelength_m)
    return wavelength_m / diameter_m


def _require_lengths(**values: float) -> None:
    for name, value in values.items():
        checks.number(name, value, positive=True)


def fibre_signal() -> Kernel:
    """Return the demodulated signals of fibre gyros without a loop, sin(phase)."""
    build = KernelBuilder()
    meaning = "phase of a rate, 2 pi L D/(lambda c)"
    scale = Signal.scalar("phase_scale", unit="s", meaning=meaning, bound=Fraction(1, 10))
    rate, phase = build.input(_RATE), build.scalar(scale)
    build.output(_SIGNAL, [sp.sin(phase * w) for w in rate])
    title = "Signals of fibre gyros without a loop"
    return build.kernel("fibre-signal", title, f"{SENSORS}, (3); demodulation derived")


def fibre_rate() -> Kernel:
    """Return the rates of fibre gyros without a loop from their signals, the inverse up to a phase of pi/2."""
    build = KernelBuilder()
    meaning = "1 over the phase of a rate"
    scale = Signal.scalar("phase_scale_reciprocal", unit="1/s", meaning=meaning, bound=Fraction(10_000))
    signal, inverse = build.input(_SIGNAL), build.scalar(scale)
    rates = [inverse * sp.atan2(s, sp.sqrt(sp.Max(1 - s**2, 0))) for s in signal]
    build.output(replace(_RATE, bound=None), rates)
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
    true = build.input(_vector("increment", "d", "rad", "true angle increments", Fraction(3, 10), "cycle"))
    cycle = build.scalar(CYCLE)
    lock_in = build.input(_vector("lock_in", "L", "rad/s", "lock-in rates of the gyros", Fraction(1, 100)))
    measured = []
    for axis, d, rate in zip("xyz", true, lock_in, strict=True):
        zone = build.value(f"zone_{axis}", rate * cycle, "angle of the lock-in rate")
        size = build.value(
            f"size_{axis}", sp.sqrt(sp.Max(d**2 - zone**2, 0)), "what is measured, without its sign"
        )
        measured.append(sp.Piecewise((size, d >= 0), (-size, True)))
    build.output(_vector("locked", "locked", "rad", "measured angle increments", None, "cycle"), measured)
    return build.kernel(
        "lock-in-errors",
        "Increments of ring lasers that lock in",
        f"{SENSORS}, Figure 7 drawn; equation derived from the coupling of the beams",
        notes=(
            "For rates that change slowly: a dither that passes the zone quickly leaves a random angle instead.",
        ),
    )
