"""Returns the rates of the catalogue's motions and their derivatives, as polynomials for the coefficients of series."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import sympy as sp

from strapgen import catalogue
from strapgen.catalogue.kernels.motion_models import MOTIONS, MotionModel

#: Time at the beginning of a step.
TIME = sp.Symbol("t")
#: From this denominator on a fraction is taken for a decimal.
_LONG = 10**15
#: Symbols of the parameters of the motion "constant" in series.
CONSTANT = sp.symbols("w_x w_y w_z")


@dataclass(frozen=True)
class MotionRate:
    """The rate of a motion in a ring.

    Parameters
    ----------
    ring : PolyRing
    derivatives : list of list of ring element
        The rate and its derivatives at the beginning of a step.
    expression : callable
        ``expression(element)`` returns a ring element as an expression in the motion's parameters and the time.
    """

    ring: Any
    derivatives: list[list[Any]]
    expression: Callable[[Any], sp.Expr]


def parameters(motion: str) -> tuple[sp.Symbol, ...]:
    """Return the symbols of a motion's parameters."""
    return CONSTANT if motion == "constant" else tuple(map(sp.Symbol, catalogue.MOTIONS[motion]))


def model(motion: str) -> MotionModel:
    """Return the closed form of a motion."""
    return MOTIONS[motion]


def at_time(motion: str, count: int, domain: Any = sp.QQ) -> MotionRate:
    """Return the rate of a motion and its derivatives at time t.

    Parameters
    ----------
    motion : str
    count : int
        Number of derivatives, counting the rate itself.
    domain : Domain, optional
        Field of the numbers.

    Returns
    -------
    MotionRate
    """
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

    def expression(element: Any) -> sp.Expr:
        # Squares of sines are replaced by cosines, so that equal expressions cancel.
        reduced = element if unity is None else element.rem([unity])
        return _factored(reduced).subs(back)

    return MotionRate(ring, rate, expression)


def at_start(motion: str, count: int, domain: Any = sp.QQ) -> MotionRate:
    """Return the rate of a motion and its derivatives at time 0, where no sines and cosines are left.

    Parameters
    ----------
    motion : str
    count : int
        Number of derivatives, counting the rate itself.
    domain : Domain, optional
        Field of the numbers.

    Returns
    -------
    MotionRate
    """
    symbols = parameters(motion)
    ring, *_ = sp.ring(symbols, domain)
    vector = MOTIONS[motion].rate(TIME, *symbols)
    rate = []
    for _ in range(count):
        rate.append([ring.from_expr(sp.expand(element.subs(TIME, 0))) for element in vector])
        vector = vector.diff(TIME)
    return MotionRate(ring, rate, _factored)


def _polynomial(count: int, domain: Any) -> MotionRate:
    """Return the rate about one axis, with symbols for its derivatives, since expanded products would get too long."""
    symbols = parameters("polynomial")
    (_, rate, _) = MOTIONS["polynomial"].rate(TIME, *symbols)
    ring, *r = sp.ring([f"r{j}" for j in range(min(count, len(symbols)))], domain)  # the others are zero
    meant = {sp.Symbol(f"r{j}"): sp.diff(rate, TIME, j) for j in range(len(r))}
    return MotionRate(
        ring, [[ring.zero, one, ring.zero] for one in r], lambda element: _factored(element).subs(meant)
    )


def _factored(element: Any) -> sp.Expr:
    """Return a ring element as an expression, factored if its numbers are short fractions."""
    expression = element.as_expr()
    return sp.factor(expression) if is_plain(expression) else expression


def is_plain(expression: sp.Expr) -> bool:
    """Return whether all numbers of an expression are fractions of whole numbers, and none a root or a long decimal.

    Only such expressions are factored: with other numbers it takes long and makes them no shorter.
    """
    numbers = (x for x in sp.preorder_traversal(expression) if x.is_number)
    return all(x.is_Rational and x.q < _LONG for x in numbers if not x.is_Integer)
