"""Every pass by example: what it makes of a program, and what it leaves alone."""

import itertools
from dataclasses import replace
from fractions import Fraction

import pytest

from strapgen.ir.program import Assignment, Constant, Operation, Program, Reference
from strapgen.lowering.passes import (
    absorb_negations,
    drop_copies,
    fold_constants,
    horner_schemes,
    remove_unused,
    reuse_values,
    share_multiples,
    share_pairs,
)

#: Texts before and after a pass, as the fixture `parse` reads them.
REWRITTEN = {
    absorb_negations: [
        # A sum takes signs in,
        ("y = a + -b", "y = a - b"),
        ("y = -a + b", "y = b - a"),
        ("y = a - -b", "y = a + b"),
        ("y = -a - b", "y = -(a + b)"),
        ("y = -a - -b", "y = b - a"),
        ("y = -a + -b", "y = -(a + b)"),
        ("y = a + b * -c", "y = a - b * c"),
        ("y = a - -b * c / d", "y = a + b * c / d"),
        ("y = a + (-b - c)", "y = a - (b + c)"),
        # a difference turns round,
        ("y = -(-a)", "y = a"),
        ("y = -(a - b)", "y = b - a"),
        ("y = -(c * (a - b))", "y = c * (b - a)"),
        ("y = -((a - b) * c)", "y = (b - a) * c"),
        ("y = -a * (b - c)", "y = a * (c - b)"),
        ("y = -(3 - a)", "y = a - 3"),
        # and a constant takes the sign that no sum takes.
        ("y = -(3 * a)", "y = -3 * a"),
        ("y = -(3 * a + 2 * b)", "y = -3 * a - 2 * b"),
        ("y = -(a + 2 * b + c)", "y = -2 * b - a - c"),
        ("y = a * -(-(-3))", "y = a * -3"),
        # Products and quotients pass signs on.
        ("y = -a * b", "y = -(a * b)"),
        ("y = a * -b", "y = -(a * b)"),
        ("y = -a * -b", "y = a * b"),
        ("y = -a / b", "y = -(a / b)"),
        ("y = a / -b", "y = -(a / b)"),
        ("y = -a / -b", "y = a / b"),
        ("y = a * (-b * -(c * -d))", "y = -(a * (b * (c * d)))"),
        # Functions are even or odd.
        ("y = cos(-x)", "y = cos(x)"),
        ("y = sinc(-x)", "y = sinc(x)"),
        ("y = sin(-x)", "y = -sin(x)"),
        ("y = a + b * sin(-x)", "y = a - b * sin(x)"),
        # A name that stands for nothing loses its sign.
        (
            "shared_1 = -(a * b); y = c + shared_1; z = c - shared_1; w = cos(shared_1)",
            "shared_1 = a * b; y = c - shared_1; z = c + shared_1; w = cos(shared_1)",
        ),
        ("factor_1 = a * -b; y = factor_1 * factor_1", "factor_1 = a * b; y = factor_1 * factor_1"),
        ("shared_1 = -(a * b); y = c + shared_1", "shared_1 = a * b; y = c - shared_1"),
    ],
    fold_constants: [
        # The numbers of a product are gathered in front of it.
        ("y = 2 * (3 * x)", "y = 6 * x"),
        ("y = x * 3", "y = 3 * x"),
        ("y = x * 2 * 3 * z", "y = 6 * (x * z)"),
        ("y = 2 * x * (3 * z)", "y = 6 * (x * z)"),
        ("y = 2 * x / 4", "y = q(1, 2) * x"),
        ("y = x / 3 * 3", "y = x"),
        ("y = q(1, 2) * (q(2, 3) * x)", "y = q(1, 3) * x"),
        ("y = 1 * x", "y = x"),
        ("y = 2 * (3 * (4 * sqrt(2 * (5 * x))))", "y = 24 * sqrt(10 * x)"),
        # A division by a number is one multiplication.
        ("y = x / 3", "y = q(1, 3) * x"),
        ("y = x / 2 / 3", "y = q(1, 6) * x"),
        ("y = x / q(2, 3)", "y = q(3, 2) * x"),
        ("y = x / -3", "y = -(q(1, 3) * x)"),
        ("y = x / 1", "y = x"),
        ("y = x * z / 7 + 1", "y = q(1, 7) * (x * z) + 1"),
        # The numerator of a reciprocal is the place for a number: 2/x is one operation.
        ("y = 2 / (3 * x)", "y = q(2, 3) / x"),
        ("y = -2 / (3 * x)", "y = -(q(2, 3) / x)"),
        ("y = 1 / (x / 5)", "y = 5 / x"),
        ("y = 2 * x / (6 * z)", "y = q(1, 3) * (x / z)"),
        # What is known is carried out.
        ("y = 1 + 2 * 3", "y = 7"),
        ("y = 1 / 3 - q(1, 3)", "y = 0"),
        ("y = -(2 * 3)", "y = -6"),
        ("y = x + (1 - 1)", "y = x"),
        ("y = 0 + x", "y = x"),
        ("y = x - 0", "y = x"),
        ("y = 0 - x", "y = -x"),
        ("y = 0 * x + z", "y = z"),
        ("y = sin(x) * (2 - 2)", "y = 0"),
        ("y = select(at_least(x, 1 + 1), 2 * 2, x)", "y = select(at_least(x, 2), 4, x)"),
        # Signs are taken out of products.
        ("y = -x * (2 * z)", "y = -(2 * (x * z))"),
        ("y = -x * -z", "y = x * z"),
        ("y = 3 * -(2 * x)", "y = -(6 * x)"),
        # What differs from a name by a number is no sum of a sum.
        ("part = 2 - x; y = part + 1; z = q(3, 2) - part", "part = 2 - x; y = 3 - x; z = x - q(1, 2)"),
        ("part = x + 1; other = part - 3; y = 2 - other", "part = x + 1; other = x - 2; y = 4 - x"),
        ("part = x - 1; y = part + 1", "part = x - 1; y = x"),
        # A scaling moves through a name that is only scaled again, one name a time.
        (
            "shared_1 = 2 * (x + z); a = 3 * shared_1; b = shared_1 / 4 + z",
            "shared_1 = x + z; a = 6 * shared_1; b = q(1, 2) * shared_1 + z",
        ),
        (
            "shared_1 = 2 * x * x; factor_1 = 3 * shared_1; a = 5 * factor_1",
            "shared_1 = x * x; factor_1 = 2 * shared_1; a = 15 * factor_1",
        ),
        (
            "shared_1 = x * x; factor_1 = 2 * shared_1; a = 15 * factor_1",
            "shared_1 = x * x; factor_1 = shared_1; a = 30 * factor_1",
        ),
    ],
    drop_copies: [
        (
            "part = x + 1; shared_1 = part; y = shared_1 * shared_1; z = sin(shared_1)",
            "part = x + 1; y = part * part; z = sin(part)",
        ),
        ("factor_1 = x; y = factor_1 * z", "y = x * z"),
        ("shared_1 = x; shared_2 = shared_1; factor_1 = shared_2; y = 2 * factor_1", "y = 2 * x"),
        ("shared_1 = q(1, 3); y = shared_1 * x", "y = q(1, 3) * x"),
        # A name that means something stays; what copies it refers to it, not past it.
        ("part = x; shared_1 = part; y = 2 * shared_1", "part = x; y = 2 * part"),
    ],
    reuse_values: [
        # Equal operations get a name, in one tree too.
        (
            "y = sin(x * z) + 1; w = 2 - sin(x * z)",
            "shared_1 = sin(x * z); y = shared_1 + 1; w = 2 - shared_1",
        ),
        ("y = (a + b) * (a + b)", "shared_1 = a + b; y = shared_1 * shared_1"),
        # What has a name is referred to by it; not where the name comes later than a value that needs one.
        ("part = x * z; y = x * z + 1", "part = x * z; y = part + 1"),
        ("part = x * z; y = x * z", "part = x * z; y = part"),
        ("y = x * z + 1; part = x * z", "shared_1 = x * z; y = shared_1 + 1; part = shared_1"),
        # Only the largest equal part is named, and a part of it that also stands elsewhere.
        ("y = a * b + c; z = sin(a * b + c)", "y = a * b + c; z = sin(y)"),
        (
            "y = 2 * (a * b + c); z = sin(a * b + c)",
            "shared_1 = a * b + c; y = 2 * shared_1; z = sin(shared_1)",
        ),
        (
            "y = 2 * (a * b + c); z = sin(a * b + c); w = 1 - a * b",
            "shared_1 = a * b; shared_2 = shared_1 + c; y = 2 * shared_2; z = sin(shared_2); w = 1 - shared_1",
        ),
        # Names that are taken are not given again.
        (
            "shared_1 = a + b; shared_3 = shared_1 * a; y = sin(c) * shared_3 + sin(c) + sin(d * d) - d * d",
            "shared_1 = a + b; shared_3 = shared_1 * a; shared_2 = sin(c); shared_4 = d * d; "
            "y = shared_2 * shared_3 + shared_2 + sin(shared_4) - shared_4",
        ),
        # A condition is no value; what it compares are values, and so is a whole choice.
        (
            "y = select(at_least(a * b, 0), c, d); z = select(at_least(a * b, 0), d, c)",
            "shared_1 = a * b; y = select(at_least(shared_1, 0), c, d); z = select(at_least(shared_1, 0), d, c)",
        ),
        (
            "y = 1 + select(at_least(a, b), c, d); z = sin(select(at_least(a, b), c, d))",
            "shared_1 = select(at_least(a, b), c, d); y = 1 + shared_1; z = sin(shared_1)",
        ),
    ],
    horner_schemes: [
        ("y = x * a + x * b", "y = x * (a + b)"),
        ("y = 3 * x * x + 2 * x + 1", "y = x * (3 * x + 2) + 1"),
        ("y = x * x * x - x * x", "y = x * (x * (x - 1))"),
        ("y = x * z - z * x", "y = 0"),
        ("y = 2 * x - (x + x)", "y = 0"),
        ("y = a * x + b + a * z - b", "y = a * (x + z)"),
        # What is no sum or product is an atom, and polynomials inside it are found.
        (
            "y = sin(x) * a + b * sin(x); z = sqrt(x) * sqrt(x) + sqrt(x)",
            "y = sin(x) * (a + b); z = sqrt(x) * (sqrt(x) + 1)",
        ),
        ("y = sin(x * a + x * b)", "y = sin(x * (a + b))"),
        (
            "y = select(at_least(x * a + x * b, 0), c, (a * c + c * b) / d)",
            "y = select(at_least(x * (a + b), 0), c, c * (a + b) / d)",
        ),
        ("y = sin(a * c + a * d) * x + x * z", "y = x * (sin(a * (c + d)) + z)"),
    ],
    share_multiples: [
        # The multiple is a factor where the other one needs fewer products then: 1 takes none, 2 a sum.
        (
            "w = q(1, 2) - q(1, 48) * a; y = a * (q(1, 24) * g - q(1, 128) * a - q(1, 8)) + 1",
            "a_over_48 = q(1, 48) * a; w = q(1, 2) - a_over_48; y = a_over_48 * (g + g - q(3, 8) * a - 6) + 1",
        ),
        (
            "y = (3 * b + 6 * c - 9) * a; w = 3 * a + b",
            "a_times_3 = 3 * a; y = a_times_3 * (b + (c + c) - 3); w = a_times_3 + b",
        ),
        # What has a name is referred to by it; not where the name comes later.
        ("part = 3 * a; y = a * (3 * b - 3 * c)", "part = 3 * a; y = part * (b - c)"),
        (
            "y = a * (3 * b - 3 * c); part = 3 * a",
            "a_times_3 = 3 * a; y = a_times_3 * (b - c); part = a_times_3",
        ),
        (
            "w = q(2, 3) * a + c; y = a * (q(2, 3) * b - q(4, 3)); a_over_3 = b + 1",
            "a_times_2_over_3 = q(2, 3) * a; w = a_times_2_over_3 + c; y = a_times_2_over_3 * (b - 2); "
            "a_over_3 = b + 1",
        ),
        # Names that are taken are not given again, and a multiple of a temporary is one.
        (
            "a_over_3 = b + 1; w = q(1, 3) * a + c; y = a * (q(1, 3) * b - 2)",
            "a_over_3 = b + 1; shared_1 = q(1, 3) * a; w = shared_1 + c; y = shared_1 * (b - 6)",
        ),
        (
            "shared_1 = b * b; w = 3 * shared_1 + c; y = shared_1 * (3 * b - 3)",
            "shared_1 = b * b; shared_2 = 3 * shared_1; w = shared_2 + c; y = shared_2 * (b - 1)",
        ),
        # Of several multiples that with which most is saved is taken.
        (
            "v = 5 * a; w = 3 * a; y = a * (3 * b + 3 * c + 15 * d)",
            "v = 5 * a; w = 3 * a; y = w * (b + c + 5 * d)",
        ),
    ],
}
#: Each factor has eight terms; multiplied out they would be hundreds, and x (...) would hardly be found.
FACTOR = "(" + " + ".join("abcdefgh") + ")"
#: Texts of programs that a pass leaves as they are.
KEPT = {
    absorb_negations: [
        *("y = a - b", "y = -(a * b)", "y = -a", "y = sqrt(-a)", "y = -(sin(x) / 2)"),
        *("y = a - 3 * b", "y = c - (3 * a + 2 * b)", "y = -(a + b)", "shared_1 = 2; y = shared_1 - x"),
        "y = -(a * 3)",  # constants stand first, which is another pass's work
        *("y = sqrt(-x)", "y = atan2(-a, b)", "y = maximum(-a, -b)"),
        "y = select(at_least(-a, b), -c, d)",
        # A name that means something keeps its sign.
        *("part = -a; y = c + part", "part = -(a * b); y = c - part"),
    ],
    fold_constants: [
        *("y = x * z", "y = 2 * x + 3", "y = -(2 * x)", "y = x - z", "y = 3 / x"),
        *("y = sqrt(2) * x", "y = sin(1)", "y = maximum(1, 2)", "y = atan2(0, 1)"),  # not exact
        "shared_1 = 2 * x; a = 3 * shared_1; b = shared_1 + z",  # one use takes it as it is
        "shared_1 = 2 * x; a = 3 * shared_1; b = -shared_1",  # a sign is no operation that would be saved
        "shared_1 = 2 * x; a = shared_1 * z",
        "part = 2 * x; a = 3 * part",  # the name says what it holds
        "shared_1 = x + z; a = 3 * shared_1",
    ],
    drop_copies: ["y = x * x", "part = x; y = 2 * part", "shared_1 = -x; y = z * shared_1"],
    reuse_values: [
        "y = select(at_least(a, b), c, d); z = select(at_least(a, b), d, c)",
        "y = sin(a + b); z = cos(b + a)",  # no equal trees: those are the work of share_pairs
    ],
    share_multiples: [
        *("w = 2 * a; y = a * (b + c)", "w = 3 * a; y = a * (b - 3 * c)", "y = a * (3 * b + 1)"),
        "w = 3 * a; y = a * (3 * b + 3 * c + 1)",  # 1/3 would be rounded
        "w = 3 * b; y = a * (3 * b + 3 * c)",  # a multiple of another value
        "y = a * (3 * a + 3 * b)",  # the multiple stands in the product alone
    ],
    remove_unused: [
        "shared_1 = x * x; y = select(at_least(shared_1, 2), x, z)",
        "part = x * x; y = part + 1",
    ],
    horner_schemes: [
        *("y = (a + b) * (a - b)", "y = (x + 1) * (x + 1) * (x + 1)", "y = x * (a + b)", "y = a * b + c * d"),
        *("y = q(1, 2) * (x - z)", "y = x", "y = -x"),
        f"y = x * ({FACTOR} * {FACTOR} * {FACTOR}) + x * z",
    ],
}
#: Texts of programs that a pass does not even copy.
NOT_COPIED = {
    **{run: KEPT[run] for run in (drop_copies, remove_unused, horner_schemes, share_multiples)},
    absorb_negations: ["y = a - b * c; w = cos(y) / 2"],
    fold_constants: ["y = x - z; w = sqrt(y) + 2"],
}


