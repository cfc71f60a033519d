"""Derives sine, cosine, sin(x)/x and atan2 as sums of products, quotients and selections, with bounds of their errors.

Every function is derived from the computed value of its argument, taken as exact: then all comparisons are exact, the
argument is reduced by identities, and a polynomial is cut where a word cannot tell any more. The derivative alone tells
what becomes of the error of the argument.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction

from strapgen.fixedpoint.angles import arctangent, wrap
from strapgen.fixedpoint.chain import Chain
from strapgen.fixedpoint.function_series import PI_ERROR, pi, sine_series
from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import ExactOperation, Sum

#: Arguments of sine and cosine up to here need no reduction.
_UNREDUCED = Fraction(5, 4)
#: Arguments of sin(x)/x up to here have a polynomial; above, sin(x) is divided by x.
_NEAR_ZERO = Fraction(2)
#: More than the largest slope of sin(x)/x, which is 0.43618.
_SINC_SLOPE = Fraction(7, 16)

_ONE = Fraction(1)


def _sine(chain: Chain, argument: str) -> None:
    """Make the sine."""
    chain.finish(_wave(chain, 1, chain.computed(argument)), (argument, _ONE))


def _cosine(chain: Chain, argument: str) -> None:
    """Make the cosine; of a root, from its radicand, because the root is inexact near 0."""
    under_root = _under_root(chain, argument)
    if under_root is not None and chain.range(argument).magnitude <= _UNREDUCED:
        value = _wave_series(chain, 0, argument, chain.computed(under_root))
        chain.finish(value, (under_root, Fraction(1, 2)))  # the largest slope by what is under the root
        return
    chain.finish(_wave(chain, 0, chain.computed(argument)), (argument, _ONE))


def _sinc(chain: Chain, argument: str) -> None:
    """Make sin(x)/x, from the square of x where x is a root: near 0 the root is inexact, and does not matter."""
    under_root = _under_root(chain, argument)
    if under_root is None:
        limited, limit = chain.magnitude("size", chain.computed(argument)), _NEAR_ZERO
        slopes = [(argument, _SINC_SLOPE)]
    else:
        limited, limit = chain.computed(under_root), _NEAR_ZERO**2
        slopes = [(under_root, Fraction(1, 6))]
    inside = chain.range(limited)
    if inside.highest <= limit:
        chain.finish(_sinc_series(chain, limited, under_root is not None), *slopes)
        return
    bounded = inside.meet(Interval.of(inside.lowest, limit))
    near = chain.add("near", ExactOperation("select", (limited, limit, limit, limited)), bounded)
    value = _sinc_series(chain, near, under_root is not None)
    size = limited
    if under_root is not None:
        root = chain.add("root", ExactOperation("sqrt", (limited,)), inside.sqrt())
        size = chain.computed(root)
        slopes.append((root, _SINC_SLOPE))
    far = chain.maximum("far", size, _NEAR_ZERO)
    reach = Interval.of(Fraction(-1, 2), Fraction(1, 2))
    quotient = chain.add("quotient", ExactOperation("divide", (_wave(chain, 1, far), far)), reach)
    chain.finish(chain.selection("part", (limited, limit, quotient), otherwise=value), *slopes)


def _wave(chain: Chain, first: int, angle: str) -> str:
    """Return the sine, for first 1, or the cosine, for 0, of an exact quantity."""
    if chain.range(angle).magnitude <= _UNREDUCED:
        return _wave_series(chain, first, angle, chain.square(angle))
    turns, rest = _reduced(chain, angle)
    square = chain.square(rest)
    up, across = (_wave_series(chain, degree, rest, square) for degree in (1, 0))
    down, back = (chain.sum("opposite", ((value,), -_ONE)) for value in (up, across))
    # By quarter turns from -2 to 1.
    values = (down, back, up, across) if first else (back, up, across, down)
    cases = [(turns, Fraction(k - 2), values[k]) for k in (3, 2, 1)]
    return chain.selection("quarter", *cases, otherwise=values[0])


def _reduced(chain: Chain, angle: str) -> tuple[str, str]:
    """Return the quarter turns in an angle, from -2 to 1 without full turns, and the angle that is left."""
    inside = chain.range(angle)
    # Any number of quarter turns would be right: the nearest, which the code computes, keeps the rest small.
    grid = 1 << (chain.word - 1)
    factor = Fraction(round(2 / pi() * grid), grid)
    wrong = abs(1 - factor * pi() / 2) + PI_ERROR
    most = (pi() + PI_ERROR) / 4 + inside.magnitude * wrong
    if most > Fraction(7, 8):
        raise ValueError(
            f"words of {chain.word} bits are too short for the sine of angles up to {float(inside.magnitude):.6g} rad"
        )
    ends = [math.floor(end * factor + Fraction(1, 2)) for end in (inside.lowest, inside.highest)]
    count = chain.add("quarters", ExactOperation("nearest", (angle, factor)), Interval.of(*ends))
    # A quarter turn in two parts: the first is exact in a word, the second is what it lacks.
    coarse = Fraction(math.floor(pi() * grid / 4), grid // 2)
    rest = chain.sum(
        "rest",
        ((angle,), _ONE),
        ((count,), -coarse),
        ((count,), coarse - pi() / 2),
        within=Interval.symmetric(most),
        approximation_error=chain.range(count).magnitude * PI_ERROR,
    )
    if ends[0] >= -2 and ends[1] <= 1:
        return count, rest
    full = [math.floor(Fraction(end, 4) + Fraction(1, 2)) for end in ends]
    whole = chain.add("turns", ExactOperation("nearest", (count, Fraction(1, 4))), Interval.of(*full))
    part = chain.sum("quarter_turns", ((count,), _ONE), ((whole,), Fraction(-4)), within=Interval.of(-2, 1))
    return part, rest


def _wave_series(chain: Chain, first: int, angle: str, square: str) -> str:
    """Return the series of the sine or the cosine."""
    inside = chain.range(angle)
    coefficients, left_out = sine_series(first, inside.magnitude, chain.tolerance)
    if not first:
        return _even_series(chain, "cosine", coefficients, square, left_out)
    bend = _product(chain, coefficients[1:], square)
    # The sine lies between 0 and its argument.
    ends = (max(-_ONE, min(inside.lowest, Fraction(0))), min(_ONE, max(inside.highest, Fraction(0))))
    return chain.sum(
        "sine",
        ((angle,), _ONE),
        ((angle, bend), _ONE),
        within=Interval.of(*ends),
        approximation_error=left_out,
    )


def _even_series(
    chain: Chain, label: str, coefficients: Sequence[Fraction], square: str, left_out: Fraction
) -> str:
    """Return the series of the cosine or of sin(x)/x: it begins with 1, and lies between -1 and 1."""
    bend = _product(chain, coefficients[2:], square)
    return chain.sum(
        label,
        ((square,), coefficients[1]),
        ((square, bend), _ONE),
        ((), coefficients[0]),
        within=Interval.of(max(-_ONE, 1 + coefficients[1] * chain.range(square).highest), 1),
        approximation_error=left_out,
    )


def _product(chain: Chain, coefficients: Sequence[Fraction], square: str) -> str:
    """Return the square times a polynomial of it."""
    if len(coefficients) == 1:
        return chain.sum("bend", ((square,), coefficients[0]))
    return chain.sum("bend", ((square, chain.polynomial("series", coefficients, square)), _ONE))


def _sinc_series(chain: Chain, argument: str, is_square: bool) -> str:
    """Return the series of sin(x)/x near 0, from x or from its square."""
    square = argument if is_square else chain.square(argument)
    reach = max(chain.range(square).sqrt().highest, Fraction(1, 1 << chain.word))
    coefficients, left_out = sine_series(1, reach, chain.tolerance * reach)
    return _even_series(chain, "series", coefficients, square, left_out / reach)


def _under_root(chain: Chain, argument: str) -> str | None:
    """Return the square of an argument that is a root, or an exact multiple of one."""
    quantity = chain.known[argument]
    match quantity.definition:
        case ExactOperation("sqrt", (str(radicand),)):
            return radicand
        case Sum((((str(name),), factor),)) if not quantity.offset:
            match chain.known[name].definition:
                case ExactOperation("sqrt", (str(radicand),)):
                    return chain.sum("under_root", ((radicand,), factor * factor))
    return None


_FUNCTIONS: dict[str, Callable[..., None]] = {
    "sin": _sine,
    "cos": _cosine,
    "sinc": _sinc,
    "atan2": arctangent,
    "direction": arctangent,
    "wrap": wrap,
}


def derive_function(
    kind: str, chain: Chain, arguments: Sequence[str], distance: Fraction = Fraction(0)
) -> None:
    """Append to a chain the quantities from which a function is computed; the last is its value."""
    options = {"distance": distance, "turns": kind == "atan2"} if kind in ("atan2", "direction") else {}
    _FUNCTIONS[kind](chain, *arguments, **options)
