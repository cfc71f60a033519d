"""Exact expressions, and values of unknown coefficients, from text of which nothing is executed."""

from __future__ import annotations

import ast
import warnings
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import sympy as sp

from strapgen.ir.checks import unknown
from strapgen.ir.exceptions import InputError
from strapgen.kernel.algebra import exact

#: Most characters of a text, and the largest exponent in it.
MOST_CHARACTERS, MOST_EXPONENT = 100_000, 100
#: Functions and constants of an expression; no symbol may have one of these names.
FUNCTIONS = {"sqrt": sp.sqrt, "sin": sp.sin, "cos": sp.cos, "sinc": sp.sinc, "exp": sp.exp, "atan2": sp.atan2}
CONSTANTS = {"pi": sp.pi}
_OPERATIONS: dict[type[ast.operator], Any] = {
    ast.Add: lambda x, y: x + y,
    ast.Sub: lambda x, y: x - y,
    ast.Mult: lambda x, y: x * y,
}


class _UnreadableError(Exception):
    """The reason why a text is no allowed expression."""


def expression(
    what: str, text: Any, symbols: Mapping[str, sp.Symbol], functions: Mapping[str, Any] | None = None
) -> sp.Expr:
    """Read an expression of + - * /, whole powers, parentheses, pi, symbols and functions; decimals are exact.

    >>> a = sp.Symbol("a")
    >>> expression("weight", "0.25*(1 - a)**2/a", {"a": a})
    (1 - a)**2/(4*a)
    """
    if isinstance(text, int) and not isinstance(text, bool):
        return sp.Integer(text)
    if not isinstance(text, str):
        raise InputError(f'{what} is of type {type(text).__name__}; a string such as "1/2" is needed')
    known = {**CONSTANTS, **symbols}
    allowed = FUNCTIONS if functions is None else functions
    try:
        value = _value(_parse(text), text.strip(), known, allowed)
        if value.has(sp.nan, sp.zoo, sp.oo):
            raise _UnreadableError("it divides by zero")
        return value
    except _UnreadableError as error:
        shown = repr(text) if len(text) <= 60 else f"{text[:50]!r}..., {len(text)} characters long"
        raise InputError(f"{what} is {shown}: {error}") from None
    except RecursionError:
        raise InputError(f"{what} is nested too deeply") from None


def _parse(text: str) -> ast.expr:
    if len(text) > MOST_CHARACTERS:
        raise _UnreadableError(f"at most {MOST_CHARACTERS} characters are allowed")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)
            return ast.parse(text.strip(), mode="eval").body
    except (SyntaxError, ValueError, MemoryError):
        raise _UnreadableError('an expression such as "1 - a/2" is needed') from None


def _value(node: ast.expr, text: str, symbols: Mapping[str, Any], functions: Mapping[str, Any]) -> sp.Expr:
    """Evaluate an expression; any syntax that is not listed here is refused."""

    def inner(part: ast.expr) -> sp.Expr:
        return _value(part, text, symbols, functions)

    match node:
        case ast.Constant(value=int() | float()) if not isinstance(node.value, bool):
            return _number(ast.get_source_segment(text, node) or "")
        case ast.Name():
            if node.id not in symbols:
                names = ", ".join(sorted(symbols))
                raise _UnreadableError(f"{node.id} is not known; known are {names}")
            return symbols[node.id]
        case ast.UnaryOp(op=ast.UAdd() | ast.USub()):
            value = inner(node.operand)
            return value if isinstance(node.op, ast.UAdd) else -value
        case ast.BinOp(op=ast.Pow()):
            return _power(inner(node.left), inner(node.right))
        case ast.BinOp(op=ast.Div()):
            divisor = inner(node.right)
            if divisor == 0:
                raise _UnreadableError("it divides by zero")
            return inner(node.left) / divisor
        case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult()):
            return _OPERATIONS[type(node.op)](inner(node.left), inner(node.right))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in functions:
            try:
                return sp.sympify(functions[name](*map(inner, arguments)))
            except TypeError:
                raise _UnreadableError(f"{name} takes another number of arguments") from None
    names = ", ".join(functions)
    raise _UnreadableError(
        f"numbers, names, + - * / **, parentheses and {names or 'nothing else'} are allowed"
    )


def _number(text: str) -> sp.Expr:
    try:
        if "e" not in text.lower() or abs(int(text.lower().partition("e")[2])) <= MOST_EXPONENT:
            return sp.Rational(text)
    except (TypeError, ValueError):
        pass
    raise _UnreadableError(f"{text!r} is no decimal number with an exponent of at most {MOST_EXPONENT}")


def _power(base: sp.Expr, exponent: sp.Expr) -> sp.Expr:
    halves = 2 * exponent
    if not halves.is_Integer or abs(exponent) > MOST_EXPONENT:
        raise _UnreadableError(
            f"a power must be whole and at most {MOST_EXPONENT}; roots are written as sqrt"
        )
    if base == 0 and exponent < 0:
        raise _UnreadableError("it divides by zero")
    return base**exponent


def values_of_unknowns(
    what: str, unknowns: tuple[str, ...], values: Mapping[str, Any]
) -> dict[sp.Symbol, sp.Expr]:
    """Return the values of unknowns as exact expressions; `what` holds them, in an error message.

    >>> values_of_unknowns("this", ("a", "b"), {"a": "1 - b"})
    {a: 1 - b}
    """
    symbols = {name: sp.Symbol(name, real=True) for name in unknowns}
    chosen: dict[sp.Symbol, sp.Expr] = {}
    for name, value in values.items():
        if name not in symbols:
            raise InputError(f"{what}: {unknown('unknown', name, unknowns)}")
        number: Any = value
        if isinstance(value, str):
            number = expression(f"{what}: {name}", value, symbols, {"sqrt": sp.sqrt})
        elif isinstance(value, (Fraction, int)) and not isinstance(value, bool):
            number = exact(Fraction(value))
        elif isinstance(value, sp.Expr):
            number = value.xreplace({s: symbols[s.name] for s in value.free_symbols if s.name in symbols})
        if not isinstance(number, sp.Expr) or number.has(sp.Float) or isinstance(value, float):
            raise InputError(f"{what}: {name} is {value!r}; an exact number such as 57/80 is needed")
        if others := sorted(s.name for s in number.free_symbols if s not in symbols.values()):
            raise InputError(f"{what}: {name} is {value}, which holds {', '.join(others)}")
        chosen[symbols[name]] = number
    return chosen


def remaining_unknowns(unknowns: tuple[str, ...], chosen: Mapping[sp.Symbol, sp.Expr]) -> tuple[str, ...]:
    """Return the unknowns left after a substitution: those without a value, and those in a value."""
    replaced = {symbol.name for symbol in chosen}
    held = {symbol.name for value in chosen.values() for symbol in value.free_symbols}
    return tuple(name for name in unknowns if name not in replaced or name in held)