def rows(table):
    return [pytest.param(run, text, id=f"{run.__name__}-{text}") for run in table for text in table[run]]


@pytest.mark.parametrize(
    ("run", "before", "after"),
    [
        pytest.param(run, before, after, id=f"{run.__name__}-{before}")
        for run, pairs in REWRITTEN.items()
        for before, after in pairs
    ],
)
def test_a_program_is_rewritten(run, before, after, parse, show):
    assert show(run(parse(before))) == after


@pytest.mark.parametrize(("run", "text"), rows(KEPT))
def test_a_program_is_kept(run, text, parse):
    program = parse(text)
    assert run(program) == program


@pytest.mark.parametrize(("run", "text"), rows(NOT_COPIED))
def test_a_program_is_not_even_copied(run, text, parse):
    program = parse(text)
    assert run(program) is program


@pytest.mark.parametrize(
    ("run", "text"),
    [
        (absorb_negations, "shared_1 = -(a * b); y = c + shared_1"),
        (fold_constants, "shared_1 = 2 * a; y = 3 * shared_1"),
    ],
)
@pytest.mark.parametrize(("results", "transition"), [("y shared_1", ""), ("y", "shared_1")])
def test_results_keep_signs_and_scalings(run, text, results, transition, parse):
    program = parse(text, results, transition)
    assert run(program) == program


