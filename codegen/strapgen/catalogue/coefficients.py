"""Coefficients of tableaux, exactly from text: fractions, decimals, and expressions with square roots.

A rational number is a `Fraction`, any other a SymPy expression. SymPy is loaded with the first irrational number, so
that rational tableaux can be read, and all tableaux listed, without it.
"""

from __future__ import annotations

import ast
import math
import re
import warnings
from fractions import Fraction
from typing import TYPE_CHECKING, Any, TypeAlias

from strapgen.ir.exceptions import InputError

if TYPE_CHECKING:
    import sympy as sp

    Number: TypeAlias = Fraction | sp.Expr
else:

    class Number:
        """An exact number, a `Fraction` or a SymPy expression; a type for readers of annotations, without SymPy."""


#: Most characters of a text, and the largest exponent in it; both are far beyond any published coefficient.
MOST_CHARACTERS = 1000
MOST_EXPONENT = 100

#: Most binary digits of a numerator or denominator.
MOST_BITS = 2048

#: Largest degree of a field, that of three square roots, nested or not. A product in it takes 0.1 ms.
MOST_DEGREE = 8

_CHARACTERS = re.compile(r"[0-9a-z+\-*/(). ]*", re.IGNORECASE)
_LITERAL = re.compile(r"(\d+\.?\d*|\.\d+)(e([+-]?\d+))?", re.IGNORECASE)


class _NotAllowedError(Exception):
    """The reason why a text is no allowed number."""


def number(what: str, value: Any) -> Number:
    """Read an exact number: whole, a fraction, a decimal, or an expression with + - * /, whole powers and square roots.

    >>> number("node", "9/44")
    Fraction(9, 44)
    >>> number("weight", "(18-sqrt(21))/180")
    1/10 - sqrt(21)/180
    """
    if isinstance(value, float):
        raise InputError(
            f'{what} is {value!r}, which is not exact; a string such as "9/44" or "0.5" is needed'
        )
    if isinstance(value, int) and not isinstance(value, bool):
        if value.bit_length() > MOST_BITS:
            raise InputError(f"{what}: numbers of over {MOST_BITS} binary digits are not allowed")
        return Fraction(value)
    if not isinstance(value, str):
        raise InputError(f'{what} is of type {type(value).__name__}; a string such as "9/44" is needed')
    try:
        return _simplify(_value(_parse(value), value))
    except _NotAllowedError as error:
        raise InputError(f"{what} is {_short(value)}: {error}") from None
    except RecursionError:
        raise InputError(f"{what} is {_short(value)}: it is nested too deeply") from None


def short_text(value: Number) -> str:
    """Return a number as text, exact if that is short, otherwise rounded."""
    if not isinstance(value, Fraction):
        import sympy as sp

        value = sp.expand(value)
    exact = str(value)
    return exact if len(exact) <= 40 else f"about {float(value):.9g}"


def _short(value: str) -> str:
    shown = repr(value)
    return shown if len(shown) <= 60 else f"{shown[:50]}..., {len(shown)} characters long"


def _parse(source: str) -> ast.expr:
    if len(source) > MOST_CHARACTERS:
        raise _NotAllowedError(f"at most {MOST_CHARACTERS} characters are allowed")
    try:
        if not _CHARACTERS.fullmatch(source):
            raise SyntaxError
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore", SyntaxWarning
            )  # what Python warns of is refused below, in one line
            return ast.parse(source.strip(), mode="eval").body
    # What is nested too deeply is a MemoryError or a RecursionError, depending on the release of Python.
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        raise _NotAllowedError('a number such as "9/44", "-0.5" or "(18-sqrt(21))/180" is needed') from None


def _value(node: ast.expr, source: str) -> Number:
    """Evaluate an expression; any syntax that is not listed here is refused."""
    match node:
        case ast.Constant():
            return _literal(ast.get_source_segment(source.strip(), node) or "")
        case ast.UnaryOp(op=ast.UAdd() | ast.USub()):
            value = _value(node.operand, source)
            return value if isinstance(node.op, ast.UAdd) else -value
        case ast.BinOp(op=ast.Pow()):
            return _power(_value(node.left, source), _value(node.right, source))
        case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div()):
            return _operation(node.op, _value(node.left, source), _value(node.right, source))
        case ast.Call(func=ast.Name(id="sqrt"), args=[argument], keywords=[]):
            return root(_simplify(_value(argument, source)))
    raise _NotAllowedError("numbers, + - * /, parentheses, whole powers with ** and sqrt are allowed")


