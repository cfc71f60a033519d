"""Sine, cosine, sin(x)/x and atan2 as sums of products, quotients and choices, with bounds of what is left out.

Every function is derived from the computed value of its argument, taken as exact: then all comparisons are exact, the
argument is reduced by identities, and a polynomial is cut where a word cannot tell any more. How the error of the
argument goes on is known from the derivative alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache, partial

from strapgen.fixedpoint.formats import finest
from strapgen.fixedpoint.intervals import Interval, maximum
from strapgen.fixedpoint.quantities import (
    Computed,
    Definition,
    ErrorPropagation,
    InputElement,
    Maximum,
    Monomial,
    NearestInteger,
    Operand,
    Quantity,
    Quotient,
    Selection,
    SquareRoot,
    Sum,
)

#: Bits of `pi`, and a bound of what it lacks.
_PI_BITS = 256
PI_ERROR = Fraction(1, 1 << (_PI_BITS - 8))
#: Arguments of sine and cosine up to here need no reduction.
_UNREDUCED = Fraction(5, 4)
#: Arguments of sin(x)/x up to here have a polynomial; above, sin(x) is divided by x.
_NEAR_ZERO = Fraction(2)
#: More than the largest slope of sin(x)/x, which is 0.43618.
_SINC_SLOPE = Fraction(7, 16)
#: Quotients below 1/2 - 1/16 have the polynomial of the arctangent; those above are measured from the diagonal.
_OCTANT = (Fraction(1, 2), Fraction(-1, 16))
#: Parameter p of the arctangent's series, which holds up to 2p/(1 - p^2) = 0.4394.
_ARCTANGENT = Fraction(21, 100)

_ONE = Fraction(1)
_Term = tuple[Monomial, Fraction]


def derived(
    kind: str,
    name: str,
    arguments: Sequence[str],
    known: Mapping[str, Quantity],
    same: dict[Definition, str],
    free: Callable[[str], str],
    word: int,
    distance: Fraction = Fraction(0),
) -> list[Quantity]:
    """Return the quantities that make a function of others, in order; the last is the function.

    Parameters
    ----------
    kind : str
        "sin", "cos", "sinc", "atan2", "direction" or "wrap".
    name : str
        Name of the function's value.
    arguments : sequence of str
        What it is a function of, stored whole.
    known : mapping of str to Quantity
        The quantities that are there.
    same : dict of Definition to str
        What other functions were made from, by definition; what is made here is added.
    free : callable
        Makes a name that no other quantity has out of one that may be taken.
    word : int
        Bits of a word.
    distance : Fraction, optional
        The inverse of a bound of how fast atan2 changes with its arguments, where more is known than their ranges tell.

    Returns
    -------
    list of Quantity

    Raises
    ------
    ValueError
        If the range of an argument is too wide.
    """
    chain = _Chain(name, known, same, free, word)
    makers: dict[str, Callable[..., None]] = {
        "sin": _sine,
        "cos": _cosine,
        "sinc": _sinc,
        "atan2": partial(_arctangent, distance=distance),
        "direction": partial(_arctangent, distance=distance, turns=False),
        "wrap": _wrap,
    }
    makers[kind](chain, *arguments)
    return chain.made


class _Chain:
    """Quantities in order, each made from those before it, all with proved ranges."""

    def __init__(
        self,
        name: str,
        known: Mapping[str, Quantity],
        same: dict[Definition, str],
        free: Callable[[str], str],
        word: int,
    ) -> None:
        self.name, self.known, self.same, self.free, self.word = name, known, same, free, word
        self.made: list[Quantity] = []
        self.ranges: dict[str, Interval] = {}
        #: What a series may leave out: an eighth of the last place of a word that holds 1.
        self.tolerance = Fraction(1, 1 << (word + 1))

    def range(self, operand: Operand) -> Interval:
        """Return the proved range of a quantity or constant."""
        if isinstance(operand, Fraction):
            return Interval.of(operand)
        return self.ranges[operand] if operand in self.ranges else self.known[operand].range

    def add(
        self,
        label: str,
        definition: Definition,
        enclosure: Interval,
        inexact: Fraction = Fraction(0),
        follows: ErrorPropagation | None = None,
    ) -> str:
        """Make a quantity, unless it is there; without a label it is the function's value."""
        if label and definition in self.same:
            return self.same[definition]
        name = self.name
        if label:
            name = self.free(f"{self.name}_{label}")
            count = 2
            while name in self.ranges:
                name, count = self.free(f"{self.name}_{label}_{count}"), count + 1
            self.same[definition] = name
        self.made.append(Quantity(name, definition, Fraction(0), enclosure, inexact=inexact, follows=follows))
        self.ranges[name] = enclosure
        return name

    def sum(
        self,
        label: str,
        *terms: _Term,
        within: Interval | None = None,
        inexact: Fraction = Fraction(0),
        follows: ErrorPropagation | None = None,
    ) -> str:
        """Make a sum of products; `within` is a range that is known otherwise."""
        enclosure = Interval(0, 0)
        for monomial, coefficient in terms:
            ranges = [self.range(factor) for factor in monomial]
            if not ranges:
                enclosure += Interval.of(coefficient)
            elif len(ranges) == 1:
                enclosure += ranges[0].scale(coefficient)
            else:
                square = monomial[0] == monomial[1]
                product = ranges[0].square() if square else ranges[0] * ranges[1]
                enclosure += product.scale(coefficient)
        enclosure = enclosure.widened(inexact)
        return self.add(
            label,
            Sum(tuple((m, c) for m, c in terms if c)),
            enclosure if within is None else enclosure.meet(within),
            inexact,
            follows,
        )

    def choice(self, label: str, *cases: tuple[Operand, Operand, Operand], otherwise: Operand) -> str:
        """Make a choice by comparisons of exact quantities."""
        enclosure = self.range(otherwise)
        for _, _, chosen in cases:
            enclosure = enclosure.join(self.range(chosen))
        return self.add(label, Selection(cases, otherwise), enclosure)

    def largest(self, label: str, *arguments: Operand) -> str:
        """Make the largest of several."""
        return self.add(label, Maximum(arguments), maximum(map(self.range, arguments)))

    def taken(self, argument: str) -> str:
        """Return an argument as it is computed, without an error of its own."""
        if argument in self.known and isinstance(self.known[argument].definition, InputElement):
            return argument
        return self.add("taken", Computed(argument), self.range(argument))

    def magnitude(self, label: str, argument: str) -> str:
        """Return the magnitude of a quantity."""
        inside = self.range(argument)
        if inside.low >= 0:
            return argument
        negative = self.sum("negative", ((argument,), -_ONE))
        enclosure = Interval(0, Interval.of(inside.magnitude).high)
        return self.add(label, Maximum((argument, negative)), enclosure)

    def polynomial(self, label: str, coefficients: Sequence[Fraction], variable: str) -> str:
        """Make a polynomial of two or more coefficients, from the last to the first."""
        *others, held = coefficients
        inner: Operand = held
        for coefficient in reversed(others):
            term = ((variable,), inner) if isinstance(inner, Fraction) else ((variable, inner), _ONE)
            inner = self.sum(label, term, ((), coefficient))
        assert isinstance(inner, str)
        return inner


