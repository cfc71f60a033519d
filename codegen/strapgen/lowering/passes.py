"""Passes are pure functions from program to program that leave every result unchanged and save operations.

`fold_constants` carries out operations on constants exactly, when code is generated. A division by a constant becomes a
multiplication by its reciprocal, which is rounded once, when a target prints it. The constants of a product become one
factor in front of it. If all uses of a temporary multiply it by constants, its own constant factor moves into them.

`reuse_values` computes equal operations once. `share` finds common subexpressions of formulas; after sums and products
have been ordered and powers unrolled, a few more operations are equal, which a comparison node by node finds.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache
from operator import is_not

from strapgen.ir.program import (
    OPERATIONS,
    Assignment,
    Constant,
    Node,
    Operation,
    Program,
    Reference,
    Result,
    names_in,
    walk,
)
from strapgen.kernel.polynomials import ONE, Polynomial, add, atom, multiply, scale
from strapgen.lowering.share_multiples import share_multiples
from strapgen.lowering.share_pairs import share_pairs
from strapgen.lowering.trees import (
    REMEMBERED,
    horner,
    is_temporary,
    operation_count,
    plain,
    rewritten,
    scaling,
    shared_names,
    terms_of,
    uses,
    with_constant,
    with_each,
    with_values,
)

_EXACT = ("add", "subtract", "multiply", "divide", "negate")


def fold_constants(program: Program) -> Program:
    """Replace operations on constants by their exact values."""
    return with_values(_move_offsets(_move_scalings(with_values(program, _fold))), _fold)


@lru_cache(REMEMBERED)
def _fold(node: Node) -> Node:
    return rewritten(node, _on_constants)


def _on_constants(node: Node) -> Node:
    if not isinstance(node, Operation) or node.kind not in _EXACT:
        return node
    numbers = [argument.value for argument in node.arguments if isinstance(argument, Constant)]
    if len(numbers) == len(node.arguments) and not (node.kind == "divide" and not numbers[1]):
        return Constant(OPERATIONS[node.kind](*numbers))
    if node.kind in ("multiply", "divide"):
        return _scaled_product(node)
    if node.kind in ("add", "subtract") and numbers and not numbers[0]:
        left, right = node.arguments
        if isinstance(right, Constant):
            return left
        return right if node.kind == "add" else Operation("negate", (right,))
    return node


def _scaled_product(node: Operation) -> Node:
    (a, first), (b, second) = map(scaling, node.arguments)
    if node.kind == "divide" and b == 0:
        return node
    coefficient = a * b if node.kind == "multiply" else a / b
    if not coefficient:
        return Constant(Fraction(0))
    rest: Node | None
    if node.kind == "multiply":
        rest = (
            second if first is None else first if second is None else Operation("multiply", (first, second))
        )
    elif second is None:
        rest = first
    else:
        # A reciprocal keeps its numerator: 2/x is one operation.
        top: Node = first or Constant(abs(coefficient))
        rest = Operation("divide", (top, second))
        if first is None:
            coefficient /= abs(coefficient)
    if rest is None:
        return Constant(coefficient)
    if abs(coefficient) != 1:
        rest = Operation("multiply", (Constant(abs(coefficient)), rest))
    return rest if coefficient > 0 else Operation("negate", (rest,))


def _move_scalings(program: Program) -> Program:
    """Move the constant factor of a temporary into its uses if all of these multiply it by constants."""
    scaled = {}
    for assignment in program.body:
        coefficient, rest = scaling(assignment.value)
        if rest is not None and coefficient != 1 and is_temporary(assignment.name):
            scaled[assignment.name] = coefficient, rest
    if not scaled:
        return program
    again: dict[str, int] = defaultdict(int)
    for assignment in program.body:
        for node in walk(assignment.value):
            if isinstance(node, Operation) and node.kind == "multiply":
                coefficient, rest = scaling(node)
                if abs(coefficient) != 1 and isinstance(rest, Reference):
                    again[rest.name] += 1
    counts = uses(program)
    moved = {name: value for name, value in scaled.items() if counts[name] == again[name]}
    if not moved:
        return program

    def rule(node: Node) -> Node:
        if isinstance(node, Reference) and node.name in moved:
            return Operation("multiply", (Constant(moved[node.name][0]), node))
        return node

    body = tuple(replace(a, value=moved[a.name][1] if a.name in moved else a.value) for a in program.body)
    body = tuple(
        replace(a, value=rewritten(a.value, rule)) if moved.keys() & names_in(a.value) else a for a in body
    )
    return replace(program, body=body)


def _move_offsets(program: Program) -> Program:
    """Add a number at once to a name that differs from another one by a number; that name is rounded once less."""
    offsets: dict[str, tuple[Fraction, tuple[bool, Reference]]] = {}
    values = []
    for assignment in program.body:
        value, found = assignment.value, _offset(assignment.value)
        if found is not None:
            number, (positive, name) = found
            if name.name in offsets:
                other, (sign, name) = offsets[name.name]
                number += other if positive else -other
                positive = positive == sign
                value = plain(with_constant([(positive, name)], number))
            if number:
                offsets[assignment.name] = number, (positive, name)
        values.append(value)
    return with_each(program, values)


def _offset(node: Node) -> tuple[Fraction, tuple[bool, Reference]] | None:
    """Return a sum as a number and a name with its sign; None if it is no such sum."""
    if isinstance(node, Operation) and node.kind in ("add", "subtract"):
        match sorted(terms_of(node), key=lambda term: isinstance(term[1], Reference)):
            case [(sign, Constant(number)), (positive, Reference() as name)]:
                return number if sign else -number, (positive, name)
    return None


_EVEN = ("cos", "sinc")


def absorb_negations(program: Program) -> Program:
    """Move signs up the trees until a sum or a constant absorbs them; a temporary hands its sign to its users."""
    values = [_absorb(assignment.value) for assignment in program.body]
    results = {
        node.name for result in program.results for node in result.nodes if isinstance(node, Reference)
    }
    for place, assignment in enumerate(program.body):
        inner = _inside(values[place])
        if inner is not None and is_temporary(assignment.name) and assignment.name not in results:
            values = [_with_negated(value, assignment.name) for value in values]
            values[place] = inner
    return with_each(program, [_with_signed_constant(value) for value in values])


@lru_cache(REMEMBERED)
def _absorb(value: Node) -> Node:
    """Return a value with its signs moved up; the value itself if none moves."""
    outcome = rewritten(value, _move_sign)
    return value if outcome == value else outcome


def _with_negated(value: Node, name: str) -> Node:
    """Return a value with the negative of a name in its place, and the signs moved up."""
    if name not in names_in(value):
        return _absorb(value)
    return rewritten(
        value, lambda node: Operation("negate", (node,)) if node == Reference(name) else _move_sign(node)
    )


def _inside(node: Node) -> Node | None:
    """Return the argument of a negation; None for other nodes."""
    return node.arguments[0] if isinstance(node, Operation) and node.kind == "negate" else None


def _with_signed_constant(value: Node) -> Node:
    """Put a sign that no sum has absorbed into a constant factor, if there is one."""
    inner = _inside(value)
    return (_by_constant(inner) or value) if inner is not None else value


def _by_constant(node: Node) -> Node | None:
    """Return the negative of a node with the sign in a constant factor; None if it has none."""
    if not isinstance(node, Operation):
        return None
    left, *rest = node.arguments
    if node.kind == "multiply" and isinstance(left, Constant):
        return Operation("multiply", (Constant(-left.value), *rest))
    if node.kind == "add":
        for one, other in (node.arguments, node.arguments[::-1]):
            negative = _by_constant(one)
            if negative is not None:
                return Operation("subtract", (negative, other))
    return None


def _negate(node: Node) -> Node:
    if isinstance(node, Constant):
        return Constant(-node.value)
    if isinstance(node, Operation):
        if node.kind == "negate":
            return node.arguments[0]
        if node.kind == "subtract":
            return Operation("subtract", node.arguments[::-1])
        if node.kind == "multiply":
            for k, argument in enumerate(node.arguments):
                if isinstance(argument, Operation) and argument.kind in ("subtract", "negate"):
                    arguments = list(node.arguments)
                    arguments[k] = _negate(argument)
                    return Operation("multiply", tuple(arguments))
    return Operation("negate", (node,))


def _move_sign(node: Node) -> Node:
    if not isinstance(node, Operation):
        return node
    inner = [_inside(argument) for argument in node.arguments]
    if node.kind == "negate":
        return _negate(node.arguments[0])
    if not any(inner):
        return node
    if node.kind in ("add", "subtract"):
        (left, right), (minus_left, minus_right) = node.arguments, inner
        plus = node.kind == "add"
        if minus_right is not None:
            plus, right = not plus, minus_right
        if minus_left is None:
            return Operation("add" if plus else "subtract", (left, right))
        if plus:
            return Operation("subtract", (right, minus_left))
        return Operation("negate", (Operation("add", (minus_left, right)),))
    if node.kind in ("multiply", "divide"):
        arguments = tuple(i if i is not None else a for i, a in zip(inner, node.arguments, strict=True))
        result = Operation(node.kind, arguments)
        return result if all(inner) else _negate(result)
    if node.kind == "sin" and inner[0] is not None:
        return Operation("negate", (Operation("sin", (inner[0],)),))
    if node.kind in _EVEN and inner[0] is not None:
        return Operation(node.kind, (inner[0],))
    return node


def drop_copies(program: Program) -> Program:
    """Replace each temporary that is a copy of a name or of a number by the original."""
    copies: dict[str, Node] = {}

    def rule(node: Node) -> Node:
        return copies.get(node.name, node) if isinstance(node, Reference) else node

    body = []
    for assignment in program.body:
        value = rewritten(assignment.value, rule)
        if isinstance(value, Reference | Constant) and is_temporary(assignment.name):
            copies[assignment.name] = value
        else:
            body.append(replace(assignment, value=value))
    if not copies:
        return program

    def renamed(result: Result) -> Result:
        return replace(result, nodes=tuple(map(rule, result.nodes)))

    transition = None if program.transition is None else renamed(program.transition)
    return replace(
        program, body=tuple(body), outputs=tuple(map(renamed, program.outputs)), transition=transition
    )


#: Most terms of a polynomial that is rewritten: expanding a longer one takes long and saves no operations.
_MOST_TERMS = 60

_POLYNOMIAL = ("add", "subtract", "multiply", "negate")


def horner_schemes(program: Program) -> Program:
    """Write every polynomial by Horner's scheme where that takes fewer operations."""
    return with_values(program, _written)


