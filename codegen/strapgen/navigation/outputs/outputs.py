"""Derives what a navigator puts on its bus: filtered rates, magnetic heading, track angle, axes of its mounting."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import sympy as sp

from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import ANY, Signal, after
from strapgen.kernel.algebra import Wrapped
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.frame.frame_signals import FENNER

SAMPLE = Signal.vector("sample", "x", unit=ANY, meaning="what is filtered, any axes", frame=ANY)
FIRST, SECOND = (
    Signal.vector(name, name, unit=ANY, meaning=f"state of the {name} integrator, any axes", frame=ANY)
    for name in ("first", "second")
)
LOSS, COUPLING, SQUARE = (
    Signal.scalar(
        name, unit="1", meaning=f"{meaning}, K = tan(pi fc/fs), n = 1 + sqrt(2) K + K^2", bound=bound
    )
    for name, meaning, bound in (
        ("loss", "1 - 1/n", Fraction(1)),
        ("coupling", "K/n", Fraction(3, 10)),
        ("square", "K^2/n", Fraction(1)),
    )
)
_TURN = Fraction(355, 113)
_VARIATION = Signal.scalar(
    "variation", unit="rad", meaning="magnetic variation, magnetic less true heading", bound=_TURN
)
_CORNERS = tuple(
    replace(
        _VARIATION,
        name=f"variation_{number}",
        elements=(f"variation_{number}",),
        meaning=f"magnetic variation at point {number} of the grid, ({place})",
    )
    for number, place in enumerate(("0, 0", "1, 0", "0, 1", "1, 1"), 1)
)
_FRACTIONS = tuple(
    Signal.scalar(
        name, unit="1", meaning=f"part of the way from point 1 to point {to} of the grid", bound=Fraction(1)
    )
    for name, to in (("first_fraction", 2), ("second_fraction", 3))
)
_HEADING = Signal.scalar("heading", unit="rad", meaning="heading against true north", bound=_TURN)
#: Up to 4096 knots, the range of the output.
_GROUND_VELOCITY = Signal(
    "ground_velocity",
    (3,),
    ("north_velocity", "east_velocity", "down_velocity"),
    unit="m/s",
    meaning="velocity relative to the earth, axes to north, east and down",
    bound=Fraction(2108),
    frame="g",
)
#: Where the body's axes ahead, right and down are in the axes of a unit: (place, sign) by the mounting.
_AXES = {
    "fore": ((0, 1), (1, 1), (2, 1)),
    "right": ((1, -1), (0, 1), (2, 1)),
    "aft": ((0, -1), (1, -1), (2, 1)),
    "left": ((1, 1), (0, -1), (2, 1)),
}


def butterworth() -> Kernel:
    """Return a Butterworth filter of second order by the bilinear transformation, as two trapezoidal integrators.

    The analog filter is x1' = w (u - x2 - sqrt(2) x1), x2' = w x1, with w the angular frequency of the edge. By the
    trapezoidal rule with K = tan(pi fc/fs) in place of w T/2 its transfer function is
    (K^2/n) (1 + z^-1)^2/(1 + a1 z^-1 + a2 z^-2), n = 1 + sqrt(2) K + K^2, a1 = 2 (K^2 - 1)/n,
    a2 = (1 - sqrt(2) K + K^2)/n. The states are those of the integrators, so that no cycle lengthens their vector
    while the input is zero, and a constant input passes unchanged whatever the coefficients are rounded to.
    """
    build = KernelBuilder()
    s1, s2, x = map(build.input, (FIRST, SECOND, SAMPLE))
    loss, coupling, square = map(build.scalar, (LOSS, COUPLING, SQUARE))
    # Named, so that a constant passes unchanged: sample and state have one and the same coefficient in every word.
    meaning = "sample less the second state"
    apart = build.stage(replace(SAMPLE, name="apart", elements=_named("apart"), meaning=meaning), x - s2)
    build.output(after(FIRST), s1 + 2 * (coupling * apart - loss * s1))
    later = build.output(after(SECOND), s2 + 2 * (coupling * s1 + square * apart))
    filtered = replace(
        SAMPLE, name="filtered", elements=_named("y"), meaning="the sample, filtered, any axes"
    )
    build.output(filtered, (s2 + later) / 2)
    return build.kernel(
        "butterworth-2",
        "Butterworth filter of second order, bilinear, prewarped",
        f"type printed in {FENNER}; digital form derived: bilinear, prewarped, as integrators",
        recursion=Recursion(
            tuple((state.name, after(state).name) for state in (FIRST, SECOND)),
            retained=(FIRST.name, SECOND.name),
        ),
        notes=(
            "For rates and accelerations that are shown or control; never in the way of attitude or velocity.",
            "Unit any stands for the unit of the sample.",
        ),
    )


def _named(prefix: str) -> tuple[str, ...]:
    """Return the names of the elements of a vector."""
    return tuple(f"{prefix}_{axis}" for axis in "xyz")


def variation() -> Kernel:
    """Return the magnetic variation between four points of a grid, Fig. 17.

    Returns: inputs ``variation_1`` to ``variation_4`` in rad, at (0, 0), (1, 0), (0, 1) and (1, 1), and
    ``first_fraction`` and ``second_fraction``, 0 to 1; output ``variation`` in rad.
    """
    build = KernelBuilder()
    v1, v2, v3, v4 = map(build.scalar, _CORNERS)
    r1, r2 = map(build.scalar, _FRACTIONS)
    build.output(
        replace(_VARIATION, bound=None), [v1 + r1 * ((v2 - v1) + r2 * (v1 + v4 - v2 - v3)) + r2 * (v3 - v1)]
    )
    return build.kernel(
        "variation",
        "Magnetic variation between four points of a grid",
        f"{FENNER}, Fig. 17, subscripts repaired",
        notes=("Where two corners lie on both sides of a half turn, add a whole turn to one of them.",),
    )


def magnetic_heading() -> Kernel:
    """Return the magnetic heading, that against true north and the variation, without whole turns.

    Returns: inputs ``heading`` and ``variation`` in rad; output ``magnetic_heading`` in rad, -pi to pi.
    """
    build = KernelBuilder()
    heading, difference = build.scalar(_HEADING), build.scalar(_VARIATION)
    output = Signal.scalar("magnetic_heading", unit="rad", meaning="heading against magnetic north")
    build.output(output, [Wrapped(heading + difference)])
    return build.kernel(
        "magnetic-heading",
        "Heading against magnetic north",
        f"{FENNER}, printed in words: the variation is added to the true heading",
        notes=("Errors of angles are told without whole turns.",),
    )


def track_angle() -> Kernel:
    """Return the direction of the ground velocity and its size.

    Returns: input ``ground_velocity`` (3,) in m/s, axes north, east, down; outputs ``track_angle`` in rad, from
    north over east, and ``ground_speed`` in m/s.
    """
    build = KernelBuilder()
    north, east, _ = build.input(_GROUND_VELOCITY)
    build.output(
        Signal.scalar(
            "track_angle", unit="rad", meaning="direction of the ground velocity, from north over east"
        ),
        [sp.atan2(east, north)],
    )
    build.output(
        Signal.scalar("ground_speed", unit="m/s", meaning="horizontal velocity relative to the earth"),
        [sp.sqrt(north**2 + east**2)],
    )
    return build.kernel(
        "track-angle",
        "Track angle and ground speed",
        f"{FENNER}, definition; derived, since the formula is lost",
        notes=(
            "An error of the velocity across the track, over the ground speed, is that of the track angle.",
        ),
    )


def axes(mounting: str) -> Kernel:
    """Return the axes ahead, right and down of a unit that is mounted in one of four orientations."""
    build = KernelBuilder()
    sensed = Signal.vector(
        "sensed", "s", unit=ANY, meaning="vector in axes of the unit, as mounted", frame=ANY
    )
    s = build.input(sensed)
    body = replace(
        sensed, name="body", elements=_named("body"), meaning="vector in axes ahead, right and down"
    )
    build.output(body, [sign * s[place] for place, sign in _AXES[mounting]])
    return build.kernel(
        f"axes-{mounting}",
        f"Axes of a unit whose x axis points {mounting}",
        f"{FENNER}: four orientations printed, their permutations derived",
        notes=("Unit any stands for the unit of the vector.",),
    )