# Unused values


@pytest.mark.parametrize(
    ("before", "transition", "after"),
    [
        ("dead = x * x; y = x + 1; deader = sqrt(dead); shared_1 = deader + y", "", "y = x + 1"),
        (
            "shared_1 = x * x; part = shared_1 + 1; y = part * shared_1; z = -y",
            "",
            "shared_1 = x * x; part = shared_1 + 1; y = part * shared_1",
        ),
        ("part = x * x; other = x + 1; y = z * z", "part", "part = x * x; y = z * z"),
    ],
)
def test_unused_values_are_dropped(before, transition, after, parse, show):
    assert show(remove_unused(parse(before, "y", transition))) == after


# Copies


def test_results_that_held_a_copy_hold_the_original(parse):
    before = parse(
        "part = x * x; shared_1 = part; shared_2 = 3", "shared_1 shared_2 part", "shared_2 shared_1"
    )
    after = drop_copies(before)
    assert [node for result in after.outputs for node in result.nodes] == [
        *(Reference("part"), Constant(3), Reference("part"))
    ]
    assert after.transition.nodes == (Constant(3), Reference("part"))
    assert after.transition.signal == before.transition.signal
    assert after.run({"x": 5}) == before.run({"x": 5})


# Signs and numbers


def test_the_negative_of_a_number_is_a_number(parse, show):
    minus = Operation("negate", (Constant(Fraction(3)),))
    body = (Assignment("y", Operation("multiply", (Reference("a"), minus))),)
    assert show(absorb_negations(replace(parse("y = a"), body=body))) == "y = a * -3"


