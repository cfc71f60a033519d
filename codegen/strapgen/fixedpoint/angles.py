"""Derives atan2, and angles that are reduced by whole turns, as chains of exact quantities."""

from __future__ import annotations

import math
from fractions import Fraction

from strapgen.fixedpoint.chain import Chain
from strapgen.fixedpoint.function_series import PI_ERROR, arctangent_series, pi
from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import ExactOperation, Operand
from strapgen.ir.formats import finest

#: Quotients below 1/2 - 1/16 have the polynomial of the arctangent; those above are measured from the diagonal.
_OCTANT = (Fraction(1, 2), Fraction(-1, 16))

_ONE = Fraction(1)


def arctangent(
    chain: Chain, ordinate: str, abscissa: str, distance: Fraction = Fraction(0), turns: bool = True
) -> None:
    """Make atan2, by the nearer axis or diagonal, then by octant, quadrant, half and side.

    The slope by either argument is at most 1/`distance`, where that is not 0; the ranges may tell more. Without `turns`
    an angle that is off by a whole turn counts as right.
    """
    y, x = chain.computed(ordinate), chain.computed(abscissa)
    height, width = chain.magnitude("height", y), chain.magnitude("width", x)
    beyond, angle = _octant(chain, height, width)
    zero = Fraction(0)
    from_diagonal = _from(chain, Fraction(1, 4), angle, 1)
    angle = chain.add(
        "octant",
        ExactOperation("select", (beyond, zero, from_diagonal, angle)),
        Interval.of(0, pi() / 4 + PI_ERROR),
    )
    if chain.range(height).high > chain.range(width).low:
        angle = chain.selection(
            "quadrant", (width, height, angle), otherwise=_from(chain, Fraction(1, 2), angle, -1)
        )
    if chain.range(x).low < 0:
        angle = chain.selection("half", (x, zero, angle), otherwise=_from(chain, _ONE, angle, -1))
    if chain.range(y).low < 0:
        angle = chain.selection("side", (y, zero, angle), otherwise=_from(chain, zero, angle, -1))
    chain.finish(angle, *_slopes(chain, ordinate, abscissa, distance, turns))


def _octant(chain: Chain, height: str, width: str) -> tuple[str, str]:
    """Return a quantity that is not below 0 beyond the middle of an octant, and the angle.

    The angle is that from the nearer axis; beyond the middle, that from the diagonal.
    """
    heights, widths = chain.range(height), chain.range(width)
    smaller = chain.add(
        "smaller",
        ExactOperation("select", (width, height, height, width)),
        Interval(min(heights.low, widths.low), min(heights.high, widths.high)),
    )
    # At the origin the last place stands for the larger one: the angle is 0 there.
    places = finest(min(heights.magnitude, widths.magnitude), chain.word)
    larger = chain.maximum("larger", width, height, Fraction(2) ** -places)
    most = chain.range(larger).highest
    beyond = chain.sum("beyond", ((smaller,), _ONE), *(((larger,), -c) for c in _OCTANT))
    below = chain.sum("below", ((smaller,), _ONE), ((larger,), -_ONE), within=Interval.of(-most, 0))
    both = chain.sum("both", ((smaller,), _ONE), ((larger,), _ONE))
    zero, share = Fraction(0), sum(_OCTANT, Fraction(0))
    numerator = chain.add(
        "numerator",
        ExactOperation("select", (beyond, zero, below, smaller)),
        Interval.of(-(1 - share) * most, share * most),
    )
    denominator = chain.selection("denominator", (beyond, zero, both), otherwise=larger)
    reach = Interval.of(-(1 - share) / (1 + share), share)
    tangent = chain.add("tangent", ExactOperation("divide", (numerator, denominator)), reach)
    coefficients, left_out = arctangent_series(chain.tolerance)
    square = chain.square(tangent)
    series = chain.polynomial("series", coefficients[1:], square)
    bend = chain.sum("bend", ((square, series), _ONE), ((), coefficients[0] - 1))
    angle = chain.sum(
        "arctangent", ((tangent,), _ONE), ((tangent, bend), _ONE), within=reach, approximation_error=left_out
    )
    return beyond, angle


def _from(chain: Chain, part: Fraction, angle: str, sign: int) -> str:
    """Return an angle measured from a part of half a turn."""
    return chain.sum(
        "angle",
        ((angle,), Fraction(sign)),
        ((), part * pi()),
        approximation_error=PI_ERROR if part else Fraction(0),
    )


def wrap(chain: Chain, argument: str) -> None:
    """Take a whole turn off an angle, or add one: the error is that of the angle, where turns do not count."""
    angle = chain.computed(argument)
    inside = chain.range(angle)
    if inside.magnitude > 3 * pi():
        raise ValueError(
            f"an angle of up to {float(inside.magnitude):.6g} rad is more than a turn and a half"
        )
    grid = 1 << (chain.word - 4)
    limit = Fraction(math.floor(pi() * grid), grid)
    within = Interval.symmetric(limit + Fraction(2, grid))
    value = angle
    cases: list[Operand] = []
    for beyond, left, right, sign in (
        (inside.highest > limit, angle, limit, -1),
        (inside.lowest < -limit, -limit, angle, 1),
    ):
        if beyond:
            other = chain.sum(
                "turned", ((angle,), _ONE), ((), sign * 2 * pi()), approximation_error=2 * PI_ERROR
            )
            cases += [left, right, other]
    if cases:
        value = chain.add("principal", ExactOperation("select", (*cases, angle)), within)
    chain.finish(value, (argument, _ONE))


def _slopes(
    chain: Chain, ordinate: str, abscissa: str, known: Fraction, turns: bool
) -> list[tuple[str, Fraction | None]]:
    """Return bounds of the derivatives: the inverse distance from the origin, none across the cut."""
    y, x = chain.range(ordinate), chain.range(abscissa)
    distances = [max(Fraction(0), inside.lowest, -inside.highest) for inside in (y, x)]
    distance = max(known, Interval.of(sum((d * d for d in distances), Fraction(0))).sqrt().lowest)
    slope = 1 / distance if distance else None
    is_cut = turns and y.low < 0 and x.low < 0
    return [(ordinate, None if is_cut else slope), (abscissa, slope)]
