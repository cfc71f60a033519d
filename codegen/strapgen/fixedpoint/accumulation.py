"""Bounds the accumulation of rounding errors over a run.

The computed state obeys x' = x T + x d + r: T the exact transition, d the error of the computed one, r the rounding of
the state. A step stretches an error by at most the norm of T. With error feedback, what is rounded off in one step is
added in the next: then r counts once, and in every step what fed it back times T - 1; of the rounding of T, summed by
parts, only its product with T - 1 is left.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache, reduce

import numpy as np
from numpy.typing import NDArray

from strapgen.fixedpoint.integer_sums import Quantization
from strapgen.fixedpoint.intervals import Interval, norm, root
from strapgen.fixedpoint.quantities import ExactOperation, InputElement, Quantities, Sum
from strapgen.fixedpoint.series import Series, Truncated
from strapgen.ir.integer_program import IntegerSum, Value
from strapgen.ir.interfaces import Argument, RoundingAccumulation
from strapgen.ir.program import Constant, Node, Program, Reference, Result
from strapgen.kernel.bernstein import Cube, Powers, eigenvalue_bounds
from strapgen.kernel.polynomials import ONE, OPERATIONS, Polynomial, add, multiply, scale

#: Terms of the longest series that the norm of the transition is expanded in.
_MOST_TERMS = 1000


@dataclass(frozen=True)
class StepErrors:
    """The errors that one call adds to a run, element by element."""

    local: tuple[Fraction, ...]  # of the state, without those of the transition and those fed back
    transition: tuple[Fraction, ...]  # of the transition, without those fed back
    transition_feedback: tuple[Fraction, ...]  # of the transition, fed back
    state_feedback: Fraction  # of an element of the state, fed back
    away: tuple[Fraction, ...]  # distances of the transition from the identity
    moves: tuple[Fraction, ...]  # changes of the transition when increments are rounded to their format
    saturation: Fraction = Fraction(0)  # of an element of 1 in a state that saturates


def step_errors(context: Quantization, transition: Result, result: Argument) -> StepErrors | None:
    """Return the errors that a call adds to a run; None where it calls more than sums, roots, sines and cosines."""
    quantities = context.quantities
    elements = [name for name in quantities.results[transition.signal.name] if isinstance(name, str)]
    rounded = [context.values[name] for name in elements if name in context.values]
    # Where a state saturates, errors do not add up to what is fed back: it counts as any other.
    saturates = any(context.values[name].saturated for name in result.values)
    feedbacks = tuple(Fraction(0) if saturates else _feedback_rounding(context, value) for value in rounded)
    errors = (value.error - 2 * fed_back for value, fed_back in zip(rounded, feedbacks, strict=True))
    local, fed_back = _local_errors(context, elements, result, saturates)
    half_units = {argument.signal.name: argument.format.unit / 2 for argument in context.plan.inputs[1:]}
    moves = _moves(quantities, half_units)
    if moves is None:
        return None
    moved = tuple(moves[name] for name in elements)
    away = _away(context, transition)
    saturation = result.format.unit if saturates else Fraction(0)
    return StepErrors(tuple(local), tuple(errors), feedbacks, fed_back, away, moved, saturation)


def accumulation(context: Quantization, transition: Result, errors: StepErrors) -> RoundingAccumulation:
    """Return the accumulation of a step's errors over a run.

    Lengths are those of a state, or of a row of a matrix: the norm in which a transition stretches least.
    """
    quantities, state = context.quantities, context.program.inputs[0]
    width = state.size // (state.shape[0] if len(state.shape) == 2 else 1)
    length = quantities.items[state.elements[0]].range.magnitude * root(Fraction(width))
    transition_feedback, away = norm(errors.transition_feedback), norm(errors.away)
    state_feedback = errors.state_feedback * root(Fraction(width))

    per_step = max(norm(errors.local[k : k + width]) for k in range(0, len(errors.local), width))
    per_step += length * norm(errors.transition)
    once = Fraction(0)
    if errors.saturation:
        # One element of a length of 1 or less can exceed the largest number, by a unit; so can the first state.
        once, per_step = errors.saturation, per_step + errors.saturation
    elif context.settings.carry != "none":
        per_step += state_feedback * away
        once += 2 * state_feedback
    if transition_feedback:
        per_step += 2 * transition_feedback * (length * away + state_feedback)
        once += 2 * length * transition_feedback
    return RoundingAccumulation(
        once, per_step, length * norm(errors.moves), _growth(context, transition, width)
    )


def stretch(context: Quantization, transition: Result, width: int) -> Interval | None:
    """Return bounds of the squared singular values, less 1, of a transition with rows of `width`; None if unknown."""
    program, quantities = context.program, context.quantities
    if program.attitude_step is not None and program.attitude_step.isometry:
        return Interval.of(0)
    inputs = [name for signal in program.inputs[1:] for name in signal.elements]
    sizes = tuple(quantities.items[name].range.magnitude for name in inputs)
    try:
        return _proved_stretch(program, transition, sizes, width)
    except NotImplementedError:  # it calls functions
        return None


def _away(context: Quantization, transition: Result) -> tuple[Fraction, ...]:
    """Return a bound of the distance of every element of the transition from that of the identity."""
    quantities, kernels = context.quantities, context.program.attitude_step
    identity = kernels.identity if kernels is not None else ()
    distances = []
    for place, element in enumerate(quantities.results[transition.signal.name]):
        one = identity[place] if place < len(identity) else Fraction(0)
        if isinstance(element, str):
            distances.append(quantities.distance(element, one))
        else:
            distances.append(abs(element - one))
    return tuple(distances)


def _feedback_rounding(context: Quantization, value: Value) -> Fraction:
    """Return the rounding error of a value that is fed back in the next call; 0 of any other value."""
    definition = value.definition
    if not isinstance(definition, IntegerSum) or definition.residual is None:
        return Fraction(0)
    return context.rounding_error / Fraction(2) ** value.fraction


def _local_errors(
    context: Quantization, transition: Sequence[str], result: Argument, saturates: bool
) -> tuple[list[Fraction], Fraction]:
    """Return the errors of the state's elements beside those of the transition, and a bound of those fed back."""
    items, values = context.quantities.items, context.values
    local, fed_back = [], Fraction(0)
    for name in result.values:
        value, definition = values[name], items[name].definition
        through = sum(
            abs(coefficient) * context.size(factor) * values[other].error
            for monomial, coefficient in (definition.terms if isinstance(definition, Sum) else ())
            if len(monomial) == 2
            for factor, other in (monomial, monomial[::-1])
            if other in transition and factor not in transition
        )
        rounding = Fraction(0) if saturates else _feedback_rounding(context, value)
        fed_back = max(fed_back, rounding)
        local.append(value.error - through - 2 * rounding)
    return local, fed_back


