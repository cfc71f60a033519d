"""Derives sums of products, which `DerivationContext` collects with their proved ranges and sample values."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from strapgen.fixedpoint.intervals import Interval
from strapgen.fixedpoint.quantities import (
    Definition,
    InputElement,
    Monomial,
    Operand,
    Quantities,
    Quantity,
    Sum,
    Terms,
    combined,
    is_dyadic,
    is_power_of_two,
    scaled,
    used_by,
)
from strapgen.fixedpoint.ranges import Ranges
from strapgen.ir.program import RESOLUTION, Constant, Node, Operation, Program, Reference
from strapgen.ir.signals import Signal

#: Number of sample inputs. They hint where a range may be narrower than proved; no proof rests on them.
_COUNT = 500

#: Values of quantities on sample inputs, by name; the key "" holds the numbers of the samples.
Samples = dict[str, NDArray[np.float64]]


@dataclass
class DerivationContext:
    """The state of a walk over a program."""

    program: Program
    split: bool  # whether what differs little from an exact sum of inputs is stored as its distance from that
    word: int  # bits
    #: Makes the quantity of an operation that is no sum of products, from its name, the operation and the meaning.
    derive_operation: Callable[[DerivationContext, str, Operation, str], None]
    quantities: Quantities  # those derived so far
    ranges: Ranges
    proper: Samples  # values of the quantities on proper inputs
    anywhere: Samples  # the same anywhere in the ranges of the inputs
    outputs: frozenset[str]  # assignments that hold elements of results
    #: Links of functions: equal ones are stored once.
    same: dict[Definition, str] = field(default_factory=dict)
    #: Quantities of which another one is the word, times 1 or -1.
    same_words: dict[str, tuple[str, Fraction]] = field(default_factory=dict)
    items: dict[str, Quantity] = field(init=False)  # those of `quantities`
    assigned: frozenset[str] = field(init=False)  # names of all assignments of the program

    def __post_init__(self) -> None:
        self.items = self.quantities.items
        self.assigned = frozenset(assignment.name for assignment in self.program.body)


def note_samples(context: DerivationContext, name: str, evaluate: Callable[[Samples], Any]) -> None:
    """Keep the values of a quantity on both sets of samples."""
    context.proper[name] = evaluate(context.proper)
    context.anywhere[name] = evaluate(context.anywhere)


def sampled(operand: Operand, values: Samples) -> Any:
    """Return the values of a quantity, or a constant, on samples."""
    return float(operand) if isinstance(operand, Fraction) else values[operand]


def range_of(context: DerivationContext, operand: Operand) -> Interval:
    """Return the proved range of a quantity or a constant."""
    return Interval.of(operand) if isinstance(operand, Fraction) else context.items[operand].range


def free_name(context: DerivationContext, name: str) -> str:
    """Return the name, or the name with a number behind it, whichever is free."""
    candidates = (name if number == 1 else f"{name}_{number}" for number in count(1))
    return next(
        candidate
        for candidate in candidates
        if candidate not in context.items and candidate not in context.assigned
    )


def stored_terms(context: DerivationContext, name: str) -> Terms:
    """Return a quantity, its offset included, as a sum of stored quantities."""
    quantity = context.items[name]
    definition = quantity.definition
    if (
        isinstance(definition, Sum)
        and not quantity.approximation_error
        and not any(m for m, _ in definition.terms)
    ):
        constant = quantity.offset + sum((c for _, c in definition.terms), Fraction(0))
        return {(): constant} if constant else {}
    offset: Terms = {(): quantity.offset} if quantity.offset else {}
    word, sign = context.same_words.get(name, (name, Fraction(1)))
    return offset | dict(quantity.exact_addends) | {(word,): sign}


def samples(
    signals: Sequence[Signal], ranges: Mapping[str, Interval]
) -> tuple[dict[str, NDArray[np.float64]], dict[str, NDArray[np.float64]]]:
    """Return values of every input element: on proper inputs, and anywhere in their ranges.

    Proper inputs meet the constraint of their signal: vectors of length 1 and rotations. The others lie at the corners
    of the box, on its edges and inside. The key "" holds the numbers of the samples.
    """
    rng = np.random.default_rng(0)
    numbers = np.arange(_COUNT, dtype=np.float64)
    proper: dict[str, NDArray[np.float64]] = {"": numbers}
    anywhere: dict[str, NDArray[np.float64]] = {"": numbers}
    for signal in signals:
        low = np.array([float(ranges[name].lowest) for name in signal.elements])
        high = np.array([float(ranges[name].highest) for name in signal.elements])
        part = rng.random((_COUNT, signal.size))
        part[: _COUNT // 2] = part[: _COUNT // 2].round()
        part[_COUNT // 2 : _COUNT * 3 // 4] = (2 * part[_COUNT // 2 : _COUNT * 3 // 4]).round() / 2
        box = low + part * (high - low)
        inside = box
        if signal.constraint:
            # Turns by quarters and corners first, where the extremes are, then random ones.
            vectors = rng.normal(size=(_COUNT, 4))
            vectors[:200] = vectors[:200].round()
            if signal.constraint == "rotation":
                unit = _of_length_one(vectors)
                v, s = unit[:, :3], unit[:, 3:, None]
                skew = np.cross(np.eye(3), v[:, None, :])
                rotation = np.eye(3) * (2 * s**2 - 1) + 2 * v[:, :, None] * v[:, None, :] - 2 * s * skew
                inside = rotation.reshape(_COUNT, 9)
            else:
                inside = _of_length_one(vectors[:, : signal.size]) if signal.size <= 4 else box
        for k, name in enumerate(signal.elements):
            proper[name], anywhere[name] = inside[:, k], box[:, k]
    assert all(math.isfinite(float(values.max())) for values in anywhere.values())
    return proper, anywhere


def _of_length_one(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return vectors divided by their lengths; the last axis stands for a vector of zeros."""
    vectors = vectors.copy()
    vectors[~vectors.any(axis=1), -1] = 1
    unit: NDArray[np.float64] = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return unit