def test_signs_move_through_several_names(parse):
    first = ("-a", "-(a * b)", "b - a", "-(-a)", "-a - b")
    second = (
        *("-shared_1", "-(shared_1 * c)", "-shared_1 - c", "c - shared_1", "-(c + shared_1)"),
        "-a * shared_1",
    )
    last = ("shared_2 + shared_1", "-shared_2", "a * shared_2", "-(shared_1 - shared_2)", "cos(shared_2)")
    point = {"a": Fraction(2), "b": Fraction(-3), "c": Fraction(7, 2)}
    for lines in itertools.product(first, second, last):
        before = parse("shared_1 = {}; shared_2 = {}; y = {}".format(*lines))
        values = {name: point[name] for signal in before.inputs for name in signal.elements}
        assert absorb_negations(before).run(values) == before.run(values), lines


@pytest.mark.parametrize("text", ["y = x / 0", "y = 3 / 0", "y = 0 / 0", "y = x * z / 0", "y = 1 / (1 / 0)"])
def test_a_division_by_zero_is_left_to_the_one_who_runs_it(parse, text):
    program = parse(text)
    assert fold_constants(program) == program
    with pytest.raises(ZeroDivisionError):
        program.run({"x": 1, "z": 1})


# Nested products


def operations(program: Program) -> tuple[int, int]:
    """Return multiplications and additions; there is nothing else."""
    assert sum(program.operations.values()) == program.operations["multiply"] + program.operations["add"]
    return program.operations["multiply"], program.operations["add"]