def _moves(quantities: Quantities, by: Mapping[str, Fraction]) -> dict[str, Fraction] | None:
    """Return bounds of the changes of quantities when inputs, by name, change by so much; None if unknown."""
    moves: dict[str, Fraction] = {}
    for name, quantity in quantities.items.items():
        match quantity.definition:
            case InputElement(signal):
                moves[name] = by.get(signal, Fraction(0))
            case Sum() as total:
                moves[name] = _sum_move(total, quantities, moves)
                moves[name] += sum(abs(c) * moves[m[0]] for m, c in quantity.exact_addends)
            case ExactOperation("computed" | "nearest"):
                moves[name] = Fraction(0)  # within a function, whose slope tells what becomes of it
            case ExactOperation("sqrt", (str(argument),)):
                moves[name] = root(moves[argument])
            case _:
                return None
        if quantity.inherited_error is not None:
            moves[name] += quantity.inherited_error.bound(moves)
    return moves


def _sum_move(total: Sum, quantities: Quantities, moves: Mapping[str, Fraction]) -> Fraction:
    """Return a bound of the change of a sum of products."""
    move = Fraction(0)
    for monomial, coefficient in total.terms:
        if len(monomial) == 1:
            move += abs(coefficient) * moves[monomial[0]]
        elif monomial:
            a, b = (quantities.items[factor].range.magnitude for factor in monomial)
            da, db = (moves[factor] for factor in monomial)
            move += abs(coefficient) * (a * db + b * da + da * db)
    return move


def _growth(context: Quantization, transition: Result, width: int) -> Fraction:
    """Return an upper bound of the norm of any transition."""
    stretched = stretch(context, transition, width)
    if stretched is not None:
        return root(1 + stretched.highest)
    # The identity, and the length of what is added to it.
    return 1 + norm(_away(context, transition))


def transition_growth(
    program: Program, transition: Result, sizes: tuple[Fraction, ...], width: int, coarse: Fraction
) -> Fraction:
    """Return an upper bound of the norm of any transition: `coarse` if it calls functions."""
    if program.attitude_step is not None and program.attitude_step.isometry:
        return Fraction(1)
    try:
        return root(1 + _proved_stretch(program, transition, sizes, width).highest)
    except NotImplementedError:
        return coarse


