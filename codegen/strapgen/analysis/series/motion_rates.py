"""Returns the rates of the catalogue's motions and their derivatives, as polynomials for the coefficients of series."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import sympy as sp

from strapgen import catalogue
from strapgen.catalogue.kernels.motion_models import MOTIONS, MotionModel
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.lab.motions.motion_names import is_file
from strapgen.lab.motions.rate_expressions import time_symbol

#: Time at the beginning of a step.
TIME = sp.Symbol("t")
#: From this denominator on a fraction is taken for a decimal.
_LONG = 10**15
#: Magnitude below which a value in 40 digits counts as zero.
_ZERO = sp.Rational(1, 10**30)
#: Times in s at which a value is looked at.
_TIMES = (sp.Rational(3, 7), sp.Rational(11, 9))
#: Symbols of the parameters of the motion "constant" in series.
CONSTANT = sp.symbols("w_x w_y w_z")


@dataclass(frozen=True)
class MotionRate:
    """The rate of a motion in a ring."""

    ring: Any
    #: The rate and its derivatives at the beginning of a step
    derivatives: list[list[Any]]
    #: ``expression(element)`` returns a ring element as an expression in the motion's parameters and the time
    expression: Callable[[Any], sp.Expr]
    #: ``reduced(element)`` returns a ring element in which squares of sines are replaced by cosines
    reduced: Callable[[Any], Any]
    #: ``expanded(element)`` returns what `expression` does without factoring it, which takes long
    expanded: Callable[[Any], sp.Expr]
    #: Time derivatives of the generators of the ring that change with time
    changes: Mapping[Any, Any]

    def derivative(self, element: Any) -> Any:
        """Return the time derivative of a ring element."""
        return sum(
            (element.diff(generator) * change for generator, change in self.changes.items()), self.ring.zero
        )


@contextmanager
def in_powers_of_the_step(kernel: str) -> Iterator[None]:
    """Refuse a kernel, by its name, that has no series in the step length."""
    try:
        yield
    except ArithmeticError as error:
        raise InputError(f"kernel {kernel} has no series in the step length: {error}") from None


def require(motion: str) -> None:
    """Refuse a motion that is neither general, nor of the catalogue, nor a user's file."""
    if not is_file(motion):
        checks.choice("motion", motion, ("general", *catalogue.MOTIONS), "a Python file")


def of_file(motion: str, count: int) -> Callable[[sp.Expr], sp.Expr]:
    """Return a function that replaces the derivatives of a general rate by those of a user's expressions."""
    from strapgen.lab.motions.users_motions import rate_expressions  # numpy checks what a file says

    vector = sp.Matrix(list(rate_expressions(motion)))
    derivatives: dict[sp.Symbol, sp.Expr] = {}
    for j in range(count):
        derivatives |= {sp.Symbol(f"w{j}_{axis}"): x for axis, x in zip("xyz", vector, strict=True)}
        vector = vector.diff(time_symbol())
    moments = [
        {symbol: sp.N(x.subs(time_symbol(), time), 60) for symbol, x in derivatives.items()}
        for time in _TIMES
    ]

    def inserted(expression: sp.Expr) -> sp.Expr:
        if all(abs(sp.expand(expression).xreplace(values)) < _ZERO for values in moments):
            return sp.S.Zero
        return expression.xreplace(derivatives).xreplace({time_symbol(): TIME})

    return inserted


def parameters(motion: str) -> tuple[sp.Symbol, ...]:
    """Return the symbols of a motion's parameters."""
    return CONSTANT if motion == "constant" else tuple(map(sp.Symbol, catalogue.MOTIONS[motion]))


def model(motion: str) -> MotionModel:
    """Return the closed form of a motion."""
    return MOTIONS[motion]


