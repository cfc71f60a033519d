"""The loop of a tuned-rotor gyro with an observer of its rates: both axes as a complex number, the first one real.

In increments of a cycle T, with the angle a of the case against the rotor, the rate w of the rotor, the rate d of the
case, the precession u that the torque makes, held over the cycle, and the nutation frequency n,

    a' = a + d - u - s (w - u),   w' = u + r (w - u),   d' = d,   r = exp(i n T),   s = (r - 1)/(i n T).

The observer adds L (measured a - a) to its own a, w and d, and the loop takes u = d + K1 a + K2 (w - d). What the
observer tells of d does not depend on K: the loop and the output have their transfer functions apart.
"""

from __future__ import annotations

import cmath
import math
from fractions import Fraction

import numpy as np
import sympy as sp

from strapgen.ir.exceptions import InputError
from strapgen.ir.signals import CYCLE, Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.instruments.separation import MICHELIN

#: The constants of the kernel by name: real part, imaginary part.
Gains = dict[str, tuple[float, float]]

#: States and measurement: name, meaning and largest value in rad.
_ANGLE = ("angle", "angle of the case against the rotor", Fraction(1, 64))
_STATES = (
    ("estimated_angle", "estimated angle of the case against the rotor", Fraction(1, 32)),
    ("rotor_increment", "estimated angle increment of the rotor", Fraction(1, 16)),
    ("estimate", "estimated angle increment of the case", Fraction(1, 16)),
    ("precession", "precession that the torque of the cycle makes", Fraction(1, 16)),
)
_CONSTANTS = (
    ("turn", "r, the turn of the nutation in a cycle", Fraction(1)),
    ("share", "s, the share of the nutation in the angle", Fraction(1)),
    *((f"correction_{n}", f"L{n} of the observer", Fraction(4)) for n in (1, 2, 3)),
    *((f"feedback_{n}", f"K{n} of the loop", Fraction(4)) for n in (1, 2)),
)


def _pair(name: str, meaning: str, bound: Fraction | None, unit: str, over: str = "") -> Signal:
    return Signal.labelled(
        name, name, "xy", unit=unit, meaning=f"{meaning}, axes x and y", bound=bound, over=over
    )


def _times(a: sp.Matrix, b: sp.Matrix) -> sp.Matrix:
    """Return the product of two complex numbers."""
    return sp.Matrix([a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]])


def tuned_rotor_loop() -> Kernel:
    """Return a cycle of the loop: the measured rates as angle increments, and the precession of the next cycle.

    Returns: inputs the states of `_STATES` and ``angle`` (2,) in rad, and the constants that `tuned_rotor_gains`
    returns, (2,) each; outputs the states of the next cycle: ``next_estimate`` is the measurement, and
    ``next_precession`` the command.
    """
    build = KernelBuilder()
    states = [_pair(*state, unit="rad", over="" if "angle" in state[0] else CYCLE) for state in _STATES]
    a, w, d, u = map(build.input, states)
    measured = build.input(_pair(*_ANGLE, unit="rad"))
    turn, share, l1, l2, l3, k1, k2 = (build.input(_pair(*one, unit="1")) for one in _CONSTANTS)
    off = build.stage(_pair("off", "measured less estimated angle", None, "rad"), measured - a)
    nutation = build.stage(_pair("nutation", "nutation in a cycle", None, "rad"), w - u)
    new_a = build.feedback(states[0], a + d - u - _times(share, nutation) + _times(l1, off))
    new_w = build.feedback(states[1], u + _times(turn, nutation) + _times(l2, off))
    new_d = build.feedback(states[2], d + _times(l3, off))
    build.feedback(states[3], new_d + _times(k1, new_a) + _times(k2, new_w - new_d))
    return build.kernel(
        "tuned-rotor-loop",
        "Loop of a tuned-rotor gyro with an observer of its rates",
        f"{MICHELIN}, section 3.3.2: an observation algorithm named, equations derived",
        notes=(
            "The rotor is free and in tune; the precession is that of the next cycle. Over the angular momentum the "
            "impulse of the torque about x is the precession about y, and that about y minus the precession about x.",
        ),
    )


def tuned_rotor_gains(nutation_hz: float, cycle_s: float, observer_pole: float, loop_pole: float) -> Gains:
    """Return the constants of `tuned_rotor_loop` that put all poles of observer and loop at two numbers.

    `nutation_hz`: nutation frequency. `observer_pole`, `loop_pole`: from 0 to below 1; the observer is the faster the
    smaller it is.
    """
    for name, value in (("nutation_hz", nutation_hz), ("cycle_s", cycle_s)):
        if not 0 < value < math.inf:
            raise InputError(f"{name} is {value:g}; a number above 0 is needed")
    for name, value in (("observer_pole", observer_pole), ("loop_pole", loop_pole)):
        if not 0 <= value < 1:
            raise InputError(f"{name} is {value:g}; a number from 0 to below 1 is needed")
    angle = 2 * math.pi * nutation_hz * cycle_s
    turn = cmath.exp(1j * angle)
    share = (turn - 1) / (1j * angle)
    if abs(turn - 1) < 0.1:
        raise InputError(
            f"the nutation turns by {math.degrees(angle) % 360:.3g} deg from sample to sample; an observer needs it "
            "away from whole turns, so another cycle"
        )
    system = np.array([[1, -share, 1], [0, turn, 0], [0, 0, 1]])
    torque = np.array([share - 1, 1 - turn])
    seen = np.stack([np.linalg.matrix_power(system, k)[0] for k in range(3)])
    correction = _polynomial(system, observer_pole) @ np.linalg.solve(seen, np.eye(3)[2])
    plant = system[:2, :2]
    reached = np.stack([torque, plant @ torque], axis=1)
    feedback = -np.eye(2)[1] @ np.linalg.solve(reached, _polynomial(plant, loop_pole))
    numbers = [turn, share, *correction, *feedback]
    return {name: (float(x.real), float(x.imag)) for (name, *_), x in zip(_CONSTANTS, numbers, strict=True)}


def _polynomial(system: np.ndarray, pole: float) -> np.ndarray:
    """Return the characteristic polynomial of equal poles, of the system itself."""
    size = len(system)
    return np.linalg.matrix_power(system - pole * np.eye(size), size)
