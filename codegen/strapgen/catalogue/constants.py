"""Reads the constants of a choice, which take the place of inputs, and writes them as options of the command line."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from decimal import Context, Decimal
from fractions import Fraction
from typing import Any, TypeAlias

from strapgen.ir import checks
from strapgen.ir.checks import shown
from strapgen.ir.exceptions import InputTypeError

#: Constants as a value: the name of each input with its numbers in row-major order, sorted by the names.
Constants: TypeAlias = tuple[tuple[str, tuple[Fraction, ...]], ...]

#: Most characters of a decimal number that stands as it is, and of an option that stands without spaces.
_SHORT_NUMBER, _SHORT_OPTION = 8, 60


def read(constants: Mapping[str, Any]) -> Constants:
    """Return constants by the name of the input, in its unit and row by row, as a value with exact numbers.

    A number is an int, a Fraction, a decimal or a fraction as text, or a float, which stands for its shortest decimal.

    >>> read({"rate_bias": [0.5, "1/3", 0], "cycle": "0.02"})
    (('cycle', (Fraction(1, 50),)), ('rate_bias', (Fraction(1, 2), Fraction(1, 3), Fraction(0, 1))))
    """
    if not isinstance(constants, Mapping):
        raise InputTypeError(f"constants is {shown(constants)}; a mapping from names of inputs is needed")
    for name in constants:
        if not isinstance(name, str):
            raise InputTypeError(f"constants holds {shown(name)}; the name of an input is needed")
    return tuple(
        (name, tuple(checks.number(f"constant {name}", value) for value in _flat(constants[name])))
        for name in sorted(constants)
    )


def _flat(value: Any) -> Iterator[Any]:
    """Yield the numbers of an array or of nested sequences."""
    value = value.tolist() if hasattr(value, "tolist") else value
    if isinstance(value, list | tuple):
        for part in value:
            yield from _flat(part)
    else:
        yield value


def options(constants: Constants) -> str:
    """Return constants as options of the command line; a long one has spaces, at which a header may wrap it.

    Examples
    --------
    >>> options(read({"cycle": "1/50", "rate_bias": [1e-9, -0.5, "1/3"]}))
    '--constant cycle=0.02 --constant rate_bias=1e-9,-0.5,1/3'
    """
    words = []
    for name, numbers in constants:
        texts = [number_text(number) for number in numbers]
        short = f"--constant {name}={','.join(texts)}"
        words.append(short if len(short) <= _SHORT_OPTION else f"--constant '{name}={', '.join(texts)}'")
    return " ".join(words)


def number_text(number: Fraction) -> str:
    """Return a short text that `checks.number` reads as this number.

    Examples
    --------
    >>> number_text(Fraction(1, 4)), number_text(Fraction(-3, 10**9)), number_text(Fraction(2, 3))
    ('0.25', '-3e-9', '2/3')
    """
    places = _decimal_places(number.denominator)
    if places is None:
        return str(number)
    sign = "-" if number < 0 else ""
    digits = str(abs(number.numerator) * (10**places // number.denominator))
    plain = f"{sign}{Decimal(digits).scaleb(-places, Context(len(digits))):f}"
    if len(plain) <= _SHORT_NUMBER:
        return plain
    first, rest = digits[0], digits[1:].rstrip("0")
    short = f"{sign}{first}{'.' if rest else ''}{rest}e{len(digits) - 1 - places}"
    return min(plain, short, str(number), key=len)


def _decimal_places(denominator: int) -> int | None:
    """Return how many decimal places a denominator needs; None if no number of them is enough."""
    powers = []
    for prime in (2, 5):
        powers.append(0)
        while denominator % prime == 0:
            denominator //= prime
            powers[-1] += 1
    return max(powers) if denominator == 1 else None
