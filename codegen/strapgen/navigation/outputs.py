"""Outputs of a navigator: kernels, magnetic variation, words of a bus, and the accuracy of flights."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
import sympy as sp

from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.signals import ANY, Signal
from strapgen.kernel.algebra import Wrapped
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.frame.frame_rates import FENNER

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
HEADING = Signal.scalar("heading", unit="rad", meaning="heading against true north", bound=_TURN)
#: Up to 4096 knots, the range of the output.
GROUND_VELOCITY = Signal(
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
    heading, difference = build.scalar(HEADING), build.scalar(_VARIATION)
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
    north, east, _ = build.input(GROUND_VELOCITY)
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


#: A whole turn in deg.
_WHOLE_TURN_DEG = 360.0


class VariationTable:
    """Magnetic variations on a grid of latitude and longitude.

    `latitudes, longitudes`: lines of the grid in deg, increasing; longitudes that span a whole turn have their
    first line again at its end. `variations` (latitudes, longitudes): what is to be added to a true heading, in
    deg.

    >>> table = VariationTable([40, 50], [0, 10], [[10, 12], [13, 18]])
    >>> corners, fractions = table.around(46, 2.5)
    >>> [round(math.degrees(corner), 6) for corner in corners], fractions
    ([10.0, 12.0, 13.0, 18.0], (0.25, 0.6))
    """

    def __init__(self, latitudes: Sequence[float], longitudes: Sequence[float], variations: object) -> None:
        self.lines = tuple(
            checks.numbers(name, values, (None,))
            for name, values in (("latitudes", latitudes), ("longitudes", longitudes))
        )
        for name, lines in zip(("latitudes", "longitudes"), self.lines, strict=True):
            if lines.ndim != 1 or lines.size < 2 or not (np.diff(lines) > 0).all():
                raise InputError(f"{name} of the grid have to increase, and to be at least two")
        self.variations = checks.numbers("variations", variations)
        shape = tuple(lines.size for lines in self.lines)
        if self.variations.shape != shape:
            raise InputError(f"variations have the shape {self.variations.shape}; the grid has {shape}")

    def around(
        self, latitude_deg: float, longitude_deg: float
    ) -> tuple[tuple[float, float, float, float], tuple[float, float]]:
        """Return the variations at the points around a position in rad, and the way to it from the first one.

        Corners stand in the order of the kernel: the first fraction goes to the east, the second to the north. Of
        corners on both sides of a half turn, those beyond it from the first have a whole turn added.
        """
        first = float(self.lines[1][0])
        position = (latitude_deg, first + (longitude_deg - first) % _WHOLE_TURN_DEG)
        places = []
        for name, value, lines in zip(("latitude", "longitude"), position, self.lines, strict=True):
            if not lines[0] <= value <= lines[-1]:
                raise InputError(
                    f"{name} {value:g} deg is outside of the grid, {lines[0]:g} to {lines[-1]:g} deg"
                )
            place = min(int(np.searchsorted(lines, value, "right")) - 1, lines.size - 2)
            places.append((place, float((value - lines[place]) / (lines[place + 1] - lines[place]))))
        (row, north), (column, east) = places
        corners = self.variations[row : row + 2, column : column + 2].ravel()
        near = [corners[0] + math.remainder(corner - corners[0], _WHOLE_TURN_DEG) for corner in corners]
        v1, v2, v3, v4 = map(math.radians, near)
        return (v1, v2, v3, v4), (east, north)


#: Bits of a word, with its sign.
_FEWEST, _MOST = 2, 32
#: Part of the accuracy that rounding to a word may have at most, where none is stated.
_PART = Fraction(1, 10)


@dataclass(frozen=True)
class OutputWord:
    """An output as a binary fraction of its range, in two's complement, the first bit the sign."""

    #: Full scale in `unit`: what the first bit after the sign is half of
    range: Fraction
    unit: str
    #: Two standard deviations, as printed; None where there is none
    accuracy: Fraction | None = None
    #: Whether the output is an angle that goes on beyond its range from the other end
    turns: bool = False

    def quantum(self, bits: int) -> Fraction:
        """Return the value of the last place of a word of so many bits, in `unit`."""
        bits = checks.count("bits", bits, smallest=_FEWEST, largest=_MOST)
        return Fraction(self.range, 1 << (bits - 1))

    def bits(self, part: Fraction = _PART) -> int:
        """Return the fewest bits whose rounding, half a quantum, is at most a part of the accuracy.

        >>> OUTPUT_WORDS["true_heading"].bits()
        13
        """
        if self.accuracy is None:
            raise InputError("the output has no printed accuracy; state the bits")
        for bits in range(_FEWEST, _MOST + 1):
            if self.quantum(bits) <= 2 * part * self.accuracy:
                return bits
        raise InputError(f"part is {part}; that takes more than {_MOST} bits")

    def encoded(self, value: Fraction | float, bits: int) -> int:
        """Return the nearest word to a value in `unit`; an angle turns, and anything else stops at the ends.

        >>> heading = OUTPUT_WORDS["true_heading"]
        >>> heading.encoded(190, 13), heading.encoded(-170, 13), OUTPUT_WORDS["body_rate"].encoded(200, 11)
        (-3868, -3868, 1023)
        """
        place = math.floor(Fraction(value) / self.quantum(bits) + Fraction(1, 2))
        half = 1 << (bits - 1)
        if self.turns:
            return (place + half) % (2 * half) - half
        return max(-half, min(half - 1, place))

    def decoded(self, word: int, bits: int) -> Fraction:
        """Return the value of a word in `unit`."""
        return word * self.quantum(bits)