def _literal(source: str) -> Fraction:
    match = _LITERAL.fullmatch(source)
    if not match:
        raise _NotAllowedError(f"{source!r} is no number")
    if match[3] and abs(int(match[3])) > MOST_EXPONENT:
        raise _NotAllowedError(f"an exponent is at most {MOST_EXPONENT}")
    return _check_size(Fraction(source))


def _operation(operator: ast.operator, left: Number, right: Number) -> Number:
    if isinstance(operator, ast.Div):
        right = _inverse(right)
    if not (isinstance(left, Fraction) and isinstance(right, Fraction)):
        left, right = _expression(left), _expression(right)
    if isinstance(operator, ast.Add):
        result = left + right
    elif isinstance(operator, ast.Sub):
        result = left - right
    else:
        result = left * right
    if isinstance(result, Fraction):
        return _check_size(result)
    # Products of sums are multiplied out at once, because a long product would take very long at the end.
    return _simplify(result) if isinstance(operator, ast.Mult) else result


def _power(base: Number, exponent: Number) -> Number:
    if not isinstance(exponent, Fraction) or exponent.denominator != 1:
        raise _NotAllowedError("a power must be whole; roots are written as sqrt")
    if abs(exponent) > MOST_EXPONENT:
        raise _NotAllowedError(f"a power is at most {MOST_EXPONENT}")
    base = _simplify(base)
    if exponent < 0:
        base, exponent = _inverse(base), -exponent
    if isinstance(base, Fraction):
        if max(base.numerator.bit_length(), base.denominator.bit_length()) * exponent > 2 * MOST_BITS:
            raise _NotAllowedError(f"numbers of over {MOST_BITS} binary digits are not allowed")
        return _check_size(Fraction(base ** int(exponent)))
    return _simplify(base ** int(exponent))


def _inverse(value: Number) -> Number:
    """Return the reciprocal of a number, with a rational denominator, since a zero could hide in an irrational one."""
    value = _simplify(value)
    if value == 0:
        raise _NotAllowedError("it divides by zero")
    if isinstance(value, Fraction):
        return 1 / value
    from sympy.polys.constructor import construct_domain

    domain, (element,) = construct_domain([value], extension=True)
    return _simplify(domain.to_sympy(domain.one / element))


def root(square: Number) -> Number:
    """Return the square root of a number that `number` returns."""
    if (square if isinstance(square, Fraction) else square.evalf(50)) < 0:
        raise _NotAllowedError("it holds the root of a negative number")
    if isinstance(square, Fraction):
        whole = Fraction(math.isqrt(square.numerator), math.isqrt(square.denominator))
        if whole * whole == square:
            return whole
    import sympy as sp

    # Without denesting, sqrt(3 + 2 sqrt(2)) and 1 + sqrt(2) would be two different nodes.
    return sp.sqrtdenest(sp.sqrt(_expression(square)))


def _expression(value: Number) -> sp.Expr:
    import sympy as sp

    return sp.Rational(value.numerator, value.denominator) if isinstance(value, Fraction) else value


def _check_size(value: Fraction) -> Fraction:
    if max(value.numerator.bit_length(), value.denominator.bit_length()) > MOST_BITS:
        raise _NotAllowedError(f"numbers of over {MOST_BITS} binary digits are not allowed")
    return value


def _simplify(value: Number) -> Number:
    """Return a rational number as a `Fraction`, any other as a sum of multiples of roots; the decision is exact."""
    if isinstance(value, Fraction):
        return value
    import sympy as sp
    from sympy.polys.constructor import construct_domain

    if degree_bound([value]) > MOST_DEGREE:
        raise _NotAllowedError("at most three different square roots are allowed")
    value = sp.expand(value)
    powers = value.atoms(sp.Pow)
    # With a single root of a rational number no simplification is needed, since 1 and the root are independent.
    if any(not power.base.is_Rational for power in powers) or len(powers) > 1:
        domain, (element,) = construct_domain([value], extension=True)
        value = sp.expand(domain.to_sympy(element))
    for rational in value.atoms(sp.Rational):
        _check_size(Fraction(rational.p, rational.q))
    return Fraction(value.p, value.q) if value.is_Rational else value


def degree_bound(values: list[Any]) -> int:
    """Return an upper bound of the degree of the field of expressions: the product of the indices of their roots."""
    import sympy as sp

    roots = {
        (p.base, p.exp.q)
        for value in values
        for p in value.atoms(sp.Pow)
        if p.exp.is_Rational and p.exp.q > 1
    }
    return math.prod(q for _, q in roots)
