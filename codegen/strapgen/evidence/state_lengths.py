"""Proves for how many steps parameters stay in their format, from the exact length of a transition.

A step multiplies Euler or Cayley-Klein parameters by p, and their length by |p|, whose square is a polynomial of the
increments that no rotation changes: two of them may be turned so that the first lies along x and the second in
the plane of x and y. What is left are three variables, whose box is cut until the bound is close to values that are
reached.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache, partial
from pathlib import Path
from typing import Any

from strapgen.evidence.actual_errors import TOOL
from strapgen.evidence.balls import ball
from strapgen.evidence.subjects import Subject
from strapgen.evidence.verdicts import Result, Verdict, verdict
from strapgen.ir.program import Program

#: Bits of balls, the share of the bound that may be lost, and boxes after which that share does not matter.
PRECISION, _CLOSE, _MOST_BOXES = 128, 0.02, 1_500
#: Dimensions of space.
_SPACE = 3
#: A box of the three variables: the ends of every side.
_Box = tuple[tuple[Fraction, Fraction], ...]


def check(subject: Subject, folder: Path) -> list[Verdict]:
    """Prove the numbers of steps for which the header says that a state stays in its format, and proper.

    Parameters
    ----------
    subject : Subject
    folder : Path
        Nothing is written there.

    Returns
    -------
    list of Verdict
        The claims "state: stays in its format" and "state: stays proper" of steps of parameters from two increments;
        of any other kernel none.
    """
    program, interface = subject.program, subject.fixed.interface
    if interface.accumulation is None or program.inputs[0].size != 4 or program.inputs[1].size != 2 * _SPACE:
        return []

    stretch = cache(lambda: stretch_of(program.transition_program(), _limit(subject)))
    claims = {"stays in its format": in_format, "stays proper": is_proper}
    return [
        verdict(subject.name, f"state: {name}", TOOL, partial(_judged, compare, subject, stretch))
        for name, compare in claims.items()
    ]


def _limit(subject: Subject) -> Fraction:
    """Return the largest element of an increment, in rad."""
    samples = subject.fixed.interface.inputs[1]
    return samples.high * samples.unit


def _judged(
    compare: Callable[[Subject, Stretch], tuple[Result, str]],
    subject: Subject,
    stretch: Callable[[], Stretch | None],
) -> tuple[Result, str]:
    bounds = stretch()
    if bounds is None:
        return "fails", "the length of a transition changes when the increments turn"
    return compare(subject, bounds)


@dataclass(frozen=True)
class Stretch:
    """Bounds of |p|^2 - 1.

    Parameters
    ----------
    low, high : Fraction
    """

    low: Fraction
    high: Fraction


def in_format(subject: Subject, stretch: Stretch) -> tuple[Result, str]:
    """Compare the number of calls until one is refused with that of the header.

    Parameters
    ----------
    subject : Subject
    stretch : Stretch
    """
    interface = subject.fixed.interface
    assert interface.accumulation is not None
    stated = interface.accumulation.calls_within(interface.settings.allowance)
    if not stated:
        return "not examined", "the header states no number of steps"
    growth = _root_above(1 + max(Fraction(0), stretch.high))
    steps = replace(interface.accumulation, growth=growth).calls_within(interface.settings.allowance)
    return (
        "proved" if steps >= stated else "fails",
        f"{steps:,} steps from a length of 1, the header states {stated:,}",
    )


def is_proper(subject: Subject, stretch: Stretch) -> tuple[Result, str]:
    """Compare the number of steps in which the state does not get too short for a bound with that of the header.

    Parameters
    ----------
    subject : Subject
    stretch : Stretch
    """
    interface = subject.fixed.interface
    angles, adds_up = interface.angle_accumulation, interface.accumulation
    if angles is None or adds_up is None or not angles.proved_steps:
        return "not examined", "the header states no number of steps"
    # A step makes the state x at least |x| |p| - r long, and r is at most r |x| / shortest.
    # The root of 1 - a is at least 1 - a/2 - a^2/2 for a up to 1.
    lack = max(Fraction(0), -stretch.low)
    lost = float(lack / 2 + lack**2 / 2 + adds_up.per_step / angles.shortest) * (1 + 1e-9)
    room = math.log(float((angles.start - adds_up.once) / (angles.shortest + adds_up.once))) * (1 - 1e-9)
    steps = math.floor(room / -math.log1p(-lost))
    stated = angles.proved_steps
    return "proved" if steps >= stated else "fails", f"{steps:,} steps, the header states {stated:,}"


def stretch_of(transition: Program, limit: Fraction) -> Stretch | None:
    """Return bounds of |p|^2 - 1 for two increments whose elements are at most a limit; None if rotations change it.

    Parameters
    ----------
    transition : Program
        Its output has four elements, and its input two vectors.
    limit : Fraction
        In rad.
    """
    from flint import Ordering, fmpq_mpoly_ctx

    whole = fmpq_mpoly_ctx.get([f"d{k}" for k in range(2 * _SPACE)], Ordering.lex)
    if not turns_alone(_excess(transition, whole.gens(), whole)):
        return None
    plane = fmpq_mpoly_ctx.get(["x", "y", "z"], Ordering.lex)
    x, y, z = plane.gens()
    zero = plane.constant(0)
    polynomial = _excess(transition, [x, zero, zero, y, z, zero], plane)
    terms = [(powers, Fraction(int(c.p), int(c.q))) for powers, c in polynomial.to_dict().items()]
    radius = _root_above(_SPACE * limit**2)
    high = largest(terms, radius)
    low = -largest([(powers, -c) for powers, c in terms], radius)
    return Stretch(low, high)


def _excess(transition: Program, increments: Any, context: Any) -> Any:
    """Return |p|^2 - 1 as a polynomial."""
    from flint import fmpq

    names = [name for signal in transition.inputs for name in signal.elements]

    def constant(value: Fraction) -> Any:
        return context.constant(fmpq(value.numerator, value.denominator))

    (elements,) = transition.run(dict(zip(names, increments, strict=True)), constant).values()
    return sum((element * element for element in elements), context.constant(-1))


def turns_alone(polynomial: Any) -> bool:
    """Tell whether no rotation of all vectors together changes a polynomial of their elements."""
    gens = polynomial.context().gens()
    for first, second in itertools.combinations(range(_SPACE), 2):
        change = 0 * gens[0]
        for vector in range(0, len(gens), _SPACE):
            a, b = vector + first, vector + second
            change += gens[a] * polynomial.derivative(b) - gens[b] * polynomial.derivative(a)
        if change != 0:
            return False
    return True


def largest(terms: list[tuple[tuple[int, ...], Fraction]], radius: Fraction) -> Fraction:
    """Return an upper bound of a polynomial for 0 <= x <= r and y^2 + z^2 <= r^2 with z >= 0.

    Parameters
    ----------
    terms : list
        Powers of x, y and z with their coefficients.
    radius : Fraction
    """
    from flint import ctx

    with ctx.workprec(PRECISION):
        coefficients = [(powers, ball(c)) for powers, c in terms]
        zero = Fraction(0)
        start: _Box = ((zero, radius), (-radius, radius), (zero, radius))
        order = itertools.count()
        pending = [(-_above(coefficients, start), next(order), start)]
        reached = 0.0
        while len(pending) < _MOST_BOXES:
            bound, _, box = heapq.heappop(pending)
            centre = tuple(((a + b) / 2,) * 2 for a, b in box)
            if _least_square(centre) <= radius**2:
                reached = max(reached, _above(coefficients, centre))
            if -bound <= reached * (1 + _CLOSE) + 1e-12:
                heapq.heappush(pending, (bound, next(order), box))
                break
            side = max(range(_SPACE), key=lambda k: box[k][1] - box[k][0])
            low, high = box[side]
            for half in ((low, (low + high) / 2), ((low + high) / 2, high)):
                part = (*box[:side], half, *box[side + 1 :])
                if _least_square(part) <= radius**2:
                    heapq.heappush(pending, (-_above(coefficients, part), next(order), part))
        return Fraction(-pending[0][0])


def _least_square(box: Any) -> Fraction:
    """Return the least y^2 + z^2 in a box."""
    return sum((min(a * a, b * b) if a * b > 0 else Fraction(0) for a, b in box[1:]), Fraction(0))


def _above(terms: list[tuple[tuple[int, ...], Any]], box: Any) -> float:
    """Return a number that is not below a polynomial anywhere in a box."""
    sides = [ball(a).union(ball(b)) for a, b in box]
    total = sum(
        (c * math.prod(side**n for side, n in zip(sides, powers, strict=True) if n) for powers, c in terms),
        ball(Fraction(0)),
    )
    return math.nextafter(float(total.upper()), math.inf)


def _root_above(value: Fraction) -> Fraction:
    """Return a number that is not below a square root."""
    scale = 1 << 120
    return Fraction(math.isqrt(math.ceil(value * scale * scale)) + 1, scale)
