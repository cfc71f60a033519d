"""Derives the magnetic field of the earth by spherical harmonics, from a file of coefficients."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from functools import cache

import sympy as sp

from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import Direction, exact
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.frame.frame_rates import FENNER
from strapgen.navigation.frame.magnetic_file import MagneticModel

#: Radius that the coefficients belong to, equatorial radius of the ellipsoid WGS 84 in m, and its e^2.
REFERENCE_RADIUS, EQUATORIAL_RADIUS = 6_371_200, 6_378_137
ECCENTRICITY_SQUARED = Fraction("0.00669437999014")
#: Least distance from the centre of the earth in m: 100 km below a pole.
SMALLEST_RADIUS = 6_256_752
#: Years from the epoch, on both sides.
MOST_YEARS = 10

_INPUTS = tuple(
    Signal.scalar(name, unit=unit, meaning=meaning, bound=bound)
    for name, unit, meaning, bound in (
        ("latitude", "rad", "geodetic latitude on the ellipsoid WGS 84", Fraction(355, 226)),
        ("longitude", "rad", "longitude, positive to the east", Fraction(355, 113)),
        ("height", "m", "height above the ellipsoid WGS 84", Fraction(100_000)),
        ("years", "year", "time since the epoch of the coefficients", Fraction(MOST_YEARS)),
    )
)

Pair = tuple[sp.Expr, sp.Expr]


def _harmonics(build: KernelBuilder, a: sp.Matrix, square: sp.Symbol) -> Callable[[int, int], Pair]:
    """Return solid harmonics (R/r)^(n+1) P_n^m(sin latitude) cos and sin(m longitude) by degree and order.

    They are Schmidt semi-normalised, and made by recursion: products of the elements of a = R (x, y, z)/r^2 and of its
    square (R/r)^2 alone, so that nothing is singular at a pole.
    """
    x, y, z = a

    @cache
    def pair(n: int, m: int) -> Pair:
        """Return the harmonics with cosine and sine; zero before the first one of an order."""
        if m > n:
            return sp.S.Zero, sp.S.Zero
        if n == 0:
            return build.value("V_0_0", sp.sqrt(square), "R/r"), sp.S.Zero
        if m == n:
            V, W = pair(n - 1, n - 1)
            factor = sp.sqrt(sp.Rational(2 * n - 1, 2 * n)) if n > 1 else sp.S.One
            formulas = factor * (x * V - y * W), factor * (x * W + y * V)
        else:
            one, two = (2 * n - 1) * z, sp.sqrt((n - 1) ** 2 - m**2) * square
            root = sp.sqrt(n**2 - m**2)
            both = zip(pair(n - 1, m), pair(n - 2, m), strict=True)
            formulas = tuple(one / root * before - two / root * again for before, again in both)
        about = f"degree {n}, order {m}"
        cosine = build.value(f"V_{n}_{m}", formulas[0], f"harmonic with the cosine, {about}")
        return cosine, build.value(
            f"W_{n}_{m}", formulas[1], f"harmonic with the sine, {about}"
        ) if m else sp.S.Zero

    return pair


def _normal(n: int, m: int) -> sp.Expr:
    """Return the factor of Schmidt's semi-normalisation, by which a function of Legendre is multiplied."""
    return sp.sqrt(sp.Rational(2 if m else 1) * sp.factorial(n - m) / sp.factorial(n + m))


def _gradient(model: MagneticModel, n: int, k: int, rates: bool) -> list[tuple[sp.Expr, sp.Expr]]:
    """Return the factors of V and W of degree n + 1 and order k in the field along x, y and z, by the degree n.

    The derivatives of a harmonic are harmonics of the next degree: with Z = V + i W, not normalised,
    2 R dZ_n^m/dx = -Z_(n+1)^(m+1) + (n-m+1)(n-m+2) Z_(n+1)^(m-1), 2 R dZ_n^m/dy = i times the same with both signs
    plus, and R dZ_n^m/dz = -(n-m+1) Z_(n+1)^m; of order 0, R dZ/dx = -V_(n+1)^1 and R dZ/dy = -W_(n+1)^1.
    """

    def pair(m: int, factor: sp.Expr) -> sp.Matrix:
        """Return the coefficients of an order times a factor, or zeros where there is none."""
        c = model.harmonics.get((n, m))
        if c is None:
            return sp.zeros(2, 1)
        scale = factor * _normal(n, m) / _normal(n + 1, k)
        return scale * sp.Matrix([exact(x) for x in ((c.g_rate, c.h_rate) if rates else (c.g, c.h))])

    up = pair(k - 1, sp.Rational(1, 2) if k > 1 else sp.S.One)
    down = pair(k + 1, sp.Rational((n - k) * (n - k + 1), 2))
    turned = up + down
    return [tuple(up - down), (-turned[1], turned[0]), tuple(pair(k, sp.Integer(n - k + 1)))]


