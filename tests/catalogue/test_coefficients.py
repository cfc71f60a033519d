"""Coefficients as text: exact values, and refusals in one line for what is no coefficient."""

import math
import subprocess
import sys
from decimal import Decimal
from fractions import Fraction

import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from strapgen.catalogue import toml_models
from strapgen.catalogue.coefficients import number
from strapgen.ir.exceptions import InputError

QUICK = settings(derandomize=True, database=None, deadline=None)
ROOT = sp.sqrt(21)


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("9/44", Fraction(9, 44)),
        ("-1", Fraction(-1)),
        ("+3", Fraction(3)),
        (7, Fraction(7)),
        ("0.1", Fraction(1, 10)),
        (".5", Fraction(1, 2)),
        ("2.", Fraction(2)),
        ("1e-3", Fraction(1, 1000)),
        (" 1 / 3 ", Fraction(1, 3)),
        ("2**-2", Fraction(1, 4)),
        ("-(1 - 3)*2/8", Fraction(1, 2)),
        ("sqrt(4/9)", Fraction(2, 3)),
        ("sqrt(2)**2", Fraction(2)),
        ("(1+sqrt(2))*(1-sqrt(2))", Fraction(-1)),
        ("(sqrt(2)+sqrt(3))**2 - 2*sqrt(6)", Fraction(5)),
        ("sqrt(3+2*sqrt(2)) - sqrt(2)", Fraction(1)),
        ("sqrt(2+sqrt(3)) - (sqrt(6)+sqrt(2))/2", Fraction(0)),
    ],
)
def test_rationals_are_fractions_however_they_are_written(written, value):
    read = number("x", written)
    assert isinstance(read, Fraction)
    assert read == value


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("(18-sqrt(21))/180", sp.Rational(1, 10) - ROOT / 180),
        ("1/(1+sqrt(5))", (sp.sqrt(5) - 1) / 4),
        ("(1+sqrt(2))**-3", 5 * sp.sqrt(2) - 7),
        ("sqrt(84)", 2 * ROOT),
        ("sqrt(3+2*sqrt(2))", 1 + sp.sqrt(2)),
        ("sqrt(2)*sqrt(3)", sp.sqrt(6)),
    ],
)
def test_irrationals_are_sums_of_roots(written, value):
    # In one form only, since nodes are told apart by it.
    assert number("x", written) == sp.expand(value)


@QUICK
@given(st.fractions(max_denominator=10**12))
def test_a_fraction_is_read_as_it_is_written(value):
    assert number("x", str(value)) == value


@QUICK
@given(st.decimals(allow_nan=False, allow_infinity=False, min_value=-1000, max_value=1000, places=12))
def test_a_decimal_is_taken_exactly(value):
    assert number("x", str(value)) == Fraction(value)


EXPRESSIONS = st.recursive(
    st.integers(0, 99).map(str) | st.sampled_from(["0.5", "sqrt(2)", "sqrt(9)"]),
    lambda inner: (
        st.builds("({} {} {})".format, inner, st.sampled_from("+-*/"), inner)
        | st.builds("-{}".format, inner)
        | st.builds("({})**{}".format, inner, st.integers(0, 3))
    ),
    max_leaves=6,
)


@settings(QUICK, max_examples=25)
@given(EXPRESSIONS)
def test_an_expression_has_the_value_that_python_gives_it(written):
    try:
        read = number("x", written)
    except InputError as error:
        assert "divides by zero" in str(error)
        return
    try:
        near = eval(written, {"sqrt": math.sqrt})
    except ZeroDivisionError:
        pytest.fail("a division by zero went through")
    # Python's own rounding stays; a difference that cancels is no more exact than that.
    assert float(read) == pytest.approx(near, rel=1e-6, abs=1e-9) or abs(near) > 1e9
    assert number("x", str(read)) == read


#: What UTF-8 writes; asked for by name, Hypothesis would try its codec on every character.
TEXT = st.text(st.characters(exclude_categories=("Cs",)), max_size=40)


@QUICK
@given(TEXT)
def test_any_text_is_a_number_or_an_error_of_one_line(written):
    try:
        number("x", written)
    except InputError as error:
        assert str(error).startswith("x is ") and "\n" not in str(error)


