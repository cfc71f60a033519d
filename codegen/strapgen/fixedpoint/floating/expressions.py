"""Flattens a program into single operations, in the order in which the generated C computes them.

Equal operations on equal operands appear once: the code computes the same number wherever they stand.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

from strapgen.ir.program import RESOLUTION, Constant, Node, Program, Reference

INPUT, CONSTANT = "input", "constant"


class NoBoundError(Exception):
    """No bound of the rounding can be proved; the text says why."""


@dataclass(frozen=True)
class Expression:
    """A single operation, a literal or an element of an input."""

    kind: str  # an operation of `strapgen.ir.program.OPERATIONS`, `INPUT` or `CONSTANT`
    arguments: tuple[int, ...] = ()  # places of the operands
    name: str = ""  # name of an element of an input
    value: Fraction = Fraction(0)  # value of a literal


@dataclass
class Expressions:
    """The operations of a program, each after its operands."""

    items: list[Expression] = field(default_factory=list)
    names: dict[str, int] = field(default_factory=dict)  # places of elements of inputs and of assignments
    labels: dict[int, str] = field(default_factory=dict)  # assignments in which operations stand
    results: dict[str, list[int]] = field(default_factory=dict)  # places of the elements of every result
    _places: dict[Expression, int] = field(default_factory=dict)

    @classmethod
    def of(cls, program: Program) -> Expressions:
        """Return the operations of a program."""
        flat = cls()
        for name in [*(name for signal in program.inputs for name in signal.elements), RESOLUTION]:
            flat.names[name] = flat._place(Expression(INPUT, name=name), name)
        for assignment in program.body:
            flat.names[assignment.name] = flat.place_of(assignment.value, assignment.name)
        for result in program.results:
            name = result.signal.name
            flat.results[name] = [flat.place_of(node, name) for node in result.nodes]
        return flat

    def place_of(self, node: Node, label: str = "") -> int:
        """Return the place of a node, with its operations added where they are new."""
        if isinstance(node, Reference):
            return self.names[node.name]
        if isinstance(node, Constant):
            return self._place(Expression(CONSTANT, value=node.value), label)
        arguments = tuple(self.place_of(argument, label) for argument in node.arguments)
        return self._place(Expression(node.kind, arguments), label)

    def squared(self, place: int) -> list[int]:
        """Return the places of the numbers of whose squares an operation is the sum; none if it is no such sum."""
        expression = self.items[place]
        if expression.kind == "add":
            parts = [self.squared(k) for k in expression.arguments]
            return [k for part in parts for k in part] if all(parts) else []
        is_square = expression.kind == "multiply" and len({*expression.arguments}) == 1
        return [expression.arguments[0]] if is_square else []

    def _place(self, expression: Expression, label: str) -> int:
        place = self._places.setdefault(expression, len(self.items))
        if place == len(self.items):
            self.items.append(expression)
            self.labels[place] = label
        return place
