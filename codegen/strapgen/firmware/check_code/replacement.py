"""Explains rotations that err with the square of their angle: by a formula of first order, or by an update in place.

An update in place reads an element of the result where that of the argument is due. Each explanation is computed as the
function would do it, and named if it reproduces the errors at several attitudes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import combinations, permutations, product

import numpy as np
from numpy.typing import NDArray

from strapgen.firmware.check_code.runs import SENSES, Convention, rotation_vectors
from strapgen.run.backends import evaluator

Array = NDArray[np.float64]

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
    true = evaluator("dcm-update")(np.broadcast_to(np.eye(3), (len(vectors), 3, 3)), vectors)
    before = np.swapaxes(convention.matrices(states), -1, -2)
    size = np.linalg.norm(errors)
    for terms in (_EXACT, _FIRST):
        transitions = _exponential(generators, terms)
        for reads in _possible_reads(convention, elements, np.abs(generators).max(axis=0) > 0):
            after = _replaced(transitions, states, reads)
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


def _replaced(transitions: Array, states: Array, reads: _Reads) -> Array:
    """Return states (N, E) after an update whose elements read what is replaced already."""
    after = states.copy()
    elements = range(states.shape[1])
    for k in reversed(elements) if reads.downwards else elements:
        sources = [after[:, j] if (k, j) in reads.pairs else states[:, j] for j in elements]
        after[:, k] = np.einsum("nj,jn->n", transitions[:, k], np.array(sources))
    return after


def _possible_reads(convention: Convention, elements: int, needed: Array) -> Iterator[_Reads]:
    """Yield what an update in place may read too late.

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
    """Yield what makes states rotations again: nothing, which stands for the nearest one, first."""
    yield lambda states: states
    if elements == 9:
        for by_rows in (True, False):
            for order in permutations(range(3)):
                yield partial(_one_by_one, order=order, by_rows=by_rows)
            for pair in combinations(range(3), 2):
                yield partial(_by_pair, pair=pair, by_rows=by_rows)


def _rows(states: Array, by_rows: bool) -> Array:
    matrices = states.reshape(-1, 3, 3)
    return np.array(matrices if by_rows else np.swapaxes(matrices, -1, -2))


def _states(matrices: Array, by_rows: bool) -> Array:
    return (matrices if by_rows else np.swapaxes(matrices, -1, -2)).reshape(-1, 9)


def _one_by_one(states: Array, order: tuple[int, ...], by_rows: bool) -> Array:
    """Make rows or columns orthogonal one after the other (Gram-Schmidt)."""
    rows = _rows(states, by_rows)
    for number, k in enumerate(order):
        for j in order[:number]:
            rows[:, k] -= (rows[:, k] * rows[:, j]).sum(axis=-1, keepdims=True) * rows[:, j]
        rows[:, k] /= np.linalg.norm(rows[:, k], axis=-1, keepdims=True)
    return _states(rows, by_rows)


def _by_pair(states: Array, pair: tuple[int, int], by_rows: bool) -> Array:
    """Make two rows or columns orthogonal, evenly, and the third their cross product."""
    rows = _rows(states, by_rows)
    first, second = rows[:, pair[0]].copy(), rows[:, pair[1]].copy()
    half = (first * second).sum(axis=-1, keepdims=True) / 2
    for k, row in ((pair[0], first - half * second), (pair[1], second - half * first)):
        rows[:, k] = row / np.linalg.norm(row, axis=-1, keepdims=True)
    third = 3 - sum(pair)
    rows[:, third] = np.cross(rows[:, (third + 1) % 3], rows[:, (third + 2) % 3])
    return _states(rows, by_rows)