@lru_cache(REMEMBERED)
def _written(node: Node) -> Node:
    if not isinstance(node, Operation):
        return node
    if node.kind in _POLYNOMIAL:
        atoms: dict[Node, int] = {}
        polynomial = _polynomial(node, atoms)
        if polynomial is not None:
            tree = plain(horner(polynomial, list(atoms).__getitem__))
            return tree if operation_count(tree) < operation_count(node) else node
    arguments = tuple(map(_written, node.arguments))
    return node if arguments == node.arguments else Operation(node.kind, arguments)


def _polynomial(node: Node, atoms: dict[Node, int]) -> Polynomial | None:
    """Return a node as a polynomial in those nodes that are no sums or products; None if it has too many terms."""
    if isinstance(node, Constant):
        return scale(ONE, node.value)
    if not isinstance(node, Operation) or node.kind not in _POLYNOMIAL:
        return atom(atoms.setdefault(_written(node), len(atoms)))
    parts = [_polynomial(argument, atoms) for argument in node.arguments]
    first = parts[0]
    second = parts[-1]
    if first is None or second is None:
        return None
    if node.kind == "negate":
        return scale(first, Fraction(-1))
    if node.kind != "multiply":
        return add(first, second, 1 if node.kind == "add" else -1)
    if len(first) * len(second) > _MOST_TERMS:
        return None
    return multiply(first, second)


