"""Proves for how many steps a state stays in its format, and proper, from the exact singular values of a transition.

A step multiplies Euler or Cayley-Klein parameters by p, and their length by |p|; it stretches a matrix by no more than
the largest singular value of its transition. The squares are eigenvalues of polynomials of the increments that no
rotation changes: the longer of two increments may lie along x, and the other one in the plane of x and y. What is left
are three variables.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache, partial
from pathlib import Path
from typing import Any

from strapgen.evidence.actual_errors import TOOL
from strapgen.evidence.eigenvalues import Matrix, exact, largest, turns_alone
from strapgen.evidence.subjects import Subject
from strapgen.evidence.verdicts import Result, Verdict, verdict
from strapgen.ir.program import Program

#: Dimensions of space.
_SPACE = 3


def check(subject: Subject, folder: Path) -> list[Verdict]:
    """Prove the numbers of steps for which the header says that a state stays in its format, and proper."""
    program, interface = subject.program, subject.fixed.interface
    if interface.accumulation is None or [signal.size for signal in program.inputs[1:]] != [2 * _SPACE]:
        return []

    stretch = cache(lambda: stretch_of(program.transition_program(), _limit(subject)))
    claims = {"stays in its format": (_calls, in_format), "stays proper": (_steps, is_proper)}
    return [
        verdict(subject.name, f"state: {name}", TOOL, partial(_judged, number, compare, subject, stretch))
        for name, (number, compare) in claims.items()
    ]


def _calls(subject: Subject) -> int:
    """Return for how many calls the header says that none is refused, 0 if it does not."""
    interface = subject.fixed.interface
    return interface.accumulation.calls_within(interface.settings.allowance) if interface.accumulation else 0


def _steps(subject: Subject) -> int:
    """Return for how many steps the header says that the state stays proper, 0 if it does not."""
    angles = subject.fixed.interface.angle_accumulation
    return angles.proved_steps if angles else 0


def _limit(subject: Subject) -> Fraction:
    """Return the largest element of an increment, in rad."""
    samples = subject.fixed.interface.inputs[1]
    return samples.high * samples.unit


def _judged(
    number: Callable[[Subject], int],
    compare: Callable[[Subject, Stretch], tuple[Result, str]],
    subject: Subject,
    stretch: Callable[[], Stretch | None],
) -> tuple[Result, str]:
    if not number(subject):
        return "not examined", "the header states no number of steps"
    bounds = stretch()
    if bounds is None:
        return "fails", "a transition does not turn with its increments"
    return compare(subject, bounds)


@dataclass(frozen=True)
class Stretch:
    """Bounds of the squared singular values of a transition, less 1."""

    low: Fraction
    high: Fraction


def in_format(subject: Subject, stretch: Stretch) -> tuple[Result, str]:
    """Compare the number of calls until one is refused with that of the header."""
    interface = subject.fixed.interface
    assert interface.accumulation is not None
    stated = _calls(subject)
    growth = _root_above(1 + max(Fraction(0), stretch.high))
    steps = replace(interface.accumulation, growth=growth).calls_within(interface.settings.allowance)
    return (
        "proved" if steps >= stated else "fails",
        f"{steps:,} steps from a length of 1, the header states {stated:,}",
    )


def is_proper(subject: Subject, stretch: Stretch) -> tuple[Result, str]:
    """Compare the number of steps in which the state does not get too short for a bound with that of the header."""
    interface = subject.fixed.interface
    angles, adds_up = interface.angle_accumulation, interface.accumulation
    assert angles is not None and adds_up is not None
    # What a run adds once is twice what may be fed back; of a matrix all rows together count.
    shape = subject.program.inputs[0].shape
    fed_back = float(adds_up.once) * (math.sqrt(shape[0]) if len(shape) == 2 else 1)
    shortest, start, added = (float(x) for x in (angles.shortest, angles.start, angles.added))
    # The root of 1 - a is at least 1 - a/2 - a^2/2 for a up to 1.
    lack = max(Fraction(0), -stretch.low)
    steps = steps_between(start - fed_back, shortest, -float(lack / 2 + lack**2 / 2), -added)
    if len(shape) == 2:
        first, longest = (math.sqrt(2 - length**2) for length in (start, shortest))
        growth = float(_root_above(1 + max(Fraction(0), stretch.high)) - 1)
        steps = min(steps, steps_between(first + fed_back, longest, growth, added))
    stated = _steps(subject)
    return "proved" if steps >= stated else "fails", f"{steps:,} steps, the header states {stated:,}"


def steps_between(start: float, end: float, growth: float, added: float) -> int:
    """Return for how many steps x' = (1 + growth) x + added stays between two numbers."""
    if (end - start) * (growth + added) <= 0:
        return 0
    if not growth:
        return math.floor((end - start) / added * (1 - 1e-9))
    # From the point where a step changes nothing, -added/growth, the distance is multiplied by 1 + growth.
    stretched = math.log1p((end - start) / (start + added / growth))
    return math.floor(stretched / math.log1p(growth) * (1 - 1e-9))


def stretch_of(transition: Program, limit: Fraction) -> Stretch | None:
    """Return bounds of the eigenvalues of T T' - 1 for two increments whose elements are at most a limit.

    None stands for a transition that does not turn with its increments.

    `limit`: in rad.
    """
    from flint import Ordering, fmpq_mpoly_ctx

    whole = fmpq_mpoly_ctx.get([f"d{k}" for k in range(2 * _SPACE)], Ordering.lex)
    if not turns_alone(_excess(transition, whole.gens(), whole)):
        return None
    plane = fmpq_mpoly_ctx.get(["x", "y", "z"], Ordering.lex)
    x, y, z = plane.gens()
    radius, zero = exact(_root_above(_SPACE * limit**2)), plane.constant(0)
    longer, shorter = [radius * x, zero, zero], [radius * x * y, radius * x * z, zero]
    excess = [_excess(transition, increments, plane) for increments in (longer + shorter, shorter + longer)]
    lack = [[[-element for element in row] for row in matrix] for matrix in excess]
    return Stretch(-largest(lack), largest(excess))


def _excess(transition: Program, increments: Any, context: Any) -> Matrix:
    """Return T T' - 1 as polynomials; of a quaternion one element."""
    names = [name for signal in transition.inputs for name in signal.elements]
    (elements,) = transition.run(
        dict(zip(names, increments, strict=True)), lambda value: context.constant(exact(value))
    ).values()
    width = _SPACE if len(elements) == _SPACE**2 else len(elements)
    rows = [elements[k : k + width] for k in range(0, len(elements), width)]
    return [
        [
            sum((a * b for a, b in zip(row, other, strict=True)), context.constant(-1 if i == j else 0))
            for j, other in enumerate(rows)
        ]
        for i, row in enumerate(rows)
    ]


def _root_above(value: Fraction) -> Fraction:
    """Return a number that is not below a square root."""
    scale = 1 << 120
    return Fraction(math.isqrt(math.ceil(value * scale * scale)) + 1, scale)