@pytest.mark.parametrize(
    ("written", "said"),
    [
        (0.5, 'is 0.5, which is not exact; a string such as "9/44"'),
        (True, "is of type bool; a string"),
        (None, "is of type NoneType; a string"),
        (["1"], "is of type list; a string"),
        ("", "is '': a number such as"),
        ("1/", "is '1/': a number such as"),
        ("1 2", "is '1 2': a number such as"),
        ("one", "numbers, + - * /, parentheses, whole powers with ** and sqrt are allowed"),
        ("sin(1)", "are allowed"),
        ("2 // 3", "are allowed"),
        ("sqrt(1).real", "are allowed"),
        ("__import__('os')", "a number such as"),
        ("1_0", "a number such as"),
        ("0x10", "'0x10' is no number"),
        ("2j", "'2j' is no number"),
        ("1/0", "it divides by zero"),
        ("0**-1", "it divides by zero"),
        ("1/(sqrt(2)*sqrt(3)-sqrt(6))", "it divides by zero"),
        ("1/((sqrt(2)+sqrt(3))**2-5-2*sqrt(6))", "it divides by zero"),
        ("sqrt(-2)", "root of a negative number"),
        ("sqrt(2-sqrt(5))", "root of a negative number"),
        ("2**0.5", "a power must be whole"),
        ("2**sqrt(2)", "a power must be whole"),
        ("9**9**9", "a power is at most 100"),
        ("((9**99)**99)**99", "over 2048 binary digits"),
        ("((1+sqrt(2))**99)**99", "over 2048 binary digits"),
        (10**1000, "over 2048 binary digits"),
        ("1e999999999", "an exponent is at most 100"),
        ("1e-999999999", "an exponent is at most 100"),
        ("9" * 2_000_000, "2000002 characters long: at most 1000 characters are allowed"),
        ("(" * 400 + "1" + ")" * 400, "is needed"),
        ("sqrt(2)+sqrt(3)+sqrt(5)+sqrt(7)", "at most three different square roots"),
        ("sqrt(sqrt(sqrt(sqrt(2))))", "at most three different square roots"),
    ],
)
def test_invalid_input_is_refused(written, said):
    with pytest.raises(InputError) as caught:
        number("weights, entry 2", written)
    message = str(caught.value)
    assert message.startswith("weights, entry 2") and said in message
    assert "\n" not in message and len(message) < 250


def test_deep_nesting_is_no_crash():
    def deeper(levels: int) -> None:
        if levels:
            deeper(levels - 1)
        else:
            number("x", "-" * 900 + "1")

    with pytest.raises(InputError, match=r"nested too deeply|a number such as"):
        deeper(800)


def test_products_of_sums_do_not_explode():
    assert number("x", "*".join(["(1+sqrt(2))*(1-sqrt(2))"] * 40)) == 1


def test_rationals_need_no_computer_algebra():
    code = (
        "import sys; from strapgen.catalogue.coefficients import number; number('x', 'sqrt(4)*9/44');"
        "print('sympy' in sys.modules)"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "False"


def test_a_file_keeps_the_digits_of_its_numbers(tmp_path):
    place = tmp_path / "numbers.toml"
    place.write_bytes(b"\xef\xbb\xbfa = 0.1\r\nb = 2\r\n")  # as an editor on Windows writes it
    assert toml_models.content(place, "a file", 100) == {"a": Decimal("0.1"), "b": 2}


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"a = 1\n" * 20, "is over 100 bytes long; a file is shorter"),
        (b"a = \xff", "is not UTF-8 (byte 4)"),
        (b"a = ", "is not TOML ("),
        (b"a = 1\na = 2", "is not TOML ("),
        (None, "cannot be read ("),
    ],
)
def test_errors_in_a_file_are_reported_in_one_line(data, message, tmp_path):
    place = tmp_path / "file.toml"
    if data is not None:
        place.write_bytes(data)
    with pytest.raises(InputError) as error:
        toml_models.content(place, "a file", 100)
    assert message in str(error.value)
    assert "\n" not in str(error.value)
