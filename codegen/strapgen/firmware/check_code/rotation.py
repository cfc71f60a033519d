"""Looks at the rotation that a user's function makes of one constant rate, whatever attitude it begins from."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations, permutations, product

import numpy as np
from numpy.typing import NDArray

from strapgen.firmware.check_code.foreign import (
    SENSES,
    Convention,
    ForeignStep,
    Segment,
    SegmentRun,
    rotation_vectors,
    rotations,
)
from strapgen.run.backends import evaluator

Array = NDArray[np.float64]
#: Largest angle in rad of a call, for terms of third order, and what part of it the one for those of second order is.
_LARGE, _PART = 0.2, 0.1
#: Rotations in rad that the small angle is turned from, and fewest calls that lead there.
_ATTITUDES, _CALLS = ((0, 0, 0), (0.9, 0.2, -0.4), (-0.3, 0.8, 0.7), (0.5, -1.1, 0.6)), 10
_SMALL_ABOUT = ((1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (0, 1, 1), (1, 0, 1))
_LARGE_ABOUT = ((1, 0, 0), (1, -2, 3))
#: Least coefficients of the square and of the cube of the angle that are an error; higher terms are in the latter.
_SQUARE, _CUBE = 0.01, 0.004
#: What formulas of first order turn by in place of an angle, and the words for that.
_FORMULAS = ((lambda angle: 2 * math.atan(angle / 2), "2 atan(d/2)"), (math.atan, "atan(d)"))


@dataclass(frozen=True)
class Rotation:
    """Rotation that a function computes at a constant rate."""

    #: Its error by the square and by the cube of the angle
    square: float
    cube: float
    #: Order of the whole that it allows, 3 if it is enough for a published correction
    order: int
    #: Why it is not exact
    cause: str | None

    @property
    def text(self) -> str:
        """The observation in words."""
        if self.order == 1:
            return f"a rotation by d is off by {self.square:.3g} d^2"
        if self.order == 2:
            return f"a rotation by d turns by d {'+' if self.cube > 0 else '-'} {abs(self.cube):.3g} d^3"
        return "a constant rate is turned by exactly"


def rotation_segments(step: ForeignStep) -> list[Segment]:
    """Return the segments that `rotation` needs of a function."""
    segments = []
    for attitude, vector in product(_ATTITUDES, _vectors(_SMALL_ABOUT, _PART * _large(step))):
        count = step.calls_for(float(np.linalg.norm(attitude)), _CALLS)
        before = np.array(attitude, float) / (count * step.samples)
        segments.append(_constant(step, vector, np.tile(before, (count, step.samples, 1))))
    nothing = np.zeros((0, step.samples, 3))
    large = _vectors(_LARGE_ABOUT, _large(step))
    return [*segments, *(_constant(step, vector, nothing) for vector in large)]


def _constant(step: ForeignStep, vector: Array, before: Array) -> Segment:
    """Return calls with a constant rate, so many that a memory of samples is filled by them."""
    calls = np.tile(vector / step.samples, (step.settling + 1, step.samples, 1))
    return Segment(np.concatenate([before, calls]))


def _vectors(about: Sequence[tuple[int, ...]], size: float) -> Array:
    axes = np.array(about, float)
    vectors = size * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    return np.concatenate([vectors, -vectors])


def _large(step: ForeignStep) -> float:
    """Return the large angle, at a rate that a gyro measures."""
    return min(_LARGE, step.samples * step.most)


def rotation(step: ForeignStep, convention: Convention, runs: Sequence[SegmentRun]) -> Rotation:
    """Return the rotation that a function computes at a constant rate."""
    turns = rotation_vectors(np.array([run.relative[-2].T @ run.relative[-1] for run in runs]))
    angle = _large(step)
    least = _PART * angle
    small = _vectors(_SMALL_ABOUT, least)
    vectors = np.tile(small, (len(_ATTITUDES), 1))
    errors = turns[: len(vectors)] - vectors
    square = float(np.linalg.norm(errors.reshape(-1, 2, len(small) // 2, 3).mean(axis=1), axis=-1).max())
    square /= least**2
    # What is proportional to the angle is a fault of sizes and axes; here only what is beyond it counts.
    proportional = np.linalg.lstsq(vectors, turns[: len(vectors)], rcond=None)[0]
    about = _vectors(_LARGE_ABOUT, 1.0) @ proportional
    gains = np.linalg.norm(about, axis=1)
    turned = (turns[len(vectors) :] * about).sum(axis=1) / gains
    cube = float(((turned / angle - gains) / (angle**2 - least**2)).mean())
    if square > _SQUARE + 4 * step.unit / least**2:
        states = np.array([run.states[-2] for run in runs[: len(vectors)]])
        cause = None if states.shape[1] == 3 else explanation(convention, states, vectors, errors)
        return Rotation(square, cube, 1, cause)
    rounding = 4 * step.unit / (least * angle**2)
    if abs(cube) <= _CUBE + rounding:
        return Rotation(square, cube, 3, None)
    for formula, words in _FORMULAS:
        if all(
            abs(turn - formula(gain * angle)) < (_CUBE / 2 + rounding) * angle**3
            for turn, gain in zip(turned, gains, strict=True)
        ):
            return Rotation(square, cube, 2, f"{FIRST_ORDER}: it turns by {words} in place of d")
    return Rotation(square, cube, 2, "the rotation itself is of second order")


def placement(step: ForeignStep, frame: Array, runs: Sequence[SegmentRun]) -> float:
    """Return where in a call the attitude turns with a frame: -1/2 at its start, 1/2 at its end, 0 if exactly.

    `frame` (3,): rotation vector of a call without rotation of the body, reference axes. `runs`: of the segments of
    `rotation`, as they would be in a resting frame. What the product of the two rotations adds tells them apart.
    """
    small = len(_ATTITUDES) * 2 * len(_SMALL_ABOUT)
    seen = size = 0.0
    for run, vector in zip(runs[small:], _vectors(_LARGE_ABOUT, _large(step)), strict=True):
        before = run.start @ run.relative[-2]
        product_of_both = np.cross(before.T @ frame, vector)
        seen += float(rotation_vectors(run.relative[-2].T @ run.relative[-1]) @ product_of_both)
        size += float(product_of_both @ product_of_both)
    return seen / size


FIRST_ORDER = "the rotation itself is of first order"
IN_PLACE = "of the result read in place of that of the argument (update in place)"

#: Largest part of the errors that an explanation may leave, and of the difference of two that are equally good.
_UNEXPLAINED, _AS_GOOD = 0.02, 0.002
#: Terms of the exponential of a rotation: all that counts, and those of a formula of first order.
_EXACT, _FIRST = 6, 1


@dataclass(frozen=True)
class _Reads:
    """Pairs of elements (k, j) where k reads j of the result, and the order in which the elements are computed."""

    pairs: frozenset[tuple[int, int]] = frozenset()
    downwards: bool = False

    @property
    def read(self) -> frozenset[int]:
        return frozenset(j for _, j in self.pairs)


@dataclass(frozen=True)
class _Explanation:
    """A way to compute a rotation, and the part of the errors that it leaves."""

    terms: int
    reads: _Reads
    nearest: bool
    rest: float

    @property
    def of_first_order(self) -> bool:
        """Whether the formula counts: what makes a matrix orthogonal evenly undoes its error."""
        return self.terms == _FIRST and not self.nearest


def explanation(convention: Convention, states: Array, vectors: Array, errors: Array) -> str | None:
    """Return the cause of errors of rotations.

    `states` (N, 4): the states before the rotations. `vectors, errors` (N, 3): the true rotation vectors, and
    the differences from these, in body axes.
    """
    ranked = sorted(_explanations(convention, states, vectors, errors), key=lambda each: each.rest)
    best = ranked[0]
    if best.rest > _UNEXPLAINED:
        return None
    as_good = [each for each in ranked if each.rest < best.rest + _AS_GOOD]
    if any(not each.reads.pairs for each in as_good):
        return FIRST_ORDER
    surely = sorted(best.reads.read.intersection(*(each.reads.read for each in as_good)))
    if not surely:
        words = f"an element {IN_PLACE}"
    elif len(surely) == 1:
        words = f"{_names(surely, states.shape[1])} {IN_PLACE}"
    else:
        words = f"{_names(surely, states.shape[1])} {IN_PLACE.replace('that of', 'those of')}"
    return f"{words}; {FIRST_ORDER}" if all(each.of_first_order for each in as_good) else words


def _names(elements: list[int], count: int) -> str:
    """Return the names of elements of a result with so many."""
    if count == 4:
        return f"element{'s' if len(elements) > 1 else ''} {', '.join(map(str, elements))}"
    places = [divmod(element, 3) for element in elements]
    for what, lines in (("column", {column for _, column in places}), ("row", {row for row, _ in places})):
        if len(elements) == 3 * len(lines):
            return f"{what}{'s' if len(lines) > 1 else ''} {', '.join(map(str, sorted(lines)))}"
    return f"element{'s' if len(elements) > 1 else ''} {', '.join(f'[{i}][{j}]' for i, j in places)}"


def _explanations(
    convention: Convention, states: Array, vectors: Array, errors: Array
) -> Iterator[_Explanation]:
    """Yield all explanations."""
    elements = states.shape[1]
    generators = np.array([_generator(convention, elements, vector) for vector in vectors])
    true = rotations(vectors)
    before = np.swapaxes(convention.matrices(states), -1, -2)
    size = np.linalg.norm(errors)
    for terms in (_EXACT, _FIRST):
        transitions = _exponential(generators, terms)
        for reads in _possible_reads(convention, elements, np.abs(generators).max(axis=0) > 0):
            after = _replace(transitions, states, reads)
            for number, repair in enumerate(_orthogonal(elements)):
                turned = before @ convention.matrices(repair(after))
                off = rotation_vectors(np.swapaxes(true, -1, -2) @ turned)
                yield _Explanation(terms, reads, number == 0, float(np.linalg.norm(errors - off) / size))


def _generator(convention: Convention, elements: int, vector: Array) -> Array:
    """Return the matrix that a state is multiplied by in a rotation by a small vector, less the identity."""
    forward = convention.sense == SENSES[0]
    basis = np.eye(elements)
    if elements == 9:
        cross = np.cross(vector, np.eye(3)).T
        moved = basis.reshape(-1, 3, 3) @ cross if forward else -cross @ basis.reshape(-1, 3, 3)
        return moved.reshape(elements, elements).T
    turn = np.append(vector / 2, 0.0)
    turns, ours = np.tile(turn if forward else -turn, (elements, 1)), convention.ours(basis)
    moved = evaluator("euler-product")(ours, turns) if forward else evaluator("euler-product")(turns, ours)
    matrix: Array = (moved if convention.scalar == "last" else np.roll(moved, 1, axis=-1)).T
    return matrix


def _exponential(generators: Array, terms: int) -> Array:
    """Return the first terms of the exponential of matrices (N, E, E)."""
    power = total = np.broadcast_to(np.eye(generators.shape[1]), generators.shape)
    for number in range(1, terms + 1):
        power = power @ generators / number
        total = total + power
    return total


def _replace(transitions: Array, states: Array, reads: _Reads) -> Array:
    """Return states (N, E) after an update in place whose elements read elements replaced before."""
    after = states.copy()
    elements = range(states.shape[1])
    for k in reversed(elements) if reads.downwards else elements:
        sources = [after[:, j] if (k, j) in reads.pairs else states[:, j] for j in elements]
        after[:, k] = np.einsum("nj,jn->n", transitions[:, k], np.array(sources))
    return after


def _possible_reads(convention: Convention, elements: int, needed: Array) -> Iterator[_Reads]:
    """Yield the elements that an update in place may read too late.

    That is nothing, or one element in one place, or some elements wherever they are read once they have been replaced.
    """
    yield _Reads()
    pairs = [(int(k), int(j)) for k, j in zip(*np.nonzero(needed), strict=True) if k != j]
    yield from (_Reads(frozenset({pair}), pair[0] < pair[1]) for pair in pairs)
    by_column = convention.sense == SENSES[0]

    def rank(element: int) -> int:
        if elements == 4:
            return element
        return element % 3 if by_column else element // 3

    count = elements if elements == 4 else 3
    for downwards, size in product((False, True), range(1, count)):
        for late in combinations(range(count), size):
            reads = [(k, j) for k, j in pairs if rank(j) in late and (rank(j) < rank(k)) != downwards]
            if len(reads) > 1:
                yield _Reads(frozenset(reads), downwards)


def _orthogonal(elements: int) -> Iterator[Callable[[Array], Array]]:
    """Yield the orthogonalizations of states; the first one, none, stands for the nearest rotation."""
    yield lambda states: states
    for by_rows in (True, False) if elements == 9 else ():
        for order in permutations(range(3)):
            yield partial(_made_orthogonal, partial(_one_by_one, order), by_rows)
        for pair in combinations(range(3), 2):
            yield partial(_made_orthogonal, partial(_by_pair, pair), by_rows)


def _made_orthogonal(repair: Callable[[Array], None], by_rows: bool, states: Array) -> Array:
    """Return matrices (N, 9) whose rows, or columns, are made orthogonal in place."""
    matrices = states.reshape(-1, 3, 3)
    rows = np.array(matrices if by_rows else np.swapaxes(matrices, -1, -2))
    repair(rows)
    return (rows if by_rows else np.swapaxes(rows, -1, -2)).reshape(-1, 9)


def _one_by_one(order: tuple[int, ...], rows: Array) -> None:
    """Make rows orthogonal one after the other (Gram-Schmidt)."""
    for number, k in enumerate(order):
        for j in order[:number]:
            rows[:, k] -= (rows[:, k] * rows[:, j]).sum(axis=-1, keepdims=True) * rows[:, j]
        rows[:, k] /= np.linalg.norm(rows[:, k], axis=-1, keepdims=True)


def _by_pair(pair: tuple[int, int], rows: Array) -> None:
    """Make two rows orthogonal, evenly, and the third their cross product."""
    first, second = rows[:, pair[0]].copy(), rows[:, pair[1]].copy()
    half = (first * second).sum(axis=-1, keepdims=True) / 2
    for k, row in ((pair[0], first - half * second), (pair[1], second - half * first)):
        rows[:, k] = row / np.linalg.norm(row, axis=-1, keepdims=True)
    third = 3 - sum(pair)
    rows[:, third] = np.cross(rows[:, (third + 1) % 3], rows[:, (third + 2) % 3])
