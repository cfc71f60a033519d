"""The rounding of single operations: bounds that are nearly attained, so that none may be left out, and exact ones."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest
from derived import programs
from hypothesis import given, settings
from hypothesis import strategies as st
from small_programs import EXACT, TYPES, computed, exactly, node, program

from strapgen.fixedpoint.floating import bounds, rounding_bounds
from strapgen.fixedpoint.floating.errors import NUMBERS, Expressions, NumberFormat, _ComputedNumbers
from strapgen.fixedpoint.floating.exact_ranges import ExactRanges
from strapgen.fixedpoint.intervals import Interval
from strapgen.ir.program import DOUBLE_RESOLUTION, RESOLUTION, Program
from strapgen.targets.c import DOUBLE, FLOAT, CPrinter

THIRD = Fraction(1, 3)
ABOVE_ONE = node("add", node("multiply", "a", "a"), 1)

#: For every rounding a program of which it is the largest, with the share of the bound that inputs reach.
LARGEST = {
    "add": (program({"y": node("add", "a", "b")}, {"a": 1, "b": 1}), 0.9),
    "subtract": (program({"y": node("subtract", "a", "b")}, {"a": 1, "b": 1}), 0.9),
    "multiply": (program({"y": node("multiply", "a", "b")}, {"a": 1, "b": 2}), 0.9),
    "divide": (program({"d": node("add", "a", 3), "y": node("divide", "b", "d")}, {"a": 1, "b": 4}), 0.4),
    "sqrt": (program({"r": ABOVE_ONE, "y": node("sqrt", "r")}, {"a": 1}), 0.7),
    "sin": (program({"y": node("sin", "a")}, {"a": 1}), 0.2),
    "cos": (program({"y": node("cos", "a")}, {"a": 1}), 0.2),
    "sinc": (program({"y": node("sinc", "a")}, {"a": 1}), 0.2),
}


def inputs(code: Program, count: int, number: str = "float") -> dict[str, np.ndarray]:
    rng = np.random.default_rng(5)
    sizes = {signal.name: float(signal.bound) for signal in code.inputs}
    return {name: rng.uniform(-size, size, count).astype(TYPES[number]) for name, size in sizes.items()}


def measured(code: Program, values: dict[str, np.ndarray], number: str = "float") -> Fraction:
    """Return the largest error of a program on arrays of inputs."""
    got = np.broadcast_to(computed(code, values, number)["out"][0], len(values["a"]))
    rows = [{name: column[k] for name, column in values.items()} for k in range(len(got))]
    pairs = zip(got, rows, strict=True)
    return max(abs(Fraction(float(value)) - exactly(code, row)["out"][0]) for value, row in pairs)


def bound(code: Program, number: str = "float") -> Fraction:
    """Return the bound as the code has it at this moment, which may have a fault."""
    try:
        bounds._bounds.cache_clear()
        (error,) = rounding_bounds(code, number).errors["out"]
    finally:
        bounds._bounds.cache_clear()
    return error


@pytest.mark.parametrize("kind", LARGEST)
def test_without_the_rounding_of_one_operation_the_bound_would_be_exceeded(kind, monkeypatch):
    code, share = LARGEST[kind]
    error = measured(code, inputs(code, 1000))
    assert share * bound(code) < error <= bound(code)
    rounding = _ComputedNumbers._rounding

    def without(self, expression, before):
        return Fraction(0) if expression.kind == kind else rounding(self, expression, before)

    monkeypatch.setattr(_ComputedNumbers, "_rounding", without)
    assert bound(code) < error


def test_without_the_error_of_a_literal_the_bound_would_be_exceeded(monkeypatch):
    code = program({"y": node("subtract", node("multiply", "a", Fraction(1, 2)), THIRD)}, {"a": 1})
    # Half of a is exact, and so is the difference: what is left is the literal.
    values = {"a": np.array([2 / 3, 0.75, 0.625], np.float32)}
    error = measured(code, values)
    assert error == abs(NUMBERS["float"].rounded(THIRD) - THIRD) <= bound(code)
    monkeypatch.setattr(NUMBERS["float"].__class__, "rounded", lambda self, value: value)
    product = program({"y": node("multiply", "a", 8)}, {"a": 1})
    assert bound(product) == 0 < error
    assert bound(code) < error + NUMBERS["float"].half_ulp(Fraction(5, 6))


@pytest.mark.parametrize(
    "code",
    [
        program({"y": node("multiply", "a", 8)}, {"a": 1}),
        program({"y": node("divide", "a", Fraction(1, 4))}, {"a": 1}),
        program({"y": node("add", "a", "a")}, {"a": 1}),
        program({"y": node("negate", "a")}, {"a": 1}),
        program({"y": node("maximum", "a", node("negate", "a"))}, {"a": 1}),
        program({"y": node("select", node("at_least", "a", "b"), "b", "a")}, {"a": 1, "b": 1}),
        program({"y": node("add", Fraction(3, 4), Fraction(1, 8))}, {"a": 1}),
    ],
)
def test_exact_operations_have_the_bound_zero(code):
    assert bound(code) == 0 == measured(code, inputs(code, 50))


def test_a_difference_of_near_numbers_is_exact():
    """3 + a and 3 + b are multiples of 2^-22 in float, and so is their difference, which is small."""
    body = {"c": node("add", "a", 3), "d": node("add", "b", 3), "y": node("subtract", "c", "d")}
    code = program(body, {"a": 1, "b": 1})
    assert bound(code) == 2 * NUMBERS["float"].half_ulp(Fraction(4))
    assert measured(code, inputs(code, 300)) <= bound(code)


def test_possible_overflow_has_no_bound():
    code = program({"y": node("multiply", "a", "a")}, {"a": Fraction(2) ** 64})
    assert rounding_bounds(code, "float").reason == "y may overflow"
    assert rounding_bounds(code, "double").errors
    code = program({"y": node("multiply", "a", "a")}, {"a": Fraction(2) ** 1000})
    assert "overflow" in rounding_bounds(code, "double").reason


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        ({"y": node("divide", "a", "b")}, "the divisor in y may be zero"),
        ({"y": node("sqrt", "a")}, "the radicand in y may be below zero"),
        ({"y": node("atan2", "a", "b")}, "atan2 jumps by a turn"),
        (
            {"s": node("add", "a", "b"), "y": node("select", node("at_least", "s", 0), 1, -1)},
            "rounding may turn a comparison in y",
        ),
    ],
)
def test_missing_proof_has_its_reason(body, reason):
    told = rounding_bounds(program(body, {"a": 1, "b": 1}))
    assert (told.reason, dict(told.errors)) == (reason, {})


def test_a_root_that_may_be_zero_has_a_bound_by_its_relative_error():
    radicand = node("add", node("multiply", "a", "a"), node("multiply", "b", "b"))
    code = program({"y": node("sqrt", radicand)}, {"a": 1, "b": 1})
    error = measured(code, inputs(code, 1000))
    assert error <= bound(code) < 4 * error
    tiny = {name: values * np.float32(2**-30) for name, values in inputs(code, 50).items()}
    assert measured(code, tiny) <= bound(code)


def test_without_the_terms_of_second_order_the_bound_would_be_exceeded(monkeypatch):
    """Of a third of a, three times, less a, nothing is left but rounding, and of its square that of second order."""
    rounding = node("subtract", node("multiply", node("multiply", "a", THIRD), 3), "a")
    code = program({"x": rounding, "y": node("multiply", "x", "x")}, {"a": 1})
    error = measured(code, inputs(code, 1000))
    assert bound(code) / 10 < error <= bound(code)
    propagated = _ComputedNumbers._propagate
    monkeypatch.setattr(_ComputedNumbers, "_propagate", lambda *a: (propagated(*a)[0], Fraction(0)))
    assert bound(code) < error / 1000


FOUR_BITS = NumberFormat(4, -6, 10)
#: Operations that round to four bits, those of the C library too.
COARSELY = EXACT | {
    kind: lambda *a, exact=EXACT[kind]: FOUR_BITS.rounded(exact(*a))
    for kind in ("add", "subtract", "multiply", "divide", "sqrt", "sin", "cos")
}


def measured_coarsely(code: Program, values: dict[str, Fraction]) -> Fraction:
    """Return the error of a program in numbers of four bits."""
    got = code.run(values, FOUR_BITS.rounded, COARSELY)["out"][0]
    return abs(got - code.run(values, operations=EXACT)["out"][0])


#: Programs for numbers of four bits, whose errors of second order are no longer small.
COARSE = {
    "product": {"p": node("multiply", "a", "b"), "y": node("multiply", node("add", "p", THIRD), "p")},
    "quotient": {
        "d": node("add", node("multiply", "a", "a"), Fraction(4, 5)),
        "y": node("divide", node("multiply", "b", THIRD), "d"),
    },
    "root": {"d": node("add", node("multiply", "a", "b"), Fraction(9, 5)), "y": node("sqrt", "d")},
    "root at zero": {
        "d": node("add", node("multiply", "a", "a"), node("multiply", "b", "b")),
        "y": node("multiply", node("sqrt", "d"), THIRD),
    },
    "maximum": {"p": node("multiply", "a", "b"), "y": node("maximum", "p", node("multiply", "a", THIRD))},
    "chosen": {
        "p": node("multiply", "a", "b"),
        "y": node("select", node("at_least", "a", "b"), "p", node("add", "p", "a")),
    },
    "cancelled": {
        "d": node("subtract", node("add", "a", 3), node("add", "b", 3)),
        "y": node("add", "d", "a"),
    },
}


@pytest.mark.long
@pytest.mark.parametrize("body", COARSE.values(), ids=COARSE)
def test_no_input_at_all_of_four_bits_is_rounded_by_more_than_the_bound(body, monkeypatch):
    monkeypatch.setitem(NUMBERS, "coarse", FOUR_BITS)
    code = program(body, {"a": 1, "b": 1})
    numbers = sorted({FOUR_BITS.rounded(Fraction(k, 64)) for k in range(-64, 65)})
    worst = max(measured_coarsely(code, {"a": a, "b": b}) for a in numbers for b in numbers)
    error = bound(code, "coarse")
    assert error / 4 < worst <= error


NUMBER = st.sampled_from([*(Fraction(k, 8) for k in range(-12, 13)), THIRD, Fraction(-5, 7), Fraction(1, 48)])


@st.composite
def bodies(draw):
    """Return the body of a program of up to eight operations on two inputs."""
    names, body = ["a", "b"], {}
    for place in range(draw(st.integers(1, 8))):
        name = "y" if place == 0 else f"y{place}"
        kind = draw(
            st.sampled_from(
                ["add", "subtract", "multiply", "multiply", "root", "quotient", "waves", "maximum"]
            )
        )
        operand = st.one_of(*2 * [st.sampled_from([*names])], NUMBER)
        left, right = draw(operand), draw(operand)
        square = node("add", node("multiply", right, right), THIRD)
        if kind == "root":
            body[name] = node("multiply", left, node("sqrt", square))
        elif kind == "quotient":
            body[name] = node("divide", left, square)
        elif kind == "waves":
            body[name] = node("add", node("sin", left), node("cos", right))
        else:
            body[name] = node(kind, left, right)
        names.append(name)
    return body, names[-1]


@pytest.mark.long
@settings(max_examples=60)
@given(made=bodies(), number=st.sampled_from(["double", "float"]), scale=st.integers(-6, 2))
def test_no_program_rounds_by_more_than_its_bound(made, number, scale):
    body, last = made
    code = program(body, {"a": Fraction(2) ** scale, "b": 1}, last)
    values = inputs(code, 20, number)
    for column in values.values():
        column[:4] = [column.max(), column.min(), 0, np.nextafter(column[0], column.dtype.type(0))]
    assert measured(code, values, number) <= bound(code, number)


@pytest.mark.long
@settings(max_examples=60)
@given(made=bodies(), parts=st.lists(st.tuples(*2 * [st.integers(-64, 64)]), min_size=10, max_size=10))
def test_no_program_rounds_by_more_than_its_bound_in_four_bits(made, parts):
    body, last = made
    code = program(body, {"a": 1, "b": 1}, last)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(NUMBERS, "coarse", FOUR_BITS)
        told = rounding_bounds(code, "coarse")
    for a, b in parts:
        values = {"a": FOUR_BITS.rounded(Fraction(a, 64)), "b": FOUR_BITS.rounded(Fraction(b, 64))}
        if not told.reason:
            assert measured_coarsely(code, values) <= told.errors["out"][0]


REALS = {"double": (np.float64, DOUBLE), "float": (np.float32, FLOAT)}
RATIONALS = st.fractions(min_value=-8, max_value=8, max_denominator=10**9)


@pytest.mark.parametrize("number", NUMBERS)
@given(value=RATIONALS)
def test_a_literal_is_rounded_as_it_is_printed(number, value):
    type_, real = REALS[number]
    text = CPrinter(real).constant(value).removesuffix("f")
    assert NUMBERS[number].rounded(value) == Fraction(float(type_(text)))


@pytest.mark.parametrize("number", NUMBERS)
def test_the_smallest_numbers_are_those_of_the_type(number):
    type_, _ = REALS[number]
    format_, information = NUMBERS[number], np.finfo(type_)
    assert Fraction(float(information.smallest_subnormal)) == Fraction(2) ** format_.smallest
    assert Fraction(float(information.eps)) == 2 * format_.unit
    assert format_.rounded(format_.underflow) == 0 != format_.rounded(3 * format_.underflow)


@pytest.mark.parametrize("number", NUMBERS)
@given(largest=RATIONALS.map(abs), part=st.fractions(min_value=0, max_value=1, max_denominator=10**6))
def test_no_number_up_to_the_largest_is_rounded_by_more_than_half_an_ulp(number, largest, part):
    format_ = NUMBERS[number]
    value = largest * part
    for near in (value, value + format_.unit * value / 2, largest):
        if near <= largest:
            assert abs(format_.rounded(near) - near) <= format_.half_ulp(largest)


def test_half_an_ulp_is_attained_below_above_and_just_above_a_power_of_two():
    format_ = NUMBERS["float"]
    unit = format_.unit
    for largest, worst in [
        (Fraction(1), 1 - unit / 2),
        (Fraction(3, 2), 1 + unit),
        (1 + unit * 3 / 4, 1 + unit * 3 / 4),
    ]:
        assert worst <= largest
        assert abs(format_.rounded(worst) - worst) == format_.half_ulp(largest)


def ranges(code: Program) -> ExactRanges:
    box = {s.name: Interval.symmetric(s.bound) for s in code.inputs if s.bound is not None}
    return ExactRanges(code, Expressions.of(code), box)


@pytest.mark.parametrize(
    ("value", "limits", "spare"),
    [
        # The range of cosine is that of its first two terms.
        (node("cos", "a"), {"a": Fraction(1)}, Fraction(1, 24)),
        (node("sinc", "a"), {"a": Fraction(1)}, Fraction(1, 120)),
        (node("cos", "a"), {"a": Fraction(4)}, Fraction(1, 1000)),
        (node("sinc", "a"), {"a": Fraction(5)}, Fraction(4, 5)),
        (node("sin", "a"), {"a": Fraction(1, 8)}, Fraction(1, 3000)),
        (node("select", node("at_least", "a", 0), "a", "b"), {"a": 1, "b": 2}, Fraction(0)),
        (node("select", node("at_least", "a", 0), "b", "a"), {"a": 1, "b": 2}, Fraction(0)),
        (node("maximum", "a", node("maximum", "b", -2)), {"a": 1, "b": 3}, Fraction(0)),
    ],
)
def test_a_range_holds_all_values_and_its_ends_are_near_some(value, limits, spare):
    code = program({"y": value}, limits)
    known = ranges(code).ranges[-1]
    grid = [[Fraction(k, 16) * limit for k in range(-16, 17)] for limit in limits.values()]
    values = [
        code.run(dict(zip(limits, point, strict=True)), operations=EXACT)["out"][0]
        for point in itertools.product(*grid)
    ]
    # 1/100: the grid does not meet the turning points of the functions.
    assert known.lowest <= min(values) <= known.lowest + spare + Fraction(1, 100)
    assert known.highest - Fraction(1, 100) - spare <= max(values) <= known.highest


def test_the_resolution_is_that_of_either_type():
    code = program({"y": node("multiply", RESOLUTION, "a")}, {"a": 1})
    proofs = ranges(code)
    place = proofs.expressions.names[RESOLUTION]
    known = proofs.ranges[place]
    assert (known.lowest, known.highest) == (DOUBLE_RESOLUTION, Fraction(1, 1 << 23))


def test_squared_numbers_are_limited_by_the_root_of_the_limit():
    code = programs()["euler-normalize"]
    expressions = Expressions.of(code)
    (state,) = code.inputs
    proofs = ExactRanges(code, expressions, dict.fromkeys(state.elements, Interval.symmetric(Fraction(2))))
    (condition,) = proofs.conditions
    for name in state.elements:
        known = proofs.ranges[expressions.names[name]]
        assert 0 <= known.highest**2 - condition.high < Fraction(1, 1 << 150)
        assert 0 <= known.lowest**2 - condition.high < Fraction(1, 1 << 150)