@pytest.mark.parametrize(
    ("text", "multiplications", "additions"),
    [
        # A (G/24 - A/128 - 1/8) + 1
        ("y = 1 - q(1, 8) * A + q(1, 24) * A * G - q(1, 128) * A * A", 3, 3),
        # the same in two increments, A/384 + D/96 - 1/8
        ("y = q(1, 384) * A * A - q(1, 96) * A * D - q(1, 8) * A + 1", 3, 3),
        # A (A/24 - 1/2) - B B/6
        ("y = q(1, 24) * A * A - q(1, 2) * A - q(1, 6) * B * B", 4, 2),
        # by its degree: six multiplications
        ("y = x * x * x * x * x * x + x * x * x * x * x + x * x * x * x + x * x * x + x * x + x", 5, 5),
        # b (a (c + d) + 1) + c d
        ("y = a * b * c + a * b * d + b + c * d", 3, 3),
        # Equal coefficients are applied once.
        ("y = q(1, 3) * a + q(1, 3) * b - q(1, 3) * c + a * 0", 1, 2),
    ],
)
def test_operations_of_polynomials_in_several_variables(parse, text, multiplications, additions):
    assert operations(horner_schemes(parse(text))) == (multiplications, additions)


def saved(parse, text: str, results: str = "") -> dict[str, int]:
    """Return how many operations are saved, by kind."""
    before = parse(text, results)
    after = share_pairs(before).operations
    return {kind: n - after[kind] for kind, n in before.operations.items() if n != after[kind]}


