"""Derives the scale factor of a gyro whose torquers heat up, as a recursion on its deviation."""

from __future__ import annotations

from fractions import Fraction

from strapgen.catalogue.kernels.imu_errors import CYCLE_RATE
from strapgen.catalogue.kernels.separation import MICHELIN
from strapgen.ir.recursion import Recursion
from strapgen.ir.signals import Signal, after
from strapgen.symbolic.kernel import Kernel, KernelBuilder

DEVIATION = Signal.scalar(
    "deviation",
    unit="1",
    meaning="u, relative deviation of the scale factor by heating; zero at switch-on",
    bound=Fraction(1, 256),
)
FRACTION = Signal.scalar(
    "decay",
    unit="1",
    meaning="1 - exp(-T/tau), what decays of the deviation in a cycle",
    bound=Fraction(1, 8192),
)
GAIN = Signal.scalar(
    "heating_gain",
    unit="(rad/s)^-2",
    meaning="k_inf, steady deviation of the scale factor by the square of the rate",
    bound=Fraction(1, 2048),
)


def _torqued(name: str, prefix: str, meaning: str, bound: Fraction | None) -> Signal:
    return Signal.labelled(name, prefix, "xy", unit="rad", meaning=f"{meaning}, torquer axes", bound=bound)


def scale_factor_heating(errors: bool = False) -> Kernel:
    """Return the scale factor correction of one gyro for the heat of its torquers, equations (6.6) and (6.7).

    Parameters
    ----------
    errors : bool
        Whether the kernel divides true increments by the scale factor instead of correcting indicated ones.

    Returns
    -------
    Kernel
        Inputs ``deviation``, a state, ``increment`` (2,) in rad about both torquer axes, ``decay``,
        ``heating_gain`` in (rad/s)^-2 and ``cycle_rate`` in 1/s; outputs ``next_deviation`` and
        ``compensated_increment`` (2,) in rad, or ``indicated_increment`` where it makes the errors.
    """
    build = KernelBuilder()
    u = build.scalar(DEVIATION)
    kind = "true" if errors else "indicated"
    d = build.input(_torqued("increment", "d", f"{kind} angle increment of the cycle", Fraction(3, 80)))
    decay, gain, cycle_rate = (build.scalar(signal) for signal in (FRACTION, GAIN, CYCLE_RATE))
    torqued = d
    if errors:
        torqued = build.stage(_torqued("torqued", "torqued", "torqued angle increment", None), d / (1 + u))
    rate = build.stage(
        Signal.labelled("rate", "w", "xy", unit="rad/s", meaning="torquer rate"), cycle_rate * torqued
    )
    steady = build.value(
        "steady", gain * (rate[0] ** 2 + rate[1] ** 2), "deviation that the rate would lead to"
    )
    build.output(after(DEVIATION), [u + decay * (steady - u)])
    if errors:
        build.output(_torqued("indicated_increment", "indicated", "indicated angle increment", None), torqued)
    else:
        build.output(_torqued("compensated_increment", "true", "true angle increment", None), (1 + u) * d)
    return build.kernel(
        "scale-factor-heating-errors" if errors else "scale-factor-heating",
        "Gyro whose torquers heat up" if errors else "Scale factor of a gyro whose torquers heat up",
        f"{MICHELIN}, (6.2), (6.6) and (6.7), printed; recursion on the deviation derived",
        recursion=Recursion(((DEVIATION.name, after(DEVIATION).name),), kept=(DEVIATION.name,)),
        notes=(
            "The scale factor is 1 + deviation at the start of the cycle.",
            "(6.8) and (6.9) are the solution for one constant rate and no recursion: they never decay.",
        ),
    )
