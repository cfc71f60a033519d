"""Proves for how many steps a state stays in its format, and proper, from the exact singular values of a transition.

A step multiplies Euler or Cayley-Klein parameters by p, and their length by |p|; it stretches a matrix by no more than
the largest singular value of its transition. The squares are eigenvalues of polynomials of the increments that no
rotation changes: the longer of two increments may lie along x, and the other one in the plane of x and y. What is left
are three variables.
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

import numpy as np

from strapgen.evidence.actual_errors import TOOL
from strapgen.evidence.collection import Result, Subject, Verdict, verdict
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
        verdict(subject.name, f"state: {name}", TOOL, partial(_judge, number, compare, subject, stretch))
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


def _judge(
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
    if not is_covariant(_excess(transition, whole.gens(), whole)):
        return None
    plane = fmpq_mpoly_ctx.get(["x", "y", "z"], Ordering.lex)
    x, y, z = plane.gens()
    radius, zero = to_rational(_root_above(_SPACE * limit**2)), plane.constant(0)
    longer, shorter = [radius * x, zero, zero], [radius * x * y, radius * x * z, zero]
    excess = [_excess(transition, increments, plane) for increments in (longer + shorter, shorter + longer)]
    lack = [[[-element for element in row] for row in matrix] for matrix in excess]
    return Stretch(-eigenvalue_bound(lack), eigenvalue_bound(excess))


def _excess(transition: Program, increments: Any, context: Any) -> Matrix:
    """Return T T' - 1 as polynomials; of a quaternion one element."""
    names = [name for signal in transition.inputs for name in signal.elements]
    (elements,) = transition.run(
        dict(zip(names, increments, strict=True)), lambda value: context.constant(to_rational(value))
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


#: The share of the bound that may be lost, what is lost beside it, and boxes after which neither matters.
_CLOSE, _NOTHING, _MOST_BOXES = 0.01, 1e-15, 3_000

#: A symmetric matrix of polynomials.
Matrix = list[list[Any]]
#: A box of the three variables: the ends of every side.
_Box = tuple[tuple[Fraction, Fraction], ...]


def to_rational(number: Fraction) -> Any:
    """Return a number of FLINT."""
    from flint import fmpq

    return fmpq(number.numerator, number.denominator)


def is_covariant(matrix: Matrix) -> bool:
    """Return whether rotations of all vectors rotate a symmetric matrix of polynomials, and keep one element."""
    gens = matrix[0][0].context().gens()
    size = len(matrix)
    for i, j in itertools.combinations(range(_SPACE), 2):
        turn = {(j, i): 1, (i, j): -1} if size == _SPACE else {}
        for row, column in itertools.product(range(size), repeat=2):
            polynomial, change = matrix[row][column], 0 * gens[0]
            for vector in range(0, len(gens), _SPACE):
                a, b = vector + i, vector + j
                change += gens[a] * polynomial.derivative(b) - gens[b] * polynomial.derivative(a)
            for k in range(size):
                change -= (
                    turn.get((row, k), 0) * matrix[k][column] - turn.get((k, column), 0) * matrix[row][k]
                )
            if change != 0:
                return False
    return True


def eigenvalue_bound(matrices: list[Matrix]) -> Fraction:
    """Return an upper bound of 0 and of all eigenvalues for x and z from 0 to 1, y from -1 to 1, y^2 + z^2 up to 1."""
    power = min(
        (int(powers[0]) for m in matrices for row in m for p in row for powers in p.to_dict()), default=0
    )
    quotients = [[[_divide(p, power) for p in row] for row in matrix] for matrix in matrices]
    zero, one = Fraction(0), Fraction(1)
    order, reached = itertools.count(), 0.0
    start: _Box = ((zero, one), (-one, one), (zero, one))
    pending: list[tuple[float, int, Matrix, _Box]] = []

    def examine(matrix: Matrix, box: _Box) -> None:
        nonlocal reached
        middle, above = _eigenvalues(matrix, box)
        x, y, z = ((low + high) / 2 for low, high in box)
        if y * y + z * z <= 1:
            reached = max(reached, middle * float(x) ** power)
        highest = Fraction(max(0.0, above)) * box[0][1] ** power
        heapq.heappush(pending, (-math.nextafter(float(highest), math.inf), next(order), matrix, box))

    for matrix in quotients:
        examine(matrix, start)
    while len(pending) < _MOST_BOXES and -pending[0][0] > reached * (1 + _CLOSE) + _NOTHING:
        _, _, matrix, box = heapq.heappop(pending)
        side = max(range(_SPACE), key=lambda k: box[k][1] - box[k][0])
        low, high = box[side]
        for half in ((low, (low + high) / 2), ((low + high) / 2, high)):
            part = (*box[:side], half, *box[side + 1 :])
            if _least_square(part) <= 1:
                examine(matrix, part)
    return Fraction(-pending[0][0])


def _divide(polynomial: Any, power: int) -> Any:
    """Return a polynomial divided by a power of x."""
    terms = {(n - power, *others): c for (n, *others), c in polynomial.to_dict().items()}
    return polynomial.context().from_dict(terms)


def _eigenvalues(matrix: Matrix, box: _Box) -> tuple[float, float]:
    """Return about the largest eigenvalue in the middle of a box, and a number below which all in it are.

    About the middle, a matrix is linear but for terms that are bounded one by one; the largest eigenvalue of what is
    linear is convex, and so largest at a corner.
    """
    from flint import fmpq, fmpq_mat

    ring = matrix[0][0].context()
    moved = [
        to_rational((low + high) / 2) + to_rational((high - low) / 2) * gen
        for gen, (low, high) in zip(ring.gens(), box, strict=True)
    ]
    size = len(matrix)
    upper = {(i, j): matrix[i][j].compose(*moved, ctx=ring) for i in range(size) for j in range(i, size)}
    places = [[(min(i, j), max(i, j)) for j in range(size)] for i in range(size)]

    def part(*powers: int) -> Any:
        return fmpq_mat(size, size, [upper[place][powers] for row in places for place in row])

    linear = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
    rests = {
        place: sum(map(abs, element.coeffs()), fmpq(0)) - sum(abs(element[powers]) for powers in linear)
        for place, element in upper.items()
    }
    rest = max(sum((rests[place] for place in row), fmpq(0)) for row in places)
    middle, slopes = part(0, 0, 0), [part(1, 0, 0), part(0, 1, 0), part(0, 0, 1)]
    corners = [
        sum((sign * slope for sign, slope in zip(signs, slopes, strict=True)), middle)
        for signs in itertools.product((-1, 1), repeat=_SPACE)
    ]
    return _largest_eigenvalue(middle), max(map(_above, corners)) + _round_up(rest)


def _least_square(box: _Box) -> Fraction:
    """Return the least y^2 + z^2 in a box."""
    return sum((min(a * a, b * b) if a * b > 0 else Fraction(0) for a, b in box[1:]), Fraction(0))


def _largest_eigenvalue(matrix: Any) -> float:
    """Return about the largest eigenvalue of a matrix."""
    rows = [[int(x.p) / int(x.q) for x in row] for row in matrix.tolist()]
    if len(rows) == 1:
        return rows[0][0]
    return float(np.linalg.eigvalsh(np.array(rows)).max())


def _above(matrix: Any) -> float:
    """Return a number that is above all eigenvalues."""
    about = _largest_eigenvalue(matrix)
    margin = 1e-9 * abs(about) + 1e-30
    while not _exceeds(to_rational(Fraction(about + margin)), matrix):
        margin *= 16
    return about + margin


def _exceeds(number: Any, matrix: Any) -> bool:
    """Return whether a number is above all eigenvalues: what they lack of it has positive leading minors."""
    from flint import fmpq_mat

    size = matrix.nrows()
    if size == 1:
        return bool(number > matrix[0, 0])
    lack = (fmpq_mat([[number * (i == j) for j in range(size)] for i in range(size)]) - matrix).tolist()
    minors = (fmpq_mat([row[:k] for row in lack[:k]]).det() for k in range(1, size + 1))
    return all(minor > 0 for minor in minors)


def _round_up(number: Any) -> float:
    """Return a number that is not below an exact one of 0 or more."""
    return math.nextafter(int(number.p) / int(number.q), math.inf)