def at_time(motion: str, count: int, domain: Any = sp.QQ) -> MotionRate:
    """Return the rate of a motion and its derivatives at time t."""
    if motion == "polynomial":
        return _polynomial(count, domain)
    symbols = parameters(motion)
    cosine, sine = sp.symbols("cosine sine")
    frequency = next((p for p in symbols if p.name == "b"), None)
    waves = {} if frequency is None else {sp.cos(frequency * TIME): cosine, sp.sin(frequency * TIME): sine}
    ring, *_ = sp.ring([*reversed(waves.values()), *symbols], domain)
    vector = MOTIONS[motion].rate(TIME, *symbols)
    rate: list[list[Any]] = []
    while len(rate) < count and any(vector):
        rate.append([ring.from_expr(sp.expand(element).subs(waves)) for element in vector])
        vector = vector.diff(TIME)
    unity = ring.from_expr(cosine**2 + sine**2 - 1) if waves else None
    back = {wave: function for function, wave in waves.items()}
    if not (domain.is_QQ or domain.is_Algebraic):  # unknowns of the kernel may have the names of parameters
        names = {symbol.name for symbol in domain.symbols}
        shown = {p: sp.Symbol(f"{motion}_{p.name}") for p in symbols if p.name in names}
        back = {wave: function.xreplace(shown) for wave, function in back.items()} | shown

    def reduced(element: Any) -> Any:
        # Without squares of sines equal expressions cancel.
        return element if unity is None else element.rem([unity])

    changes = {}
    if frequency is not None:
        b, c, s = (ring.from_expr(symbol) for symbol in (frequency, cosine, sine))
        changes = {c: -b * s, s: b * c}
    return MotionRate(
        ring,
        rate,
        lambda element: _factor(reduced(element)).subs(back),
        reduced,
        lambda element: sp.expand(element.as_expr().subs(back)),
        changes,
    )


def at_start(motion: str, count: int, domain: Any = sp.QQ) -> MotionRate:
    """Return the rate of a motion and its derivatives at time 0, where no sines and cosines are left."""
    symbols = parameters(motion)
    ring, *_ = sp.ring(symbols, domain)
    vector = MOTIONS[motion].rate(TIME, *symbols)
    rate = []
    for _ in range(count):
        rate.append([ring.from_expr(sp.expand(element.subs(TIME, 0))) for element in vector])
        vector = vector.diff(TIME)
    return MotionRate(ring, rate, _factor, _identity, lambda element: sp.expand(element.as_expr()), {})


def _polynomial(count: int, domain: Any) -> MotionRate:
    """Return the rate about one axis with symbols for its derivatives; expanded products would be too long."""
    symbols = parameters("polynomial")
    (_, rate, _) = MOTIONS["polynomial"].rate(TIME, *symbols)
    ring, *r = sp.ring([f"r{j}" for j in range(min(count, len(symbols)))], domain)  # the others are zero
    meant = {sp.Symbol(f"r{j}"): sp.diff(rate, TIME, j) for j in range(len(r))}
    times = sp.ring([TIME, *symbols], domain)[0]
    inserted = [times.from_expr(sp.expand(meaning)) for meaning in meant.values()]

    def expanded(element: Any) -> sp.Expr:
        total = times.zero
        for exponents, number in element.terms():
            term = times.ground_new(number)
            for meaning, exponent in zip(inserted, exponents, strict=True):
                term = term * meaning**exponent
            total = total + term
        # With rational numbers it is expanded already.
        return total.as_expr() if domain == sp.QQ else sp.expand(total.as_expr())

    return MotionRate(
        ring,
        [[ring.zero, one, ring.zero] for one in r],
        lambda element: _factor(element).subs(meant),
        _identity,
        expanded,
        dict(zip(r, [*r[1:], ring.zero], strict=True)),
    )


def _identity(element: Any) -> Any:
    return element


def _factor(element: Any) -> sp.Expr:
    """Return a ring element as an expression, factored if its numbers are short fractions."""
    expression = element.as_expr()
    return sp.factor(expression) if is_plain(expression) else expression


def is_plain(expression: sp.Expr) -> bool:
    """Return whether all numbers of an expression are fractions of whole numbers, and none a root or a long decimal.

    Only such expressions are factored: with other numbers it takes long and makes them no shorter.
    """
    numbers = (x for x in sp.preorder_traversal(expression) if x.is_number)
    return all(x.is_Rational and x.q < _LONG for x in numbers if not x.is_Integer)