def reuse_values(program: Program) -> Program:
    """Name every operation that occurs more than once and refer to it by its name."""
    occurrences = _occurrences(program)
    names = shared_names(program)
    known: dict[Node, Reference] = {}
    body: list[Assignment] = []

    def rewrite(node: Node, whole: bool = False) -> Node:
        if not isinstance(node, Operation):
            return node
        if node in known:
            return known[node]
        arguments = tuple([rewrite(argument) for argument in node.arguments])
        is_changed = any(map(is_not, arguments, node.arguments))
        rewritten = Operation(node.kind, arguments) if is_changed else node
        if whole or occurrences[node] < 2:
            return rewritten
        known[node] = Reference(next(names))
        body.append(Assignment(known[node].name, rewritten))
        return known[node]

    for assignment in program.body:
        value = rewrite(assignment.value, whole=True)
        body.append(assignment if value is assignment.value else replace(assignment, value=value))
        known.setdefault(assignment.value, Reference(assignment.name))
    return program if body == [*program.body] else replace(program, body=tuple(body))


def _occurrences(program: Program) -> Counter[Node]:
    """Count equal operations; the arguments of an operation that occurs again are not counted again."""
    seen: Counter[Node] = Counter()

    def visit(node: Node) -> None:
        if not isinstance(node, Operation):
            return
        if node.kind != "at_least":  # a condition cannot be assigned to a name
            seen[node] += 1
        if seen[node] < 2:
            for argument in node.arguments:
                visit(argument)

    for assignment in program.body:
        visit(assignment.value)
    return seen


def remove_unused(program: Program) -> Program:
    """Drop assignments that no result needs."""
    used = program.used()
    body = tuple(a for a in program.body if a.name in used)
    return program if len(body) == len(program.body) else replace(program, body=body)


Pass = Callable[[Program], Program]


#: The passes in the order in which they run.
PASSES: tuple[Pass, ...] = (
    fold_constants,
    absorb_negations,
    drop_copies,
    horner_schemes,
    reuse_values,
    share_pairs,
    share_multiples,
    remove_unused,
)


#: The extra cost of a division, a root or a function, in sums.
_LONG = 9


def optimize(program: Program) -> Program:
    """Run all passes repeatedly, as long as that saves operations; one that would add operations is undone."""
    while True:
        before = program
        for run in PASSES:
            changed = run(program)
            if cost(changed) <= cost(program):
                program = changed
        if cost(program) >= cost(before):
            return program


def cost(program: Program) -> tuple[int, int]:
    """Return the cost of a program: first its weighted number of operations, then its number of multiplications.

    A division, root or function has a higher weight, since it takes a processor as long as several sums.
    """
    operations = program.operations
    long = sum(operations[kind] for kind in ("divide", "sqrt", "function"))
    return sum(operations.values()) + _LONG * long, operations["multiply"]
