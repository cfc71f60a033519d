"""The pass `horner_schemes`: polynomials are written with nested products."""

import pytest

from strapgen.ir.program import Program
from strapgen.lowering.passes import horner_schemes


def operations(program: Program) -> tuple[int, int]:
    """Return multiplications and additions; there is nothing else."""
    assert sum(program.operations.values()) == program.operations["multiply"] + program.operations["add"]
    return program.operations["multiply"], program.operations["add"]


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("y = x * a + x * b", "y = x * (a + b)"),
        ("y = 3 * x * x + 2 * x + 1", "y = x * (3 * x + 2) + 1"),
        ("y = x * x * x - x * x", "y = x * (x * (x - 1))"),
        ("y = x * z - z * x", "y = 0"),
        ("y = 2 * x - (x + x)", "y = 0"),
        ("y = a * x + b + a * z - b", "y = a * (x + z)"),
    ],
)
def test_common_factors_are_taken_out(parse, show, before, after):
    assert show(horner_schemes(parse(before))) == after


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
    ],
)
def test_operations_of_polynomials_in_several_variables(parse, text, multiplications, additions):
    assert operations(horner_schemes(parse(text))) == (multiplications, additions)


def test_equal_coefficients_are_applied_once(parse):
    assert operations(horner_schemes(parse("y = q(1, 3) * a + q(1, 3) * b - q(1, 3) * c + a * 0"))) == (1, 2)


def test_what_is_no_sum_or_product_is_an_atom(parse, show):
    before = parse("y = sin(x) * a + b * sin(x); z = sqrt(x) * sqrt(x) + sqrt(x)")
    assert show(horner_schemes(before)) == "y = sin(x) * (a + b); z = sqrt(x) * (sqrt(x) + 1)"


def test_polynomials_inside_functions_and_conditions_are_found(parse, show):
    assert show(horner_schemes(parse("y = sin(x * a + x * b)"))) == "y = sin(x * (a + b))"
    before = parse("y = select(at_least(x * a + x * b, 0), c, (a * c + c * b) / d)")
    assert show(horner_schemes(before)) == "y = select(at_least(x * (a + b), 0), c, c * (a + b) / d)"
    assert (
        show(horner_schemes(parse("y = sin(a * c + a * d) * x + x * z"))) == "y = x * (sin(a * (c + d)) + z)"
    )


@pytest.mark.parametrize(
    "text",
    [
        "y = (a + b) * (a - b)",
        "y = (x + 1) * (x + 1) * (x + 1)",
        "y = x * (a + b)",
        "y = a * b + c * d",
        "y = q(1, 2) * (x - z)",
        "y = x",
        "y = -x",
    ],
)
def test_what_is_short_already_stays_the_same(parse, text):
    program = parse(text)
    assert horner_schemes(program) is program


def test_what_would_grow_too_long_stays_the_same(parse):
    # Each factor has eight terms; multiplied out they would be hundreds, and x (...) would hardly be found.
    factor = "(" + " + ".join("abcdefgh") + ")"
    program = parse(f"y = x * ({factor} * {factor} * {factor}) + x * z")
    assert horner_schemes(program) is program
