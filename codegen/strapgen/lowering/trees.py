"""Builds and rewrites trees of nodes: sums, products and polynomials, and the names of temporaries.

Every module that writes arithmetic builds it here, so that signs, constants and equal coefficients are treated alike.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from fractions import Fraction
from itertools import count
from operator import is_not
from typing import Any

from strapgen.ir.program import Constant, Node, Operation, Program, references
from strapgen.kernel.polynomials import Polynomial

#: A sign, True for plus, and the node that is added or subtracted.
Term = tuple[bool, Node]

#: Most terms of a polynomial for which `horner` tries every factor that occurs equally often.
_MOST_TRIED = 10


def chain(kind: str, nodes: list[Node]) -> Node:
    """Apply an operation from left to right."""
    total = nodes[0]
    for node in nodes[1:]:
        total = Operation(kind, (total, node))
    return total


def signed_sum(terms: list[Term]) -> Term:
    """Add and subtract terms, the first positive one in front; if all are negative, return their sum and a minus."""
    if not any(positive for positive, _ in terms):
        return False, chain("add", [node for _, node in terms])
    first = next(k for k, (positive, _) in enumerate(terms) if positive)
    total = terms[first][1]
    for positive, node in terms[:first] + terms[first + 1 :]:
        total = Operation("add" if positive else "subtract", (total, node))
    return True, total


def terms_of(node: Node, sign: bool = True) -> Iterator[Term]:
    """Yield the terms of a sum with their signs; a node that is no sum is its own."""
    if isinstance(node, Operation) and node.kind in ("add", "subtract"):
        left, right = node.arguments
        yield from terms_of(left, sign)
        yield from terms_of(right, sign == (node.kind == "add"))
    else:
        yield sign, node


def plain(term: Term) -> Node:
    """Return a term as one node, with a negation if it is subtracted."""
    positive, node = term
    if positive:
        return node
    return Constant(-node.value) if isinstance(node, Constant) else Operation("negate", (node,))


def scaled(coefficient: Fraction, node: Node) -> Term:
    """Return coefficient times node, without a multiplication where the coefficient is 1 or -1."""
    if abs(coefficient) != 1:
        node = Operation("multiply", (Constant(abs(coefficient)), node))
    return coefficient > 0, node


def scaling(node: Node) -> tuple[Fraction, Node | None]:
    """Return a node as a factor and another node, which is None if the node is a number."""
    if isinstance(node, Constant):
        return node.value, None
    if isinstance(node, Operation):
        if node.kind == "negate":
            coefficient, rest = scaling(node.arguments[0])
            return -coefficient, rest
        if node.kind == "multiply" and isinstance(node.arguments[0], Constant):
            return node.arguments[0].value, node.arguments[1]
    return Fraction(1), node


def gathered(terms: Iterable[tuple[Fraction, Node]]) -> list[Term]:
    """Multiply nodes by their coefficients; nodes with the same coefficient are summed first."""
    groups: dict[Fraction, list[Term]] = {}
    for coefficient, node in terms:
        groups.setdefault(abs(coefficient), []).append((coefficient > 0, node))
    total: list[Term] = []
    for magnitude, members in groups.items():
        positive, node = signed_sum(members)
        total.append((positive, scaled(magnitude, node)[1]))
    return total


def with_constant(terms: list[Term], constant: Fraction) -> Term:
    """Return the sum of terms and a number; the number comes last, so that it is rounded once."""
    if constant or not terms:
        terms = [*terms, (constant >= 0, Constant(abs(constant)))]
    return signed_sum(terms)


def expanded(polynomial: Polynomial, node: Callable[[Any], Node]) -> Term:
    """Write a polynomial as a sum of products."""
    terms = (
        (coefficient, chain("multiply", [node(name) for name in monomial]))
        for monomial, coefficient in sorted(polynomial.items())
        if monomial
    )
    return with_constant(gathered(terms), polynomial.get((), Fraction(0)))


def horner(polynomial: Polynomial, node: Callable[[Any], Node]) -> Term:
    """Write a polynomial by Horner's scheme in several variables; `node` returns the node of an atom.

    The atom that occurs in most terms is factored out, and both the factor and the remaining terms are treated in the
    same way. In a short polynomial, all atoms that occur equally often are tried and the fewest operations win.
    """
    seen: dict[frozenset[Any], list[Term]] = {}

    def written(p: Polynomial) -> Term:
        return with_constant(terms({m: c for m, c in p.items() if m}), p.get((), Fraction(0)))

    def terms(p: Polynomial) -> list[Term]:
        key = frozenset(p.items())
        if key not in seen:
            seen[key] = shortest(p)
        return seen[key]

    def shortest(p: Polynomial) -> list[Term]:
        counts = Counter(name for monomial in p for name in set(monomial))
        most = max(counts.values(), default=0)
        powers = {m[0] for m in p if len(m) > 1 and len(set(m)) == 1}
        if most < 2 and not powers:
            factors = ((c, chain("multiply", [node(name) for name in m])) for m, c in sorted(p.items()))
            return gathered(factors)
        candidates = sorted(name for name in counts if counts[name] == most or (most < 2 and name in powers))
        if len(p) > _MOST_TRIED:
            del candidates[1:]
        tried = (take_out(p, name) for name in candidates)
        return min(tried, key=lambda outcome: sum(operation_count(tree) + 1 for _, tree in outcome))

    def take_out(p: Polynomial, name: Any) -> list[Term]:
        inside: Polynomial = {}
        rest: Polynomial = {}
        for monomial, coefficient in p.items():
            if name in monomial:
                place = monomial.index(name)
                inside[monomial[:place] + monomial[place + 1 :]] = coefficient
            else:
                rest[monomial] = coefficient
        positive, factor = written(inside)
        if isinstance(factor, Constant):
            first = scaled(factor.value if positive else -factor.value, node(name))
        else:
            first = positive, Operation("multiply", (node(name), factor))
        return [first, *(terms(rest) if rest else [])]

    return written(polynomial)


def operation_count(node: Node) -> int:
    """Return the number of operations in a tree."""
    return node.size if isinstance(node, Operation) else 0


#: Prefix of the temporaries that hold common subexpressions.
SHARED = "shared_"
#: Prefix of the temporaries that hold partial products of a power.
FACTOR = "factor_"


def is_temporary(name: str) -> bool:
    """Return whether a name is that of a temporary, which stands for no quantity of the algorithm."""
    return name.startswith((SHARED, FACTOR))


def shared_names(program: Program) -> Iterator[str]:
    """Yield names for further common subexpressions, none of which the program uses yet."""
    names = {assignment.name for assignment in program.body}
    names |= {element for signal in program.inputs for element in signal.elements}
    return (name for k in count(1) if (name := f"{SHARED}{k}") not in names)


#: Outcomes of a pass for single values that are remembered: the candidates of a kernel have most values in common, and
#: passes run again until nothing changes.
REMEMBERED = 10_000


def rewritten(node: Node, rule: Callable[[Node], Node]) -> Node:
    """Return a node after a rule has been applied to all nodes in it, to arguments before their operation."""
    if isinstance(node, Operation):
        arguments = tuple([rewritten(argument, rule) for argument in node.arguments])
        if any(map(is_not, arguments, node.arguments)):
            node = Operation(node.kind, arguments)
    return rule(node)


def with_values(program: Program, change: Callable[[Node], Node]) -> Program:
    """Return a program with every assigned value changed."""
    return with_each(program, [change(assignment.value) for assignment in program.body])


def with_each(program: Program, values: list[Node]) -> Program:
    """Return a program with other values; the program itself if they are equal."""
    body = [
        assignment if value == assignment.value else replace(assignment, value=value)
        for assignment, value in zip(program.body, values, strict=True)
    ]
    if not any(map(is_not, body, program.body)):
        return program
    return replace(program, body=tuple(body))


def uses(program: Program) -> Counter[str]:
    """Count the uses of each name, in assignments and in results."""
    counts: Counter[str] = Counter()
    for assignment in program.body:
        counts.update(references(assignment.value))
    for result in program.results:
        for node in result.nodes:
            counts.update(references(node))
    return counts