def _largest(model: MagneticModel, n: int) -> int:
    """Return a number that no component of the field of a degree exceeds, in nT.

    By the addition theorem the squares of the functions of a degree add up to 1 over the orders, and those of their
    gradients on the sphere to n (n+1): the field is at most (R/r)^(n+2) sqrt((n+1)(2n+1)) times the root of the sum
    of squares of the coefficients.
    """
    harmonics = [model.harmonics[n, m] for m in range(n + 1)]
    total = sum(
        (abs(at) + MOST_YEARS * abs(rate)) ** 2
        for c in harmonics
        for at, rate in ((c.g, c.g_rate), (c.h, c.h_rate))
    )
    largest = sp.Rational(REFERENCE_RADIUS, SMALLEST_RADIUS) ** (n + 2)
    return int(sp.ceiling(largest * sp.sqrt((n + 1) * (2 * n + 1) * exact(total))))


def _earth_fixed(
    build: KernelBuilder, pair: Callable[[int, int], Pair], model: MagneticModel, years: sp.Symbol
) -> sp.Matrix:
    """Return the field, minus the gradient of R sum of g V + h W, in earth-fixed axes: a sum over the degrees."""
    field = sp.zeros(3, 1)
    for n in range(1, model.degree + 1):
        part = sp.zeros(3, 1)
        for k in range(n + 2):
            at, rate = (_gradient(model, n, k, rates) for rates in (False, True))
            for axis in range(3):
                for harmonic, now, change in zip(pair(n + 1, k), at[axis], rate[axis], strict=True):
                    part[axis] += harmonic * (now + change * years)
        free, limited = (
            Signal.vector(
                name, name, unit="nT", meaning=f"field of degree {n}, earth-fixed axes{words}", frame="e"
            )
            for name, words in ((f"degree_{n}", ""), (f"limited_{n}", ", limited"))
        )
        most = sp.Integer(_largest(model, n))
        field += build.stage(limited, [sp.Max(-most, -sp.Max(-most, -x)) for x in build.stage(free, part)])
    return field


def magnetic_field(model: MagneticModel) -> Kernel:
    """Return the magnetic field of a model at a geodetic position and a time, in nT, with its direction.

    Returns: inputs ``latitude``, ``longitude`` in rad, ``height`` in m and ``years``; outputs ``field`` (3,) to north,
    east and down, ``horizontal`` and ``total`` in nT, ``declination`` and ``inclination`` in rad.
    """
    build = KernelBuilder()
    latitude, longitude, height, years = map(build.scalar, _INPUTS)
    (cl, sl), (co, so) = (
        (build.value(f"cos_{angle}", sp.cos(angle)), build.value(f"sin_{angle}", sp.sin(angle)))
        for angle in (latitude, longitude)
    )
    square = exact(ECCENTRICITY_SQUARED)
    normal = build.value(
        "normal",
        sp.Rational(EQUATORIAL_RADIUS, REFERENCE_RADIUS) / sp.sqrt(1 - square * sl**2),
        "transverse radius over R",
    )
    far = build.value("far", normal + height / REFERENCE_RADIUS, "transverse radius and height over R")
    less = build.value("less", square * normal, "what the radius along the axis lacks")
    # (r/R)^2 in a form that stays near 1 whatever sine and cosine are
    ratio = build.value("ratio", 1 / (far**2 - less * (2 * far - less) * sl**2), "(R/r)^2")
    across = build.value("across", ratio * far * cl, "R times the distance from the axis over r^2")
    a = build.stage(
        Signal.vector("inverse", "a", meaning="R (x, y, z)/r^2, earth-fixed axes"),
        [across * co, across * so, ratio * (far - less) * sl],
    )
    x, y, z = build.stage(
        Signal.vector("earth_fixed", "B", unit="nT", meaning="field, earth-fixed axes", frame="e"),
        _earth_fixed(build, _harmonics(build, a, ratio), model, years),
    )
    outward = build.value("outward", co * x + so * y, "field away from the axis")
    names = ("north_field", "east_field", "down_field")
    field = Signal(
        "field", (3,), names, unit="nT", meaning="magnetic field to north, east and down", frame="g"
    )
    north, east, down = build.output(
        field, [cl * z - sl * outward, co * y - so * x, -(cl * outward + sl * z)]
    )
    horizontal = build.output(
        Signal.scalar("horizontal", unit="nT", meaning="horizontal field"), [sp.sqrt(north**2 + east**2)]
    )[0]
    for name, unit, meaning, value in (
        ("total", "nT", "magnitude of the field", sp.sqrt(north**2 + east**2 + down**2)),
        (
            "declination",
            "rad",
            "direction of the horizontal field, from north over east",
            Direction(east, north),
        ),
        ("inclination", "rad", "angle of the field below the horizontal plane", sp.atan2(down, horizontal)),
    ):
        build.output(Signal.scalar(name, unit=unit, meaning=meaning), [value])
    return build.kernel(
        f"magnetic-field-{model.name}",
        f"Magnetic field of {model.title}, to degree {model.degree}",
        f"{model.title}, epoch {float(model.epoch):g}; named in {FENNER}; harmonics and their gradient derived",
        arguments=f"magnetic-field {model.option}",
        notes=(
            "The limits of the field of a degree are what its coefficients allow, within 10 years and 100 km of "
            "height: no proper input reaches them.",
            "Where the horizontal field vanishes it has no direction: the error of a declination in rad is at most "
            "pi/2 times that of the horizontal components over the horizontal field.",
        ),
    )