@lru_cache(maxsize=64)
def _proved_stretch(
    program: Program, transition: Result, sizes: tuple[Fraction, ...], width: int
) -> Interval:
    """Return `stretch` for any word and rounding; NotImplementedError if the transition calls functions."""
    known = _expanded_stretch(program, transition, sizes, width)
    return singular_value_bounds(program, transition, sizes, width, known)


def _expanded_stretch(
    program: Program, transition: Result, sizes: tuple[Fraction, ...], width: int
) -> Fraction:
    """Return a bound of the magnitude of the eigenvalues of T T' - 1.

    The transition is expanded in its inputs to a degree at which it stays short, the rest bounded; terms that a
    rotation does not have cancel.
    """
    series = Truncated(sizes, _MOST_TERMS)
    elements = _expand(program, transition, series)
    rows = [elements[k : k + width] for k in range(0, len(elements), width)]
    one = series.constant(Fraction(1))
    largest = Fraction(0)
    for row in rows:
        total = Fraction(0)
        for other in rows:
            product = series.dot(row, other)
            total += series.size(series.less(product, one) if other is row else product)
        largest = max(largest, total)
    return largest


def _expand(program: Program, transition: Result, series: Truncated) -> list[Series]:
    """Return the elements of the transition as truncated series in the inputs."""
    inputs = [name for signal in program.inputs[1:] for name in signal.elements]
    known = {name: series.variable(place) for place, name in enumerate(inputs)}
    needed = program.used([transition])

    def value(node: Node) -> Series:
        if isinstance(node, Constant):
            return series.constant(node.value)
        if isinstance(node, Reference):
            return known[node.name]
        if node.kind not in ("negate", "add", "subtract", "multiply"):
            raise NotImplementedError(node.kind)
        operands = [value(argument) for argument in node.arguments]
        if node.kind == "negate":
            return series.less(series.constant(Fraction(0)), operands[0])
        if node.kind == "subtract":
            return series.less(*operands)
        return series.sum(*operands) if node.kind == "add" else series.product(*operands)

    for assignment in program.body:
        if assignment.name in needed:
            known[assignment.name] = value(assignment.value)
    return [value(node) for node in transition.nodes]


# Singular values of a transition, from its exact polynomials
#
# A transition T stretches a state by the roots of the eigenvalues of T T', of a quaternion by its length. Where it
# turns with its increments, a rotation of all of them leaves these values alone: the longer increment may lie along x
# and the other one in the plane of x and y. In units of the longer, the other lies in a half disc; what is left are
# three variables, on which polynomials are bounded in Bernstein form.

#: Dimensions of space, and elements of a quaternion.
_SPACE, _QUATERNION = 3, 4
#: Products of terms after which polynomials count as too long.
_MOST_PRODUCTS = 400_000
#: Vectors that three variables describe.
_MOST_VECTORS = 2
#: A square of a length that is above 1 in double is above 1.
_LONGER = 1 + 2.0**-40
#: Fraction bits of the length of an increment.
_LENGTH_BITS = 40


class _TooLongError(ValueError):
    """A transition is no polynomial, or one that is too long to bound it."""


def singular_value_bounds(
    program: Program, transition: Result, sizes: Sequence[Fraction], width: int, known: Fraction
) -> Interval:
    """Return bounds of the squared singular values of a transition, less 1, which `known` bounds already."""
    coarse = Interval.symmetric(known)
    vectors = len(sizes) // _SPACE
    parts = [signal.size % _SPACE for signal in program.inputs[1:]]
    of_one_kind = (len(transition.nodes), width) in ((_QUATERNION, _QUATERNION), (_SPACE**2, _SPACE))
    if not of_one_kind or any(parts) or not 0 < vectors <= _MOST_VECTORS:
        return coarse
    try:
        elements = _polynomials(program, transition)
    except _TooLongError:
        return coarse
    if not _turns_with_vectors(elements):
        return coarse
    lengths = [_length(sizes[k : k + _SPACE]) for k in range(0, len(sizes), _SPACE)]
    in_plane = [
        _excess(_in_plane(elements, order, lengths), width)
        for order in itertools.permutations(range(vectors))
    ]
    excess = [_in_powers(matrix, side, vectors) for matrix in in_plane for side in (1, -1)[:vectors]]
    return Interval.of(*eigenvalue_bounds(excess, _samples(vectors), known, _is_outside))