@pytest.mark.parametrize(
    ("text", "operations"),
    [
        ("y = x * x + z * z; w = a * a + z * z + x * x", {"add": 1, "multiply": 2}),
        ("y = a + b + c; z = c + d + a", {"add": 1}),
        ("y = a + (b + c); z = (c + a) + d", {"add": 1}),
        ("y = a - b; z = c + b - a", {"add": 1}),
        ("y = a - b - c; z = d + c + b", {"add": 1}),
        ("y = a * b * c; z = d * (c * a)", {"multiply": 1}),
        ("y = a * b * c; z = a * c * d; w = c * e * a", {"multiply": 2}),
        ("y = sin(a + b + c); z = select(at_least(c + a, 0), x, z_0)", {"add": 1}),
        ("y = a + b + c + d; z = d + c + b + a", {"add": 3}),
    ],
)
def test_a_pair_is_computed_once(parse, text, operations):
    assert saved(parse, text) == operations


def test_squares_are_found_in_any_order_and_with_any_signs(parse, show):
    before = parse("y = 1 - x * x - z * z; w = z * z + a * a + x * x")
    after = share_pairs(before)
    assert (after.operations["add"], after.operations["multiply"]) == (3, 3)
    point = {"x": 3, "z": 5, "a": 7}
    assert after.run(point) == before.run(point) == {"output_y": [-33], "output_w": [83]}


