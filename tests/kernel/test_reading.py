"""Expressions from text: what SymPy writes is read again, and nothing else runs."""

from __future__ import annotations

import pytest
import sympy as sp

from strapgen.ir.exceptions import InputError
from strapgen.kernel.reading import expression

A, B = sp.symbols("a b", real=True)
NAMES = {"a": A, "b": B}


@pytest.mark.parametrize(
    "value",
    [
        sp.Rational(-57, 80),
        (A - B) ** 3 / (2 * A + sp.sqrt(3)),
        sp.sqrt(1 + sp.sqrt(2)) * A**-2,
        sp.sin(2 * A) * sp.cos(B) - sp.pi / 7,
    ],
)
def test_what_sympy_writes_is_read(value):
    assert expression("value", sp.sstr(value), NAMES) == value


def test_decimals_are_exact():
    assert expression("value", "0.1 + 2e-1*a", NAMES) == sp.Rational(1, 10) + A / 5


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("c + 1", "c is not known; known are a, b, pi"),
        ("a +", "an expression such as"),
        ("1/(a - a)", "it divides by zero"),
        ("0**-1", "it divides by zero"),
        ("a**b", "a power must be whole"),
        ("a**1000", "at most 100"),
        ("1e999", "an exponent of at most 100"),
        ("sqrt(1, 2, 3, 4)", "another number of arguments"),
        ("a.real", "are allowed"),
        ("'a'", "are allowed"),
        ("[a]", "are allowed"),
        ("a if b else 1", "are allowed"),
        ("eval('1')", "are allowed"),
        (0.5, "is of type float"),
        ("(" * 3000 + "1" + ")" * 3000, "value is"),
    ],
)
def test_anything_else_is_refused_in_one_line(text, reason):
    with pytest.raises(InputError) as refusal:
        expression("value", text, NAMES)
    assert reason in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 300