def _polynomials(program: Program, transition: Result) -> list[Polynomial]:
    """Return the elements of a transition as polynomials of (vector, axis); _TooLongError if they are none."""
    part = program.transition_program()
    names = [name for signal in program.inputs[1:] for name in signal.elements]
    left = _MOST_PRODUCTS

    def product(p: Polynomial, q: Polynomial) -> Polynomial:
        nonlocal left
        left -= len(p) * len(q)
        if left < 0:
            raise _TooLongError
        return multiply(p, q)

    try:
        (elements,) = part.run(
            {name: {(divmod(place, _SPACE),): Fraction(1)} for place, name in enumerate(names)},
            lambda value: scale(ONE, value),
            {**OPERATIONS, "multiply": product},
        ).values()
    except KeyError as error:  # an operation that is no polynomial
        raise _TooLongError from error
    return elements


def _turns_with_vectors(elements: Sequence[Polynomial]) -> bool:
    """Return whether a matrix, or a quaternion, turns with its vectors: about two axes, and so about all.

    A small turn G of the vectors must change a matrix T by G T - T G, and of a quaternion the vector part by G v.
    """
    for i, j in ((0, 1), (1, 2)):
        turned = [_turn(element, i, j) for element in elements]
        expected: list[Polynomial] = [{} for _ in elements]
        if len(elements) == _QUATERNION:
            expected[j], expected[i] = elements[i], scale(elements[j], -1)
        else:
            for k in range(_SPACE):
                for row, other, sign in ((j, i, 1), (i, j, -1)):
                    at, source = _SPACE * row + k, _SPACE * other + k
                    expected[at] = add(expected[at], elements[source], sign)
                    at, source = _SPACE * k + row, _SPACE * k + other
                    expected[at] = add(expected[at], elements[source], sign)
        if turned != expected:
            return False
    return True


def _turn(p: Polynomial, i: int, j: int) -> Polynomial:
    """Return the derivative of a polynomial when all vectors turn from axis i to axis j."""
    change: Polynomial = {}
    for monomial, coefficient in p.items():
        for place, (vector, axis) in enumerate(monomial):
            if axis in (i, j):
                other, sign = (i, 1) if axis == j else (j, -1)
                turned = tuple(sorted((*monomial[:place], (vector, other), *monomial[place + 1 :])))
                change = add(change, {turned: coefficient * sign})
    return change


def _length(elements: Sequence[Fraction]) -> Fraction:
    """Return the largest length of a vector, rounded up to few digits."""
    return Fraction(math.ceil(norm(elements) * (1 << _LENGTH_BITS)), 1 << _LENGTH_BITS)


def _in_plane(
    elements: Sequence[Polynomial], order: Sequence[int], lengths: Sequence[Fraction]
) -> list[Polynomial]:
    """Return polynomials of the coordinates 0 of the first vector along x, 1 and 2 of the second one along x and y."""
    coordinates = {
        (vector, axis): place + axis for place, vector in enumerate(order) for axis in range(place + 1)
    }
    return [
        {
            tuple(sorted(coordinates[atom] for atom in monomial)): c
            * math.prod(lengths[v] for v, _ in monomial)
            for monomial, c in element.items()
            if coordinates.keys() >= set(monomial)
        }
        for element in elements
    ]


def _excess(elements: Sequence[Polynomial], width: int) -> list[list[Polynomial]]:
    """Return T T' - 1."""
    rows = [elements[k : k + width] for k in range(0, len(elements), width)]
    upper = {
        (i, j): reduce(add, map(multiply, rows[i], rows[j]), scale(ONE, -1) if i == j else {})
        for i, j in itertools.combinations_with_replacement(range(len(rows)), 2)
    }
    return [[upper[min(i, j), max(i, j)] for j in range(len(rows))] for i in range(len(rows))]


def _in_powers(matrix: Sequence[Sequence[Polynomial]], side: int, vectors: int) -> list[list[Powers]]:
    """Return a matrix in the variables from 0 to 1: the length of the first vector, and the second in units of that."""
    return [
        [
            {
                (len(m), m.count(1), m.count(2))[: 2 * vectors - 1]: c * side ** m.count(1)
                for m, c in polynomial.items()
            }
            for polynomial in row
        ]
        for row in matrix
    ]


def _samples(vectors: int) -> NDArray[np.float64]:
    """Return points in the cube: lengths of the first vector, and points of a quarter of a disc."""
    if vectors == 1:
        return np.linspace(0, 1, 65)[:, None]
    axes = np.linspace(0, 1, 9), np.linspace(0, 1, 5), np.linspace(0, np.pi / 2, 31)
    first, second, angle = (x.ravel() for x in np.meshgrid(*axes))
    return np.stack([first, second * np.cos(angle), second * np.sin(angle)], axis=1)


def _is_outside(cube: Cube) -> bool:
    """Return whether the second vector exceeds the first anywhere in a part of the cube, in spite of rounding."""
    return sum(low * low for low, _ in cube[1:]) > _LONGER