_DEG = Fraction(180)
#: The outputs of Table 13 of Fenner's paper, by name; ranges are those of words on ARINC 429.
OUTPUT_WORDS: dict[str, OutputWord] = {
    "roll": OutputWord(_DEG, "deg", Fraction(1, 10), True),
    "pitch": OutputWord(_DEG, "deg", Fraction(1, 10), True),
    "true_heading": OutputWord(_DEG, "deg", Fraction(2, 5), True),
    "magnetic_heading": OutputWord(_DEG, "deg", Fraction(2), True),
    "body_acceleration": OutputWord(Fraction(4), "g", Fraction(1, 100)),
    "body_rate": OutputWord(Fraction(128), "deg/s", Fraction(1, 10)),
    "ground_velocity": OutputWord(Fraction(4096), "kn", Fraction(12)),
    "vertical_velocity": OutputWord(Fraction(32768), "ft/min", Fraction(30)),
    "track_angle": OutputWord(_DEG, "deg", Fraction(5), True),
    "drift_angle": OutputWord(Fraction(90), "deg", Fraction(5)),
    "flight_path_angle": OutputWord(_DEG, "deg", Fraction(2, 5), True),
    "track_acceleration": OutputWord(Fraction(1, 2), "g", Fraction(1, 100)),
    "vertical_acceleration": OutputWord(Fraction(4), "g", Fraction(1, 100)),
    "track_angle_rate": OutputWord(Fraction(32), "deg/s", Fraction(1, 4)),
    "inertial_altitude": OutputWord(Fraction(131072), "ft"),
}


#: The factor as printed, and that of Rayleigh's distribution, sqrt(-2 ln 0.05).
PRINTED, RAYLEIGH = 2.45, math.sqrt(-2 * math.log(0.05))


def radial_error_rate(errors: Sequence[float], times: Sequence[float], factor: float = PRINTED) -> float:
    """Return R95 = 2.45 sqrt(sum (RPE/T)^2/(2 n)), whose radicand the scan lost.

    Where north and east errors of a rate are normal with one deviation s, n flights estimate s^2 by the sum over 2 n,
    and 95 % of the radial errors are below 2.447747 s.

    >>> round(radial_error_rate([1.0, 2.0, 3.0], [1.0, 2.0, 1.0]), 6)
    3.317316
    """
    distances, durations = checks.numbers("errors", errors), checks.numbers("times", times)
    if distances.shape != durations.shape or distances.ndim != 1 or not distances.size:
        raise InputError(
            f"errors are {distances.size} and times {durations.size}; one of each for a flight is needed"
        )
    if not (durations > 0).all():
        raise InputError(
            "a time is not above 0; the rate of an error is its size over the time of its flight"
        )
    return float(factor * math.sqrt(((distances / durations) ** 2).sum() / (2 * distances.size)))
