"""Writes a program in the counts of a gyro: its scale goes into constants that are there already.

With increments d = s u, where u are counts times a power of two, a value v of degree k in d is s^k times the same
formula in u. Every value gets a weight k and is computed as v / s^k: sums and products of increments stay in counts,
and s, s^2, ... multiply coefficients. Weights of polynomials are free: that of u in p = a d + ... is computed as s a.
Where it takes fewer multiplications, the increments are multiplied with s first.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import lru_cache
from typing import Generic, TypeVar

from strapgen.ir.program import (
    Assignment,
    Constant,
    Node,
    Operation,
    Program,
    Reference,
    Result,
    references,
    walk,
)
from strapgen.ir.signals import Signal
from strapgen.ir.units import Sensor

T = TypeVar("T")

#: Changes of a weight that are tried, the smallest first: none stays where no other costs less.
_CHANGES = sorted(range(-6, 7), key=abs)
#: A scale for which no product of coefficients is a power of two by chance, an odd number over a power of two: it tells
#: what weights cost.
_STAND_IN = Fraction(10007, 16384)
_ONE = Fraction(1)
#: Programs with more operations keep the weights of their lowest degrees.
_MOST_OPERATIONS = 600
#: Names of the inputs that a gyro counts: those of a step, and that of a loop where it is an angle increment.
_OF_STEP, _OF_LOOP = "increments", "increment"
_LINEAR = ("add", "subtract", "negate", "multiply")


def counted(program: Program) -> tuple[Signal, ...]:
    """Return the inputs of a program that a gyro may count: its samples of angle increments."""
    return tuple(
        signal
        for signal in program.inputs
        if signal.name == _OF_STEP or (signal.name == _OF_LOOP and signal.is_angle_increment)
    )


def in_counts(program: Program, sensor: Sensor) -> Program:
    """Return a program whose increments are counts times a power of two, where they were angles in rad.

    >>> from strapgen.ir.kernel_info import KernelInfo
    >>> d, y = Signal("increments", (1,), ("d",)), Signal.scalar("y")
    >>> half = Operation("multiply", (Constant(Fraction(1, 2)), Reference("d")))
    >>> one = Program(KernelInfo("f", "f", ""), (d,), (Assignment("y_1", half),), (Result(y, (Reference("y_1"),)),))
    >>> in_counts(one, Sensor(Fraction(3, 4), "", "")).body[0].value.arguments[0]
    Constant(value=Fraction(3, 8))
    """
    elements = {name: 1 for signal in counted(program) for name in signal.elements}
    if not elements or sensor.scale == 1:
        return program
    angles = _angles(program, [*elements])
    folded = _with_assigned_results(program, angles)
    converted = _with_angles_first(program, angles)
    candidates = [(converted, elements)]
    # Functions have series of their own, which a scale of their argument would make longer.
    operations = (n for a in program.body for n in walk(a.value) if isinstance(n, Operation))
    if all(node.kind in _LINEAR for node in operations):
        candidates.insert(0, (folded, dict(_weights(folded, tuple(elements)))))
    program, weights = min(candidates, key=lambda pair: _total_cost(*pair))
    scaling = _Scaling(weights, sensor.scale)
    body = tuple(replace(a, value=scaling.assigned(a)) for a in program.body)
    notes = (*program.notes, _note(program, weights, sensor))
    return replace(program, info=replace(program.info, notes=notes), body=body)


def _angles(program: Program, counted: list[str]) -> dict[str, str]:
    """Return a free name for the angle of every element that is counted."""
    names = {a.name for a in program.body} | {n for signal in program.inputs for n in signal.elements}
    free: dict[str, str] = {}
    for element in counted:
        name = f"{element}_angle"
        while name in names:
            name += "_"
        free[element] = name
    return free


def _with_assigned_results(program: Program, angles: Mapping[str, str]) -> Program:
    """Return the program with an assignment for each result that is an increment itself."""
    copied = {n.name for r in program.results for n in r.nodes if isinstance(n, Reference)} & {*angles}
    copies = tuple(Assignment(angles[name], Reference(name)) for name in angles if name in copied)
    return _with_results(program, (*program.body, *copies), {name: angles[name] for name in copied})


def _with_angles_first(program: Program, angles: Mapping[str, str]) -> Program:
    """Return the program with angles that it computes from the increments and uses further."""
    used = program.used()
    first = [Assignment(angles[name], Reference(name)) for name in angles if name in used]
    body = (replace(a, value=_rename(a.value, angles)) for a in program.body)
    return _with_results(program, (*first, *body), angles)


def _with_results(program: Program, body: tuple[Assignment, ...], names: Mapping[str, str]) -> Program:
    """Return a program with another body, and results by other names."""

    def renamed(result: Result) -> Result:
        return replace(result, nodes=tuple(_rename(node, names) for node in result.nodes))

    outputs, transition = tuple(map(renamed, program.outputs)), program.transition
    return replace(program, body=body, outputs=outputs, transition=transition and renamed(transition))


def _rename(node: Node, names: Mapping[str, str]) -> Node:
    """Return a node with other names."""
    if isinstance(node, Reference):
        return Reference(names.get(node.name, node.name))
    if isinstance(node, Operation):
        return Operation(node.kind, tuple(_rename(argument, names) for argument in node.arguments))
    return node


def _total_cost(program: Program, weights: Mapping[str, int]) -> int:
    """Return the multiplications of a program in counts."""
    scaling = _Multiplications(weights)
    return sum(scaling.number(assignment) for assignment in program.body)


@dataclass(frozen=True)
class _InCounts(ABC, Generic[T]):
    """Goes through nodes in counts, and makes of each what a subclass says."""

    weights: Mapping[str, int]  # by name, the k for which the program in counts holds the value over scale**k

    @abstractmethod
    def _constant(self, value: Fraction, power: int) -> T:
        """Make ``value * scale**power``."""

    @abstractmethod
    def _reference(self, node: Reference) -> T:
        """Make a name."""

    @abstractmethod
    def _operation(self, kind: str, arguments: list[T]) -> T:
        """Make an operation."""

    @abstractmethod
    def _multiple(self, made: T, factor: Fraction, power: int) -> T:
        """Make ``made * factor * scale**power``."""

    @abstractmethod
    def _shortest(self, several: list[T]) -> T:
        """Return the one with the fewest multiplications, the first of several."""

    def assigned(self, assignment: Assignment) -> T:
        """Return what is made of the right side of an assignment in counts."""
        return self.times(assignment.value, _ONE, -self.weights.get(assignment.name, 0))

    def times(self, node: Node, factor: Fraction, power: int) -> T:
        """Return what is made of ``node * factor * scale**power``; a factor goes down to the constants."""
        if isinstance(node, Constant):
            return self._constant(_times(factor, node.value), power)
        if isinstance(node, Reference):
            return self._multiple(self._reference(node), factor, power + self.weights.get(node.name, 0))
        if node.kind in ("add", "subtract", "negate"):
            return self._operation(node.kind, [self.times(n, factor, power) for n in node.arguments])
        if node.kind == "multiply":
            left, right = node.arguments
            return self._product(left, right, factor, power)
        plain = self._operation(node.kind, [self.times(n, _ONE, 0) for n in node.arguments])
        return self._multiple(plain, factor, power)

    def _product(self, left: Node, right: Node, factor: Fraction, power: int) -> T:
        for constant, other in ((left, right), (right, left)):
            if isinstance(constant, Constant):
                return self.times(other, _times(factor, constant.value), power)
        if not _is_linear(left) and not _is_linear(right):
            power += sum(self._weight(node) for node in (left, right))
            product = self._operation("multiply", [self._bare(left), self._bare(right)])
            return self._multiple(product, factor, power)
        if not _is_linear(left):
            inner = self.times(right, factor, power + self._weight(left))
            return self._operation("multiply", [self._bare(left), inner])
        if not _is_linear(right):
            inner = self.times(left, factor, power + self._weight(right))
            return self._operation("multiply", [inner, self._bare(right)])
        splits = {-self.weights.get(n.name, 0) for n in walk(right) if isinstance(n, Reference)}
        return self._shortest(
            [
                self._operation("multiply", [self.times(left, factor, power - k), self.times(right, _ONE, k)])
                for k in sorted(splits | {0})
            ]
        )

    def _weight(self, node: Node) -> int:
        return self.weights.get(node.name, 0) if isinstance(node, Reference) else 0

    def _bare(self, node: Node) -> T:
        """Return what is made of a name, or of an operation that is no sum of products, without a factor."""
        return self.times(node, _ONE, -self._weight(node))


@dataclass(frozen=True)
class _Scaling(_InCounts[Node]):
    """Writes nodes in counts."""

    scale: Fraction

    def _constant(self, value: Fraction, power: int) -> Node:
        return Constant(self._factor(value, power))

    def _reference(self, node: Reference) -> Node:
        return node

    def _operation(self, kind: str, arguments: list[Node]) -> Node:
        return Operation(kind, tuple(arguments))

    def _multiple(self, made: Node, factor: Fraction, power: int) -> Node:
        value = self._factor(factor, power)
        return made if value == 1 else Operation("multiply", (Constant(value), made))

    def _shortest(self, several: list[Node]) -> Node:
        return min(several, key=_cost)

    def _factor(self, factor: Fraction, power: int) -> Fraction:
        return factor * _power_of(self.scale, power) if power else factor


#: What stands in counts of multiplications for a constant that is a shift, and for any other.
_SHIFT, _FACTOR = -1, -2


class _Multiplications(_InCounts[int]):
    """Counts the multiplications that are no shifts of nodes in counts, with `_STAND_IN` for the scale."""

    def number(self, assignment: Assignment) -> int:
        """Return the number of the right side of an assignment."""
        return max(self.assigned(assignment), 0)

    def _constant(self, value: Fraction, power: int) -> int:
        return _SHIFT if _is_shift(value, power) else _FACTOR

    def _reference(self, node: Reference) -> int:
        return 0

    def _operation(self, kind: str, arguments: list[int]) -> int:
        return sum(
            [number for number in arguments if number > 0], kind == "multiply" and _SHIFT not in arguments
        )

    def _multiple(self, made: int, factor: Fraction, power: int) -> int:
        return made if _is_shift(factor, power) else made + 1

    def _shortest(self, several: list[int]) -> int:
        return min(several)


@lru_cache(maxsize=256)
def _power_of(scale: Fraction, power: int) -> Fraction:
    return scale**power


def _is_linear(node: Node) -> bool:
    """Return whether a factor can go down into a node."""
    return isinstance(node, Operation) and node.kind in _LINEAR


def _times(factor: Fraction, value: Fraction) -> Fraction:
    return value if factor is _ONE else factor * value


def _cost(node: Node) -> int:
    """Return the number of multiplications that are no shifts."""
    products = (n for n in walk(node) if isinstance(n, Operation) and n.kind == "multiply")
    return sum(
        not any(isinstance(n, Constant) and _is_shift(n.value) for n in product.arguments)
        for product in products
    )


def _is_shift(factor: Fraction, power: int = 0) -> bool:
    """Return whether ``factor * _STAND_IN**power`` is zero or a power of two, up to its sign."""
    top, bottom = abs(factor.numerator), factor.denominator
    if power > 0:  # in lowest terms, what is odd below must cancel what is odd of the scale
        bottom, rest = divmod(bottom, _STAND_IN.numerator**power)
        return not top or (not rest and top & (top - 1) == 0 and bottom & (bottom - 1) == 0)
    if power < 0 and top:
        top, rest = divmod(top, _STAND_IN.numerator**-power)
        if rest:
            return False
    return top & (top - 1) == 0 and bottom & (bottom - 1) == 0


# Weights


@lru_cache(maxsize=8)
def _weights(program: Program, counted: tuple[str, ...]) -> Mapping[str, int]:
    """Return the weights with the fewest multiplications that are known.

    A value of one degree has that weight; a polynomial of several has the one with which its first user needs no
    coefficient. Weights are then changed as long as that saves multiplications.
    """
    results = {n.name for result in program.results for n in result.nodes if isinstance(n, Reference)}
    degrees = {name: {1} for name in counted}
    for assignment in program.body:
        degrees[assignment.name] = {0} if assignment.name in results else _degrees(assignment.value, degrees)
    weights = {name: min(several, default=0) for name, several in degrees.items()}
    movable = [a for a in program.body if a.name not in results and _is_linear(a.value)]
    pending = {a.name for a in movable if len(degrees[a.name]) > 1}
    for assignment in reversed(program.body):
        pending.discard(assignment.name)
        for name, weight in _demands(assignment.value, weights[assignment.name], weights, pending):
            weights[name] = weight
            pending.discard(name)
    if sum(program.operations.values()) <= _MOST_OPERATIONS:
        _descend(program, _groups([a.name for a in movable]), weights)
    return weights


def _demands(
    node: Node, weight: int, weights: Mapping[str, int], pending: set[str]
) -> Iterator[tuple[str, int]]:
    """Yield the values among some with the weights for which a node of a weight needs no coefficients."""
    if isinstance(node, Reference) and node.name in pending:
        yield node.name, weight
    if not isinstance(node, Operation) or not _is_linear(node):
        return
    if node.kind != "multiply":
        for argument in node.arguments:
            yield from _demands(argument, weight, weights, pending)
        return
    for one, other in (node.arguments, node.arguments[::-1]):
        if pending.isdisjoint(references(other)):
            known = {name: {degree} for name, degree in weights.items()}
            yield from _demands(one, weight - min(_degrees(other, known), default=0), weights, pending)
            return


def _degrees(node: Node, known: Mapping[str, set[int]]) -> set[int]:
    """Return the degrees of the terms of a sum of products."""
    if isinstance(node, Reference):
        return known.get(node.name, {0})
    if not isinstance(node, Operation):
        return {0}
    parts = [_degrees(argument, known) for argument in node.arguments]
    if node.kind == "multiply":
        return {a + b for a in parts[0] for b in parts[1]}
    return set().union(*parts)


def _groups(names: list[str]) -> list[tuple[str, ...]]:
    """Return the elements of each vector together, the last first."""
    groups: dict[str, list[str]] = {}
    for name in names:
        stem, _, element = name.rpartition("_")
        groups.setdefault(stem if element in ("x", "y", "z") else name, []).append(name)
    return [tuple(group) for group in reversed(groups.values())]


def _descend(program: Program, groups: list[tuple[str, ...]], weights: dict[str, int]) -> None:
    """Change the weights of one group after the other, alone or with its coefficients, as long as that helps."""
    users: dict[str, list[Assignment]] = {a.name: [a] for a in program.body}
    for assignment in program.body:
        for name in set(references(assignment.value)) & {*users}:
            users[name].append(assignment)
    scalars = {group[0] for group in groups if len(group) == 1}
    scaling, improved = _Multiplications(weights), True
    involved = {a.name: sorted({a.name, *references(a.value)} & {*weights}) for a in program.body}
    known: dict[tuple[str, tuple[int, ...]], int] = {}

    def cost_of(assignment: Assignment) -> int:
        """Return the multiplications of an assignment, which depend on the weights of its own names alone."""
        key = assignment.name, tuple([weights[name] for name in involved[assignment.name]])
        if key not in known:
            known[key] = scaling.number(assignment)
        return known[key]

    while improved:
        improved = False
        for group in groups:
            definitions = [users[name][0].value for name in group]
            factors = scalars.intersection(*(references(value) for value in definitions))
            for names in (group, (*group, *factors)):
                near = list({a.name: a for name in names for a in users[name]}.values())
                before = [weights[name] for name in names]
                costs: dict[int, int] = {}
                for change in _CHANGES:
                    weights.update((name, k + change) for name, k in zip(names, before, strict=True))
                    costs[change] = sum(map(cost_of, near))
                best = min(costs, key=lambda change: costs[change])
                weights.update((name, k + best) for name, k in zip(names, before, strict=True))
                improved |= best != 0


def _note(program: Program, weights: Mapping[str, int], sensor: Sensor) -> str:
    """Return a note on the values in counts for a reader of the code."""
    known = f"s = {float(sensor.scale):.17g}{', from pi to 50 decimals' * sensor.is_rounded}"
    start = f"The increments are counts; with {known}, an angle in rad is s times its number in the code"
    groups: dict[int, list[str]] = {}
    for group in reversed(_groups([a.name for a in program.body if weights.get(a.name)])):
        stem = group[0] if len(group) == 1 else group[0].rpartition("_")[0]
        groups.setdefault(weights[group[0]], []).append(stem)
    if not groups:
        return f"{start}."
    parts = [f"{', '.join(names)} by {_power(k)}" for k, names in sorted(groups.items(), reverse=True)]
    return f"{start}. Powers of s are in the constants, and values are divided: {'; '.join(parts)}."


def _power(exponent: int) -> str:
    return "s" if exponent == 1 else f"s^{exponent}"