#: Operations that a sum of products is made of.
SUM_OPERATIONS = ("add", "subtract", "negate", "multiply")
#: An offset leaves at most this part of itself to be stored, so that one bit or more is gained.
_SMALL = Fraction(1, 2)
#: What is put behind the name of a value for an operation inside it.
_SUFFIXES = {
    "divide": "quotient",
    "sqrt": "root",
    "maximum": "largest",
    "select": "choice",
    "sin": "sine",
    "cos": "cosine",
    "sinc": "sinc",
    "atan2": "angle",
    "direction": "angle",
    "wrap": "principal",
}


def terms_of(context: DerivationContext, node: Node, name: str) -> Terms:
    """Return a node as a sum over products of at most two stored quantities; `name` begins the names of new ones."""
    if isinstance(node, Constant):
        return {(): node.value} if node.value else {}
    if isinstance(node, Reference):
        if node.name == RESOLUTION:  # that of a word which holds an attitude
            return {(): Fraction(1, 1 << (context.word - 2))}
        return stored_terms(context, node.name)
    if node.kind not in SUM_OPERATIONS:
        inner = free_name(context, f"{stem(name)}_{_SUFFIXES[node.kind]}")
        context.derive_operation(context, inner, node, "")
        return stored_terms(context, inner)
    operands = [terms_of(context, argument, name) for argument in node.arguments]
    if node.kind == "negate":
        return scaled(operands[0], Fraction(-1))
    left, right = operands
    if node.kind == "multiply":
        return _product(context, left, right, name)
    return combined(left, right, Fraction(1 if node.kind == "add" else -1))


def operand_of(context: DerivationContext, node: Node, name: str) -> Operand:
    """Return a constant, or the name of a quantity that is stored whole."""
    terms = terms_of(context, node, name)
    if set(terms) <= {()}:
        return terms.get((), Fraction(0))
    if len(terms) == 1:
        ((monomial, coefficient),) = terms.items()
        if len(monomial) == 1 and coefficient == 1:
            return monomial[0]
    return store_temporary(context, name, terms)


def store_temporary(context: DerivationContext, name: str, terms: Terms) -> str:
    """Store a sum whole under a free name like this one, and return that name."""
    free = free_name(context, name)
    store(context, free, terms, whole=True)
    return free


def store(
    context: DerivationContext, name: str, terms: Terms, meaning: str = "", whole: bool = False
) -> None:
    """Store a sum: whole, or as its distance from a constant or from inputs that it stays near."""
    terms = _with_plain_products(context, name, terms)
    constant = terms.get((), Fraction(0))
    rest = {monomial: c for monomial, c in terms.items() if monomial}
    offset = Fraction(0)
    if constant and not whole and is_dyadic(constant):
        spread = context.ranges.enclosure(rest.items()).magnitude
        if spread <= abs(constant) * _SMALL:
            offset = constant
    exact_addends: Terms = {}
    if context.split and not whole and not (constant and not offset):
        exact_addends, rest = _split(context, rest)
    if constant and not offset:
        rest[()] = constant
    if offset and len(rest) == 1:
        rest = _of_same_word(context, name, rest)
    note_samples(context, name, lambda values: _evaluate(rest, values))
    seen = float(np.nan_to_num(np.abs(context.anywhere[name]), posinf=0).max()) or 1e-300
    enclosure = context.ranges.of_sum(name, rest, seen)
    definition = Sum(tuple(rest.items()))
    context.items[name] = Quantity(
        name, definition, offset, enclosure, meaning, exact_addends=tuple(exact_addends.items())
    )


def stem(name: str) -> str:
    """Return a name without the suffixes of operations; a part of a part keeps the last suffix only."""
    for suffix in (*_SUFFIXES.values(), "numerator", "denominator"):
        name = name.removesuffix(f"_{suffix}")
    return name


def _with_plain_products(context: DerivationContext, name: str, terms: Terms) -> Terms:
    """Store the products that are multiplied once more: they are rounded in between."""
    total = dict(terms)
    for monomial, coefficient in terms.items():
        if len(monomial) == 2 and not is_power_of_two(coefficient):
            inner = free_name(context, f"{name}_product")
            store(context, inner, {monomial: Fraction(1)})
            del total[monomial]
            total = combined(total, stored_terms(context, inner), coefficient)
    return total