def test_opposite_pairs_are_one_difference(parse, show):
    assert (
        show(share_pairs(parse("y = a - b; z = c + b - a")))
        == "shared_1 = a - b; y = shared_1; z = c - shared_1"
    )


@pytest.mark.parametrize(
    "text",
    [
        "y = a + b; z = a - b",
        "y = a * b; z = a + b",
        "y = a * b; z = a / b",
        "y = a + b; z = c + d",
        "y = a + 2 * b; z = a + 3 * b",
        "y = sin(a); z = sin(a)",  # equal operations are the work of reuse_values
        "y = select(at_least(a, b), c, d); z = select(at_least(a, b), d, c)",
        "y = atan2(a, b); z = atan2(a, b)",
        "y = a * a * a * a",  # within one product nothing is paired twice
    ],
)
def test_program_without_repeated_pairs_is_unchanged(parse, text):
    program = parse(text)
    assert share_pairs(program) is program


def test_the_most_frequent_pair_comes_first(parse, show):
    # b + c stands in three sums; a + b, if it were taken first, would leave two of them.
    after = share_pairs(parse("x = a + b + c; y = b + c + d; z = c + e + b; w = a + b + f"))
    assert show(after).startswith("shared_1 = b + c; x = ")
    assert after.operations["add"] == 6


def test_a_name_that_stands_for_nothing_and_is_used_once_is_opened(parse, show):
    # As it stands a + c hides the a that b could be paired with.
    assert show(share_pairs(parse("shared_1 = a + c; y = shared_1 + b; z = a + b"))) == (
        "shared_1 = a + b; y = shared_1 + c; z = shared_1"
    )


@pytest.mark.parametrize(
    ("text", "results"),
    [
        ("part = a + c; y = part + b; z = a + b", "y z"),  # it means something
        ("shared_1 = a + c; y = shared_1 + b; z = a + b; w = sin(shared_1)", ""),  # it is used twice
        ("shared_1 = a + c; y = shared_1 + b; z = a + b", "y z shared_1"),  # it is a result
    ],
)
def test_other_names_stay_closed(parse, text, results):
    program = parse(text, results)
    assert share_pairs(program) is program


def test_a_pair_is_computed_before_its_first_use_and_after_its_parts(parse, show):
    before = parse("part = sin(x); u = 2 * x; y = part + u + 1; z = u - 3 + part")
    assert show(share_pairs(before)) == (
        "part = sin(x); u = 2 * x; shared_1 = part + u; y = shared_1 + 1; z = shared_1 - 3"
    )


def test_names_that_are_taken_are_not_given_again(parse, show):
    before = parse("shared_1 = sin(x); w = shared_1 * shared_1; y = a + b + c; z = b + a - shared_1")
    assert show(share_pairs(before)) == (
        "shared_1 = sin(x); w = shared_1 * shared_1; shared_2 = a + b; y = shared_2 + c; z = shared_2 - shared_1"
    )


def test_a_sum_and_a_difference_in_one_value_stay_apart(parse):
    before = parse("y = (a + b + c) * (a - b + d); z = a + b + e")
    after = share_pairs(before)
    assert after.operations["add"] == before.operations["add"] - 1
    point = {"a": 3, "b": 5, "c": 7, "d": 11, "e": 13}
    assert after.run(point) == before.run(point)
