"""Series, intervals and the links of functions: values lie within the bounds, and errors come near them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction

import mpmath
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from small_integers import quantity

from strapgen.fixedpoint import functions
from strapgen.fixedpoint.functions import Chain
from strapgen.fixedpoint.intervals import Interval, maximum
from strapgen.fixedpoint.quantities import ExactOperation, InputElement, Sum
from strapgen.fixedpoint.series import PI_ERROR, Series, Truncated, arctangent_series, pi
from strapgen.ir.integer_program import cases_of

SIZES = [Fraction(1, 3), Fraction(3, 2), Fraction(1, 50)]
COEFFICIENTS = st.fractions(min_value=-3, max_value=3, max_denominator=60)


def at(series: Series, values: list[Fraction]) -> Fraction:
    """Return the polynomial of a series without its rest."""
    total = Fraction(0)
    for part in series.terms.values():
        for places, coefficient in part.items():
            product = Fraction(coefficient, 1 << 192)
            for place in places:
                product *= values[place]
            total += product
    return total


@settings(derandomize=True, database=None, deadline=None, max_examples=25)
@given(
    data=st.lists(
        st.tuples(st.integers(0, 3), st.integers(0, 3), st.integers(0, 3)), min_size=1, max_size=12
    ),
    constants=st.lists(COEFFICIENTS, min_size=4, max_size=4),
    parts=st.lists(st.fractions(min_value=-1, max_value=1, max_denominator=9), min_size=3, max_size=3),
    most=st.sampled_from([4, 10, 20, 84]),
)
def test_any_chain_of_operations_is_enclosed(data, constants, parts, most):
    """Each operation takes two of the last values, on the series and on exact numbers."""
    arithmetic = Truncated(SIZES, most)
    values = [part * size for part, size in zip(parts, SIZES, strict=True)]
    series = [arithmetic.variable(k) for k in range(3)] + [arithmetic.constant(constants[0])]
    exact = [*values, constants[0]]
    for kind, first, second in data:
        a, b = series[-1 - first], series[-1 - second]
        x, y = exact[-1 - first], exact[-1 - second]
        made, wanted = {
            0: (arithmetic.sum(a, b), x + y),
            1: (arithmetic.less(a, b), x - y),
            2: (arithmetic.product(a, b), x * y),
            3: (arithmetic.dot([a, b], [b, a]), 2 * x * y),
        }[kind]
        series.append(made)
        exact.append(wanted)
        assert abs(at(made, values) - wanted) <= made.rest
        assert abs(wanted) <= arithmetic.size(made)
        assert all(degree <= arithmetic.degree for degree in made.terms)


def test_terms_in_range_are_exact_and_cancel():
    arithmetic = Truncated([Fraction(1, 10)] * 2, 15)
    x, y = arithmetic.variable(0), arithmetic.variable(1)
    one = arithmetic.sum(arithmetic.product(x, x), arithmetic.product(x, y))
    other = arithmetic.product(x, arithmetic.sum(x, y))
    assert arithmetic.less(one, other).terms == {}
    assert arithmetic.size(arithmetic.less(one, other)) < Fraction(1, 10**50)  # the rounding of coefficients


@pytest.mark.parametrize(
    ("count", "most", "degree"), [(3, 1000, 16), (6, 1000, 6), (9, 1000, 4), (24, 1000, 2)]
)
def test_the_degree_is_the_largest_whose_terms_are_few(count, most, degree):
    assert Truncated([Fraction(1)] * count, most).degree == degree


def test_truncated_terms_are_in_the_remainder():
    arithmetic = Truncated([Fraction(1, 2)], 3)  # to the second power
    x = arithmetic.variable(0)
    square = arithmetic.product(x, x)
    cube = arithmetic.product(square, x)
    assert cube.terms == {}
    assert 0 <= cube.rest - Fraction(1, 8) < Fraction(1, 10**50)


PRECISE = mpmath.mp.clone()
PRECISE.prec = 400


def fraction(value) -> Fraction:
    """Return a number of 400 binary places as a fraction."""
    return Fraction(int(PRECISE.floor(value * PRECISE.mpf(2) ** 390)), 1 << 390)


def real(value: Fraction):
    return PRECISE.mpf(value.numerator) / value.denominator


PI = fraction(PRECISE.pi)


def chain(
    kind: str, *ranges: tuple, word: int = 16, definitions: Mapping[int, object] = {}, **options
) -> Chain:
    """Return the links of a function of arguments in these ranges; of inputs, unless another definition is told."""
    known = {
        f"x{k}": quantity(f"x{k}", definitions.get(k, InputElement("x")), *ends)
        for k, ends in enumerate(ranges)
    }
    known |= {"q": quantity("q", InputElement("x"), 0, Fraction(ranges[0][1]) ** 2)}
    links = Chain("f", known, {}, lambda name: name, word)
    arguments = [name for name in known if name != "q"]
    functions.derive_function(kind, links, arguments, **options)
    return links


def values(links: Chain, *arguments: Fraction) -> dict[str, Fraction]:
    """Return the value of every link as it is defined."""
    known = {f"x{k}": value for k, value in enumerate(arguments)}

    def of(operand):
        return operand if isinstance(operand, Fraction) else known[operand]

    for link in links.links:
        match link.definition:
            case Sum(terms):
                known[link.name] = sum(
                    (c * math.prod((known[n] for n in names), start=Fraction(1)) for names, c in terms),
                    Fraction(0),
                )
            case ExactOperation("divide", (numerator, denominator)):
                known[link.name] = of(numerator) / of(denominator)
            case ExactOperation("sqrt", (argument,)):
                known[link.name] = fraction(PRECISE.sqrt(real(known[argument])))
            case ExactOperation("maximum", several):
                known[link.name] = max(map(of, several))
            case ExactOperation("select", (*_, otherwise) as operands):
                chosen = (value for left, right, value in cases_of(operands) if of(left) >= of(right))
                known[link.name] = of(next(chosen, otherwise))
            case ExactOperation("computed", (argument,)):
                known[link.name] = known[argument]
            case ExactOperation("nearest", (argument, factor)):
                known[link.name] = Fraction(math.floor(known[argument] * factor + Fraction(1, 2)))
    return known


def link(links: Chain, label: str):
    (one,) = (item for item in links.links if item.name == f"f_{label}" or (not label and item.name == "f"))
    return one


EIGHTH = Fraction(1, 8)


@pytest.mark.parametrize(
    ("kind", "label", "most", "function"),
    [
        ("sin", "", Fraction(5, 4), PRECISE.sin),
        ("cos", "", Fraction(5, 4), PRECISE.cos),
        ("sinc", "", Fraction(2), PRECISE.sinc),
        ("sin", "sine", Fraction(3), None),
        ("cos", "cosine", Fraction(3), None),
        ("sinc", "series", Fraction(4), None),
    ],
)
@pytest.mark.parametrize("word", [8, 16, 32])
def test_a_series_leaves_out_as_much_as_it_says_at_the_end_of_its_range(kind, label, most, function, word):
    links = chain(kind, (-most, most), word=word)
    assert links.tolerance == Fraction(1, 8) / (1 << (word - 2))  # of the last place of a word that holds 1
    (one,) = (
        o
        for o in links.links
        if o.name.startswith(f"f_{label}".rstrip("_")) and o.approximation_error and "rest" not in o.name
    )
    assert 0 < one.approximation_error <= links.tolerance
    if function is None:
        return
    ends = [most * k / 8 for k in range(-8, 9)]
    missing = [abs(values(links, x)["f"] - fraction(function(real(x)))) for x in ends]
    # The next term is smaller by the square of the end over a product of two numbers above 5.
    assert max(missing) <= one.approximation_error <= max(missing) * Fraction(7, 6)


@pytest.mark.parametrize("word", [8, 16, 32])
def test_the_arctangent_leaves_out_as_much_as_it_says(word):
    links = chain("direction", (Fraction(1, 100), 1), (1, 1), word=word)
    one = link(links, "arctangent")
    tangents = [Fraction(k, 100) for k in range(1, 43)]
    missing = [
        abs(values(links, x, Fraction(1))["f_arctangent"] - fraction(PRECISE.atan(real(x)))) for x in tangents
    ]
    # The bound is the sum of all terms that are left out; at the end of the range they nearly add up.
    assert max(missing) <= one.approximation_error <= 2 * max(missing)
    assert one.approximation_error <= links.tolerance


def test_quarter_turns_are_taken_off_with_the_error_of_pi_for_each():
    links = chain("sin", (-60, 60), word=32)
    rest, count = link(links, "rest"), link(links, "quarters")
    most = count.range.magnitude
    assert most == 38
    short = PI - pi()
    assert 0 < short <= PI_ERROR
    assert most * PI_ERROR / 2 <= rest.approximation_error <= most * PI_ERROR
    for angle in (Fraction(60), Fraction(-60), Fraction(177, 10), Fraction(3)):
        known = values(links, angle)
        exact = angle - known[count.name] * PI / 2
        off = abs(known[rest.name] - exact)
        assert 0 < off <= rest.approximation_error
        # The nearest number of quarter turns leaves at most an eighth of a turn, and what the factor is off by.
        assert abs(exact) <= rest.range.highest < Fraction(79, 100)


def test_the_rest_of_a_turn_reaches_the_end_of_its_range():
    """Where the number of quarter turns changes, an eighth of a turn is left, and a share of the angle beside it.

    In words of 8 bits 2/pi is 81/128, so that the seventh quarter turn begins at 13/2 128/81.
    """
    last = Fraction(13, 2) * Fraction(128, 81)
    links = chain("cos", (-last, last), word=8)
    assert link(links, "quarters").definition.arguments[1] == Fraction(81, 128)
    just_below = last - Fraction(1, 1 << 60)
    largest = max(abs(values(links, angle)["f_rest"]) for angle in (just_below, -last))
    assert largest <= link(links, "rest").range.highest <= largest + Fraction(1, 1 << 50)


@pytest.mark.parametrize(
    ("ranges", "count"), [([(-1, 1), (-1, 1)], 4), ([(0, 1), (0, 1)], 2), ([(0, Fraction(1, 3)), (1, 2)], 1)]
)
def test_parts_of_half_a_turn_have_the_error_of_pi(ranges, count):
    links = chain("direction", *ranges)
    parts = [
        (one, dict(one.definition.terms)[()])
        for one in links.links
        if isinstance(one.definition, Sum) and one.approximation_error and () in dict(one.definition.terms)
        if one.name.startswith("f_angle") or one.name == "f"
    ]
    assert len(parts) >= count - 1
    for one, constant in parts:
        share = round(constant / pi() * 4)
        assert 0 < abs(Fraction(share, 4) * PI - constant) <= one.approximation_error <= PI_ERROR


def test_a_whole_turn_has_twice_the_error_of_pi():
    links = chain("wrap", (-8, 8))
    turned = [one for one in links.links if one.approximation_error]
    assert len(turned) == 2
    for one in turned:
        constant = dict(one.definition.terms)[()]
        assert 0 < abs(abs(constant) - 2 * PI) <= one.approximation_error <= 2 * PI_ERROR


def slopes(links: Chain) -> dict[str, Fraction | None]:
    return dict(links.links[-1].inherited_error.slopes)


ROOT = {0: ExactOperation("sqrt", ("q",))}


@pytest.mark.parametrize(
    ("kind", "ranges", "options", "expected"),
    [
        # The largest derivatives: of sine and cosine 1, of sin(x)/x 0.43618 at 2.0816, by its square -1/6 at 0, and of
        # cos(root) by what is under the root -1/2 at 0.
        ("sin", [(-3, 3)], {}, {"x0": 1}),
        ("cos", [(-3, 3)], {}, {"x0": 1}),
        ("cos", [(0, 1)], {"definitions": ROOT}, {"q": 1 / 2}),
        ("cos", [(0, 9)], {"definitions": ROOT}, {"x0": 1}),
        ("sinc", [(-5, 5)], {}, {"x0": 0.43618}),
        ("sinc", [(0, 1)], {"definitions": ROOT}, {"q": 1 / 6}),
        ("sinc", [(0, 9)], {"definitions": ROOT}, {"q": 1 / 6, "f_root": 0.43618}),
        ("wrap", [(-8, 8)], {}, {"x0": 1}),
        # An angle changes by the inverse distance from the origin; at the cut it jumps.
        ("direction", [(3, 5), (4, 5)], {}, {"x0": 1 / 5, "x1": 1 / 5}),
        ("direction", [(-5, -3), (-6, -4)], {}, {"x0": 1 / 5, "x1": 1 / 5}),
        ("direction", [(-1, 1), (4, 5)], {}, {"x0": 1 / 4, "x1": 1 / 4}),
        ("direction", [(-1, 1), (-1, 1)], {"distance": EIGHTH}, {"x0": 8, "x1": 8}),
        ("direction", [(-1, 1), (-1, 1)], {}, {"x0": None, "x1": None}),
        ("atan2", [(-1, 1), (-5, -4)], {}, {"x0": None, "x1": 1 / 4}),
        ("atan2", [(0, 1), (-5, -4)], {}, {"x0": 1 / 4, "x1": 1 / 4}),
        ("atan2", [(-1, 1), (4, 5)], {}, {"x0": 1 / 4, "x1": 1 / 4}),
    ],
)
def test_an_error_of_the_argument_goes_on_by_the_largest_slope(kind, ranges, options, expected):
    links = chain(kind, *ranges, **options)
    told = slopes(links)
    assert told.keys() == expected.keys()
    for name, slope in expected.items():
        if slope is None:
            assert told[name] is None
        else:
            assert slope * (1 - 1e-12) <= float(told[name]) <= slope * 1.004
    inside = links.links[-1].range
    assert links.links[-1].inherited_error.most >= inside.highest - inside.lowest


@pytest.mark.parametrize(
    ("kind", "ranges", "ends"),
    [
        ("sin", [(-1, 1)], (-1, 1)),
        ("sin", [(0, Fraction(1, 2))], (0, Fraction(1, 2))),
        ("cos", [(-1, 1)], (Fraction(1, 2), 1)),
        ("sinc", [(-1, 1)], (Fraction(5, 6), 1)),
        ("wrap", [(-8, 8)], (-PI, PI)),
        ("atan2", [(-1, 1), (-1, 1)], (-PI, PI)),
        ("atan2", [(0, 1), (0, 1)], (0, PI / 2)),
        ("direction", [(Fraction(-1, 3), Fraction(1, 3)), (1, 2)], (-PI / 4, PI / 4)),
    ],
)
def test_functions_have_their_ranges(kind, ranges, ends):
    links = chain(kind, *ranges)
    inside = links.links[-1].range
    low, high = inside.lowest, inside.highest
    slack = Fraction(
        2, 1 << 12
    )  # two units of the grid on which a turn is taken off, that of words of 12 bits
    assert ends[0] - slack <= low <= ends[0] + Fraction(1, 1 << 100)
    assert ends[1] - Fraction(1, 1 << 100) <= high <= ends[1] + slack


def test_the_smaller_and_the_larger_argument_have_their_ranges():
    links = chain("direction", (Fraction(-1, 3), Fraction(1, 4)), (1, 2), word=16)
    smaller, larger = (link(links, label) for label in ("smaller", "larger"))
    assert (smaller.range.lowest, smaller.range.magnitude) == (
        0,
        max(smaller.range.lowest, smaller.range.highest),
    )
    assert smaller.range.highest - Fraction(1, 3) < Fraction(1, 1 << 100)
    assert larger.range.highest == 2
    # The stand-in for the larger one at the origin is the last place of the finer of both: a third has 16 places.
    assert [one for one in larger.definition.arguments if isinstance(one, Fraction)] == [Fraction(1, 1 << 16)]


@pytest.mark.parametrize(
    ("kind", "ranges"),
    [
        ("sin", [(-60, 60)]),
        ("cos", [(-60, 60)]),
        ("sin", [(-2, 3)]),
        ("sinc", [(-12, 12)]),
        ("wrap", [(-9, 9)]),
        ("atan2", [(-2, 2), (-2, 2)]),
        ("atan2", [(0, 2), (-1, 2)]),
    ],
)
def test_links_stay_in_their_ranges_and_lead_to_the_function(kind, ranges):
    function = {"atan2": PRECISE.atan2, "wrap": None}.get(kind, getattr(PRECISE, kind, None))
    links = chain(kind, *ranges, word=24)
    approximation_error = sum((one.approximation_error for one in links.links), Fraction(0))
    grids = [
        [low + (high - low) * Fraction(k, 23) for k in range(24)]
        for low, high in ((Fraction(a), Fraction(b)) for a, b in ranges)
    ]
    rows = (
        [(x,) for x in grids[0]]
        if len(grids) == 1
        else [(x, y) for x in grids[0][::3] for y in grids[1][::2]]
    )
    for row in rows:
        known = values(links, *row)
        for one in links.links:
            value = known[one.name]
            assert (
                one.range.lowest - one.approximation_error
                <= value
                <= one.range.highest + one.approximation_error
            ), one.name
        wrapped = row[0] - 2 * PI * round(row[0] / (2 * PI))
        exact = wrapped if function is None else fraction(function(*map(real, row)))
        assert abs(known[links.links[-1].name] - exact) <= approximation_error


@pytest.mark.parametrize(("digits", "terms"), [(1, 3), (5, 3), (6, 4), (12, 8)])
def test_an_arctangent_has_as_many_terms_as_its_tolerance_needs(digits, terms):
    coefficients, left_out = arctangent_series(Fraction(1, 10**digits))
    assert len(coefficients) == terms
    assert left_out <= Fraction(1, 10**digits)
    # With p = 21/100, one term less would leave out more than 1/p^2 times as much, which is above the tolerance.
    assert terms == 3 or left_out > Fraction(1, 10**digits) * Fraction(21, 100) ** 2 / 2
    # That is nearly attained where the argument is largest.
    largest = 0.42 / (1 - 0.21**2)
    errors = [
        abs(math.atan(u) - u * sum(float(c) * u ** (2 * k) for k, c in enumerate(coefficients)))
        for u in (largest * n / 50 for n in range(51))
    ]
    assert left_out / 2 < max(errors) <= left_out + 1e-15


numbers = st.fractions(min_value=-100, max_value=100, max_denominator=10**6)


@st.composite
def intervals_with_members(draw):
    low, high = sorted((draw(numbers), draw(numbers)))
    part = draw(st.fractions(min_value=0, max_value=1, max_denominator=1000))
    return Interval.of(low, high), low + part * (high - low)


@given(intervals_with_members(), intervals_with_members(), numbers)
def test_sums_products_and_multiples(one, other, factor):
    (a, x), (b, y) = one, other
    assert x in a and y in b
    assert x + y in a + b
    assert x - y in a - b
    assert x * y in a * b
    assert -x in -a
    assert factor * x in a.scale(factor)
    assert x * x in a.square()
    assert a.square().low >= 0
    assert max(x, y) in maximum([a, b])
    assert x in a.join(b) and y in a.join(b)
    assert abs(x) <= a.magnitude
    assert x + abs(factor) in a.widened(abs(factor))
    lower, upper = a.halves()
    assert x in lower or x in upper


@given(intervals_with_members())
def test_roots_and_reciprocals(one):
    a, x = one
    if a.low >= 0:
        root = a.sqrt()
        assert root.lowest**2 <= x <= root.highest**2
        # Tight to the grid: neither end is off by more than a unit of it.
        assert Fraction(root.low + 1, 1) ** 2 > Fraction(a.low) * 2**160 or root.low == 0
    else:
        with pytest.raises(ValueError, match="square root"):
            a.sqrt()
    if a.low > 0 or a.high < 0:
        assert 1 / x in a.reciprocal()
    else:
        with pytest.raises(ValueError, match="division"):
            a.reciprocal()


def test_ends_are_rounded_outward():
    third = Interval.of(Fraction(1, 3))
    assert third.lowest < Fraction(1, 3) < third.highest
    assert third.high - third.low == 1
    assert math.isclose(float(third.lowest), 1 / 3)
    root = Interval.of(2).sqrt()
    assert root.lowest**2 < 2 < root.highest**2
    assert root.high - root.low == 1