# Series, as coefficients and a bound of what is left out


@cache
def pi() -> Fraction:
    """Return a rational number below pi, by less than 2**-248.

    Examples
    --------
    >>> float(pi())
    3.141592653589793
    """

    def arctangent_of_inverse(whole: int) -> Fraction:
        total, k = Fraction(0), 0
        while whole ** (2 * k + 1) < 1 << (_PI_BITS + 8):
            total += Fraction((-1) ** k, (2 * k + 1) * whole ** (2 * k + 1))
            k += 1
        return total

    # Machin's formula. The series alternate, so that either is off by less than its first term that is missing.
    value = 16 * arctangent_of_inverse(5) - 4 * arctangent_of_inverse(239) - Fraction(1, 1 << (_PI_BITS + 2))
    return Fraction(math.floor(value * (1 << _PI_BITS)), 1 << _PI_BITS)


def sine_series(first: int, reach: Fraction, tolerance: Fraction) -> tuple[tuple[Fraction, ...], Fraction]:
    """Return the series of the sine or the cosine in the square of its argument, with a bound of what is left out.

    Parameters
    ----------
    first : int
        Degree that the series begins with: 0 for the cosine, 1 for the sine.
    reach : Fraction
        Largest magnitude of the argument, at most 2.
    tolerance : Fraction
        What may be left out.

    Returns
    -------
    coefficients : tuple of Fraction
    left_out : Fraction

    Examples
    --------
    >>> sine_series(1, Fraction(1), Fraction(1, 5040))
    ((Fraction(1, 1), Fraction(-1, 6), Fraction(1, 120)), Fraction(1, 5040))
    """
    # The terms alternate and fall from the third on: what is left out is less than its first term.
    degree = first
    coefficients: list[Fraction] = []
    while len(coefficients) < 3 or reach**degree > tolerance * math.factorial(degree):
        coefficients.append(Fraction((-1) ** (degree // 2), math.factorial(degree)))
        degree += 2
    return tuple(coefficients), reach**degree / math.factorial(degree)


@cache
def arctangent_series(tolerance: Fraction) -> tuple[tuple[Fraction, ...], Fraction]:
    """Return a polynomial in u^2 that is arctan(u)/u, and a bound of the error of their product with u.

    With u = (2p/(1 - p^2)) x, arctan(u) is the sum of 2 (-1)^k p^(2k+1)/(2k+1) T_(2k+1)(x), T Chebyshev's polynomials,
    none of which exceeds 1 for x from -1 to 1.

    Parameters
    ----------
    tolerance : Fraction
        What may be left out.

    Returns
    -------
    coefficients : tuple of Fraction
    left_out : Fraction
    """
    p = _ARCTANGENT
    scale = (1 - p * p) / (2 * p)
    total: list[Fraction] = []
    older, newer = [_ONE], [Fraction(0), _ONE]  # Chebyshev's polynomials 0 and 1, by powers
    number = 1
    while True:
        factor = 2 * (-1) ** (number // 2) * p**number / number
        total = [
            (total[k] if k < len(total) else Fraction(0)) + factor * newer[2 * k + 1]
            for k in range(number // 2 + 1)
        ]
        number += 2
        left_out = 2 * p**number / (number * (1 - p * p))
        if len(total) > 2 and left_out <= tolerance:
            break
        for _ in range(2):
            older, newer = newer, _next_chebyshev(older, newer)
    return tuple(c * scale ** (2 * k + 1) for k, c in enumerate(total)), left_out


def _next_chebyshev(older: list[Fraction], newer: list[Fraction]) -> list[Fraction]:
    doubled = [Fraction(0), *(2 * c for c in newer)]
    return [c - (older[k] if k < len(older) else 0) for k, c in enumerate(doubled)]


# Sine and cosine


def _sine(chain: _Chain, argument: str) -> None:
    _finish(chain, _wave(chain, 1, chain.taken(argument)), (argument, _ONE))


def _cosine(chain: _Chain, argument: str) -> None:
    under_root = _under_root(chain, argument)
    if under_root is not None and chain.range(argument).magnitude <= _UNREDUCED:
        # Of a root it is a function of what is under it, whose slope is at most 1/2: the root is inexact near 0.
        _finish(
            chain, _wave_series(chain, 0, argument, chain.taken(under_root)), (under_root, Fraction(1, 2))
        )
        return
    _finish(chain, _wave(chain, 0, chain.taken(argument)), (argument, _ONE))


def _finish(chain: _Chain, value: str, *slopes: tuple[str, Fraction | None]) -> None:
    """Make the last quantity the function's value, whose error follows those of what was taken as exact."""
    inside = chain.range(value)
    follows = ErrorPropagation(slopes, inside.highest - inside.lowest)
    last = chain.made[-1] if chain.made else None
    if last is not None and last.name == value and isinstance(last.definition, Sum):
        del chain.same[last.definition]
        chain.made[-1] = replace(last, name=chain.name, follows=follows)
    else:  # one that is rounded to a word where a word is needed
        chain.sum("", ((value,), _ONE), follows=follows)


def _wave(chain: _Chain, first: int, angle: str) -> str:
    """Return the sine, for first 1, or the cosine, for 0, of an exact quantity."""
    if chain.range(angle).magnitude <= _UNREDUCED:
        return _wave_series(chain, first, angle, _squared(chain, angle))
    turns, rest = _reduced(chain, angle)
    square = _squared(chain, rest)
    sine, cosine = (_wave_series(chain, degree, rest, square) for degree in (1, 0))
    opposite = [chain.sum("opposite", ((value,), -_ONE)) for value in (sine, cosine)]
    # By quarter turns from -2 to 1.
    values = (opposite[0], opposite[1], sine, cosine) if first else (opposite[1], sine, cosine, opposite[0])
    cases = [(turns, Fraction(k - 2), values[k]) for k in (3, 2, 1)]
    return chain.choice("quarter", *cases, otherwise=values[0])


def _reduced(chain: _Chain, angle: str) -> tuple[str, str]:
    """Return the number of quarter turns in an angle, from -2 to 1 but for full turns, and the angle that is left."""
    inside = chain.range(angle)
    # The number of quarter turns is what the code finds: any integer would do, that one keeps the rest small.
    grid = 1 << (chain.word - 1)
    factor = Fraction(round(2 / pi() * grid), grid)
    wrong = abs(1 - factor * pi() / 2) + PI_ERROR
    most = (pi() + PI_ERROR) / 4 + inside.magnitude * wrong
    if most > Fraction(7, 8):
        raise ValueError(
            f"words of {chain.word} bits are too short for the sine of angles up to {float(inside.magnitude):.6g} rad"
        )
    ends = [math.floor(end * factor + Fraction(1, 2)) for end in (inside.lowest, inside.highest)]
    count = chain.add("quarters", NearestInteger(angle, factor), Interval.of(*ends))
    # A quarter turn in two parts: the first is exact in a word, the second is what it lacks.
    coarse = Fraction(math.floor(pi() * grid / 4), grid // 2)
    rest = chain.sum(
        "rest",
        ((angle,), _ONE),
        ((count,), -coarse),
        ((count,), coarse - pi() / 2),
        within=Interval.symmetric(most),
        inexact=chain.range(count).magnitude * PI_ERROR,
    )
    if ends[0] >= -2 and ends[1] <= 1:
        return count, rest
    full = [math.floor(Fraction(end, 4) + Fraction(1, 2)) for end in ends]
    whole = chain.add("turns", NearestInteger(count, Fraction(1, 4)), Interval.of(*full))
    part = chain.sum("quarter_turns", ((count,), _ONE), ((whole,), Fraction(-4)), within=Interval.of(-2, 1))
    return part, rest


def _squared(chain: _Chain, argument: str) -> str:
    return chain.sum("square", ((argument, argument), _ONE))


def _wave_series(chain: _Chain, first: int, angle: str, square: str) -> str:
    """Return the series of the sine or the cosine."""
    inside = chain.range(angle)
    coefficients, left_out = sine_series(first, inside.magnitude, chain.tolerance)
    if not first:
        return _even_series(chain, "cosine", coefficients, square, left_out)
    bend = _product(chain, coefficients[1:], square)
    # The sine lies between 0 and its argument.
    ends = (max(-_ONE, min(inside.lowest, Fraction(0))), min(_ONE, max(inside.highest, Fraction(0))))
    return chain.sum(
        "sine", ((angle,), _ONE), ((angle, bend), _ONE), within=Interval.of(*ends), inexact=left_out
    )


def _even_series(
    chain: _Chain, label: str, coefficients: Sequence[Fraction], square: str, left_out: Fraction
) -> str:
    """Return the series of the cosine or of sin(x)/x: it begins with 1, and lies between -1 and 1."""
    bend = _product(chain, coefficients[2:], square)
    return chain.sum(
        label,
        ((square,), coefficients[1]),
        ((square, bend), _ONE),
        ((), coefficients[0]),
        within=Interval.of(max(-_ONE, 1 + coefficients[1] * chain.range(square).highest), 1),
        inexact=left_out,
    )


def _product(chain: _Chain, coefficients: Sequence[Fraction], square: str) -> str:
    """Return the square times a polynomial of it."""
    if len(coefficients) == 1:
        return chain.sum("bend", ((square,), coefficients[0]))
    return chain.sum("bend", ((square, chain.polynomial("series", coefficients, square)), _ONE))


# sin(x)/x


def _sinc(chain: _Chain, argument: str) -> None:
    """Make sin(x)/x from the square of x where x is a root: near 0 the root is inexact, and does not matter."""
    under_root = _under_root(chain, argument)
    if under_root is None:
        size = chain.magnitude("size", chain.taken(argument))
        limited, limit = size, _NEAR_ZERO
        slopes = [(argument, _SINC_SLOPE)]
    else:
        limited, limit = chain.taken(under_root), _NEAR_ZERO**2
        slopes = [(under_root, Fraction(1, 6))]
    inside, near = chain.range(limited), limited
    is_near = inside.highest <= limit
    if not is_near:
        bounded = inside.meet(Interval.of(inside.lowest, limit))
        near = chain.add("near", Selection(((limited, limit, limit),), limited), bounded)
    square = near if under_root is not None else _squared(chain, near)
    reach = max(chain.range(square).sqrt().highest, Fraction(1, 1 << chain.word))
    coefficients, left_out = sine_series(1, reach, chain.tolerance * reach)
    value = _even_series(chain, "series", coefficients, square, left_out / reach)
    if not is_near:
        if under_root is not None:
            root = chain.add("root", SquareRoot(limited), inside.sqrt())
            size = chain.taken(root)
            slopes.append((root, _SINC_SLOPE))
        far = chain.largest("far", size, _NEAR_ZERO)
        quotient = chain.add(
            "quotient", Quotient(_wave(chain, 1, far), far), Interval.of(Fraction(-1, 2), Fraction(1, 2))
        )
        value = chain.choice("part", (limited, limit, quotient), otherwise=value)
    _finish(chain, value, *slopes)


def _under_root(chain: _Chain, argument: str) -> str | None:
    """Return the square of an argument that is a root, or an exact multiple of one."""
    definition = chain.known[argument].definition
    if isinstance(definition, SquareRoot):
        return definition.argument
    if isinstance(definition, Sum) and len(definition.terms) == 1:
        ((monomial, factor),) = definition.terms
        inner = chain.known[monomial[0]].definition if len(monomial) == 1 else None
        if isinstance(inner, SquareRoot) and not chain.known[argument].offset:
            return chain.sum("under_root", ((inner.argument,), factor * factor))
    return None


# atan2


def _arctangent(chain: _Chain, ordinate: str, abscissa: str, distance: Fraction, turns: bool = True) -> None:
    y, x = chain.taken(ordinate), chain.taken(abscissa)
    height, width = chain.magnitude("height", y), chain.magnitude("width", x)
    heights, widths = chain.range(height), chain.range(width)
    smaller = chain.add(
        "smaller",
        Selection(((width, height, height),), width),
        Interval(min(heights.low, widths.low), min(heights.high, widths.high)),
    )
    # At the origin the last place stands for the larger one: the angle is 0 there.
    places = finest(min(heights.magnitude, widths.magnitude), chain.word)
    larger = chain.largest("larger", width, height, Fraction(2) ** -places)
    most = chain.range(larger).highest
    # The quotient is the tangent of the angle from the nearer axis, or from the diagonal.
    beyond = chain.sum("beyond", ((smaller,), _ONE), *(((larger,), -c) for c in _OCTANT))
    below = chain.sum("below", ((smaller,), _ONE), ((larger,), -_ONE), within=Interval.of(-most, 0))
    both = chain.sum("both", ((smaller,), _ONE), ((larger,), _ONE))
    zero, share = Fraction(0), sum(_OCTANT, Fraction(0))
    numerator = chain.add(
        "numerator",
        Selection(((beyond, zero, below),), smaller),
        Interval.of(-(1 - share) * most, share * most),
    )
    denominator = chain.choice("denominator", (beyond, zero, both), otherwise=larger)
    reach = Interval.of(-(1 - share) / (1 + share), share)
    tangent = chain.add("tangent", Quotient(numerator, denominator), reach)
    coefficients, left_out = arctangent_series(chain.tolerance)
    square = _squared(chain, tangent)
    series = chain.polynomial("series", coefficients[1:], square)
    bend = chain.sum("bend", ((square, series), _ONE), ((), coefficients[0] - 1))
    angle = chain.sum(
        "arctangent", ((tangent,), _ONE), ((tangent, bend), _ONE), within=reach, inexact=left_out
    )
    from_diagonal = _from(chain, Fraction(1, 4), angle, 1)
    angle = chain.add(
        "octant", Selection(((beyond, zero, from_diagonal),), angle), Interval.of(0, pi() / 4 + PI_ERROR)
    )
    if heights.high > widths.low:
        angle = chain.choice(
            "quadrant", (width, height, angle), otherwise=_from(chain, Fraction(1, 2), angle, -1)
        )
    if chain.range(x).low < 0:
        angle = chain.choice("half", (x, zero, angle), otherwise=_from(chain, _ONE, angle, -1))
    if chain.range(y).low < 0:
        angle = chain.choice("side", (y, zero, angle), otherwise=_from(chain, zero, angle, -1))
    _finish(chain, angle, *_slopes(chain, ordinate, abscissa, distance, turns))


def _from(chain: _Chain, part: Fraction, angle: str, sign: int) -> str:
    """Return an angle measured from a part of half a turn."""
    return chain.sum(
        "angle", ((angle,), Fraction(sign)), ((), part * pi()), inexact=PI_ERROR if part else Fraction(0)
    )


def _wrap(chain: _Chain, argument: str) -> None:
    """Take a whole turn off an angle, or add one: the error is that of the angle, where turns do not count."""
    angle = chain.taken(argument)
    inside = chain.range(angle)
    if inside.magnitude > 3 * pi():
        raise ValueError(
            f"an angle of up to {float(inside.magnitude):.6g} rad is more than a turn and a half"
        )
    grid = 1 << (chain.word - 4)
    limit = Fraction(math.floor(pi() * grid), grid)
    within = Interval.symmetric(limit + Fraction(2, grid))
    value = angle
    cases: list[tuple[Operand, Operand, Operand]] = []
    for beyond, left, right, sign in (
        (inside.highest > limit, angle, limit, -1),
        (inside.lowest < -limit, -limit, angle, 1),
    ):
        if beyond:
            other = chain.sum("turned", ((angle,), _ONE), ((), sign * 2 * pi()), inexact=2 * PI_ERROR)
            cases.append((left, right, other))
    if cases:
        value = chain.add("principal", Selection(tuple(cases), angle), within)
    _finish(chain, value, (argument, _ONE))


def _slopes(
    chain: _Chain, ordinate: str, abscissa: str, known: Fraction, turns: bool
) -> list[tuple[str, Fraction | None]]:
    """Return how fast the angle can change: by the inverse distance from the origin, and by a turn at the cut."""
    above, beside = chain.range(ordinate), chain.range(abscissa)
    distances = [max(Fraction(0), inside.lowest, -inside.highest) for inside in (above, beside)]
    distance = max(known, Interval.of(sum((d * d for d in distances), Fraction(0))).sqrt().lowest)
    slope = 1 / distance if distance else None
    is_cut = turns and above.low < 0 and beside.low < 0
    return [(ordinate, None if is_cut else slope), (abscissa, slope)]
