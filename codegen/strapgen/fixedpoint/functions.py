"""Derives sine, cosine, sin(x)/x and atan2 as sums of products, quotients and selections, with bounds of their errors.

Every function is derived from the computed value of its argument, taken as exact: then all comparisons are exact, the
argument is reduced by identities, and a polynomial is cut where a word cannot tell any more. The derivative alone tells
what becomes of the error of the argument.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

from strapgen.fixedpoint.intervals import Interval, maximum
from strapgen.fixedpoint.quantities import (
    Definition,
    ErrorPropagation,
    ExactOperation,
    InputElement,
    Monomial,
    Operand,
    Quantity,
    Sum,
)
from strapgen.fixedpoint.series import PI_ERROR, arctangent_series, pi, sine_series
from strapgen.ir.formats import finest

#: Arguments of sine and cosine up to here need no reduction.
_UNREDUCED = Fraction(5, 4)
#: Arguments of sin(x)/x up to here have a polynomial; above, sin(x) is divided by x.
_NEAR_ZERO = Fraction(2)
#: More than the largest slope of sin(x)/x, which is 0.43618.
_SINC_SLOPE = Fraction(7, 16)

_ONE = Fraction(1)


def derive_function(
    kind: str, chain: Chain, arguments: Sequence[str], distance: Fraction = Fraction(0)
) -> None:
    """Append to a chain the quantities from which a function is computed; the last is its value."""
    options = {"distance": distance, "turns": kind == "atan2"} if kind in ("atan2", "direction") else {}
    _FUNCTIONS[kind](chain, *arguments, **options)


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
    turns, rest = _reduce_angle(chain, angle)
    square = chain.square(rest)
    up, across = (_wave_series(chain, degree, rest, square) for degree in (1, 0))
    down, back = (chain.sum("opposite", ((value,), -_ONE)) for value in (up, across))
    # By quarter turns from -2 to 1.
    values = (down, back, up, across) if first else (back, up, across, down)
    cases = [(turns, Fraction(k - 2), values[k]) for k in (3, 2, 1)]
    return chain.selection("quarter", *cases, otherwise=values[0])


def _reduce_angle(chain: Chain, angle: str) -> tuple[str, str]:
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


#: Quotients below 1/2 - 1/16 have the polynomial of the arctangent; those above are measured from the diagonal.
_OCTANT = (Fraction(1, 2), Fraction(-1, 16))


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


@dataclass
class Chain:
    """The quantities of a function in order, each made from those before it."""

    name: str  # that of the function's value, which is the last link
    known: Mapping[str, Quantity]
    same: dict[Definition, str]  # links of all functions so far, by definition
    #: Returns its argument, or that with a number behind it, as a name that is free.
    free: Callable[[str], str]
    word: int  # bits
    links: list[Quantity] = field(default_factory=list)
    ranges: dict[str, Interval] = field(default_factory=dict)  # those of the links

    @property
    def tolerance(self) -> Fraction:
        """The largest truncation error of a series: an eighth of the last place of a word that holds 1."""
        return Fraction(1, 1 << (self.word + 1))

    def range(self, operand: Operand) -> Interval:
        """Return the proved range of a quantity or a constant."""
        if isinstance(operand, Fraction):
            return Interval.of(operand)
        return self.ranges[operand] if operand in self.ranges else self.known[operand].range

    def add(
        self,
        label: str,
        definition: Definition,
        enclosure: Interval,
        approximation_error: Fraction = Fraction(0),
        inherited_error: ErrorPropagation | None = None,
    ) -> str:
        """Make a quantity unless there is an equal one; without a label it is the function's value."""
        if label and definition in self.same:
            return self.same[definition]
        name = self.name
        if label:
            name = self.free(f"{self.name}_{label}")
            count = 2
            while name in self.ranges:
                name, count = self.free(f"{self.name}_{label}_{count}"), count + 1
            self.same[definition] = name
        self.links.append(
            Quantity(
                name,
                definition,
                Fraction(0),
                enclosure,
                approximation_error=approximation_error,
                inherited_error=inherited_error,
            )
        )
        self.ranges[name] = enclosure
        return name

    def sum(
        self,
        label: str,
        *terms: tuple[Monomial, Fraction],
        within: Interval | None = None,
        approximation_error: Fraction = Fraction(0),
        inherited_error: ErrorPropagation | None = None,
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
        enclosure = enclosure.widened(approximation_error)
        return self.add(
            label,
            Sum(tuple((m, c) for m, c in terms if c)),
            enclosure if within is None else enclosure.meet(within),
            approximation_error,
            inherited_error,
        )

    def selection(self, label: str, *cases: tuple[Operand, Operand, Operand], otherwise: Operand) -> str:
        """Make a selection by comparisons of exact quantities."""
        enclosure = self.range(otherwise)
        for _, _, value in cases:
            enclosure = enclosure.join(self.range(value))
        operands = [operand for case in cases for operand in case]
        return self.add(label, ExactOperation("select", (*operands, otherwise)), enclosure)

    def maximum(self, label: str, *arguments: Operand) -> str:
        """Make the largest of several quantities and constants."""
        return self.add(label, ExactOperation("maximum", arguments), maximum(map(self.range, arguments)))

    def computed(self, argument: str) -> str:
        """Return an argument as the code computes it, so that it has no error of its own."""
        if argument in self.known and isinstance(self.known[argument].definition, InputElement):
            return argument
        return self.add("taken", ExactOperation("computed", (argument,)), self.range(argument))

    def magnitude(self, label: str, argument: str) -> str:
        """Return the magnitude of a quantity."""
        inside = self.range(argument)
        if inside.low >= 0:
            return argument
        negative = self.sum("negative", ((argument,), -_ONE))
        enclosure = Interval(0, Interval.of(inside.magnitude).high)
        return self.add(label, ExactOperation("maximum", (argument, negative)), enclosure)

    def square(self, argument: str) -> str:
        """Return the square of a quantity."""
        return self.sum("square", ((argument, argument), _ONE))

    def polynomial(self, label: str, coefficients: Sequence[Fraction], variable: str) -> str:
        """Make a polynomial of two or more coefficients by Horner's scheme."""
        *others, last_but_one, last = coefficients
        total = self.sum(label, ((variable,), last), ((), last_but_one))
        for coefficient in reversed(others):
            total = self.sum(label, ((variable, total), _ONE), ((), coefficient))
        return total

    def finish(self, value: str, *slopes: tuple[str, Fraction | None]) -> None:
        """Make the last quantity the function's value; `slopes` bound its derivatives by quantities taken as exact."""
        inside = self.range(value)
        inherited_error = ErrorPropagation(slopes, inside.highest - inside.lowest)
        last = self.links[-1] if self.links else None
        if last is not None and last.name == value and isinstance(last.definition, Sum):
            del self.same[last.definition]
            self.links[-1] = replace(last, name=self.name, inherited_error=inherited_error)
        else:  # one that is rounded to a word where a word is needed
            self.sum("", ((value,), _ONE), inherited_error=inherited_error)


_FUNCTIONS: dict[str, Callable[..., None]] = {
    "sin": _sine,
    "cos": _cosine,
    "sinc": _sinc,
    "atan2": arctangent,
    "direction": arctangent,
    "wrap": wrap,
}