def _split(context: DerivationContext, terms: Terms) -> tuple[Terms, Terms]:
    """Return the exact sum of inputs that a sum differs little from, and the difference; else nothing and the sum."""
    exact: Terms = {
        monomial: c
        for monomial, c in terms.items()
        if len(monomial) == 1 and is_power_of_two(c) and _is_exact(context, monomial[0])
    }
    others = {monomial: c for monomial, c in terms.items() if monomial not in exact}
    if exact and others:
        around = context.ranges.enclosure(exact.items()).magnitude
        if context.ranges.enclosure(others.items()).magnitude <= around * _SMALL:
            return exact, others
    return {}, terms


def _is_exact(context: DerivationContext, name: str) -> bool:
    """Return whether a quantity is a sum of inputs without rounding."""
    quantity = context.items[name]
    definition = quantity.definition
    if isinstance(definition, InputElement):
        return True
    return (
        isinstance(definition, Sum)
        and not quantity.offset
        and not quantity.exact_addends
        and all(
            len(monomial) == 1
            and is_power_of_two(c)
            and isinstance(context.items[monomial[0]].definition, InputElement)
            for monomial, c in definition.terms
        )
    )


def _product(context: DerivationContext, left: Terms, right: Terms, name: str) -> Terms:
    """Return the product of two sums, each stored first where it has too many terms."""
    for constant, terms in ((left, right), (right, left)):
        if set(constant) <= {()}:
            return scaled(terms, constant.get((), Fraction(0)))
    left, right = _with_shifts(context, left, right)
    left, right = _factor(context, left, name), _factor(context, right, name)
    total: Terms = {}
    for one, a in left.items():
        for other, b in right.items():
            total = combined(total, {tuple(sorted(one + other)): a * b}, Fraction(1))
    return total


def _of_same_word(context: DerivationContext, name: str, rest: Terms) -> Terms:
    """Make one word of a multiple that nothing is made from yet and of what differs from it by a number and a sign."""
    ((monomial, sign),) = rest.items()
    base = _multiplied(context, monomial) if abs(sign) == 1 else None
    if base is None or any(monomial[0] in used_by(item) for item in context.items.values()):
        return rest
    context.same_words[monomial[0]] = name, sign
    return scaled(base, sign)


def _multiplied(context: DerivationContext, monomial: Monomial) -> Terms | None:
    """Return what a stored quantity is a multiple of, with the coefficient; None if it is no multiple."""
    if len(monomial) != 1:
        return None
    quantity = context.items[monomial[0]]
    match quantity.definition:
        case Sum(((base, factor),)) if len(base) == 1:
            inexact = quantity.exact_addends or quantity.approximation_error or quantity.range_checked
            if inexact or quantity.inherited_error or quantity.name in context.outputs:
                return (
                    None  # of a function's value not even the samples of what it is computed from are known
                )
            return {base: factor}
    return None


def _with_shifts(context: DerivationContext, left: Terms, right: Terms) -> tuple[Terms, Terms]:
    """Return factors with the coefficient of a multiple in the other one where that takes no multiplication more.

    Multiples by powers of two are shifts here, and the value is rounded once less than its multiple.
    """
    if len(left) > 1:
        return (left, right) if len(right) > 1 else _with_shifts(context, right, left)[::-1]
    ((monomial, coefficient),) = left.items()
    base = _multiplied(context, monomial)
    if base is not None and len(right) > 1:
        ((name, factor),) = base.items()
        moved = scaled(right, coefficient * factor)
        if sum(map(_is_product, moved.items())) <= sum(map(_is_product, right.items())):
            return {name: Fraction(1)}, moved
    return left, right


def _is_product(term: tuple[Monomial, Fraction]) -> bool:
    return bool(term[0]) and not is_power_of_two(term[1])


def _factor(context: DerivationContext, terms: Terms, name: str) -> Terms:
    """Return a factor as a constant, one stored quantity times a power of two, and exact terms beside it."""
    linear = [monomial for monomial in terms if monomial]
    if is_dyadic(terms.get((), Fraction(0))) and all(
        len(m) == 1 and is_power_of_two(terms[m]) for m in linear
    ):
        stored = [context.items[m[0]] for m in linear]
        exact_addends = {m for quantity in stored for m, _ in quantity.exact_addends}
        if len(linear) == 1 or (
            exact_addends and all(m in exact_addends or context.items[m[0]].exact_addends for m in linear)
        ):
            return terms
    inner = free_name(context, f"{name}_factor")
    store(context, inner, terms)
    return stored_terms(context, inner)


def _evaluate(terms: Terms, values: Samples) -> NDArray[np.float64]:
    """Return the values of a sum on samples."""
    total = np.zeros(len(values[""]))
    for monomial, coefficient in terms.items():
        product = np.full(1, float(coefficient))
        for name in monomial:
            product = product * values[name]
        total = total + product
    return total
