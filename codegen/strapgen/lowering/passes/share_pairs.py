"""The pass `share_pairs` computes pairs of terms or factors that occur together once.

A comparison of trees does not find what x^2 + y^2 and x^2 + y^2 + z^2 have in common. This pass treats sums and
products as sets of members: it names the pair that occurs in most of them and repeats this until no pair occurs twice.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import combinations

from strapgen.ir.program import Assignment, Node, Operation, Program, Reference, names_in
from strapgen.lowering.arithmetic import Term, chain, plain, signed_sum
from strapgen.lowering.names import is_temporary, shared_names
from strapgen.lowering.passes.rewriting import REMEMBERED, rewritten, uses

#: The kind of the sum or product, two members, and whether their signs are equal; those of factors always are.
_Pair = tuple[str, Node, Node, bool]


@dataclass
class _Many:
    """A sum or a product of any number of members."""

    kind: str
    members: list[tuple[bool, Node | _Many]]


@dataclass
class _Entry:
    """An assignment, its value as sums and products, and in how many of these each pair occurs."""

    assignment: Assignment
    tree: Node | _Many
    pairs: Counter[_Pair] = field(init=False)

    def __post_init__(self) -> None:
        self.pairs = _pairs_of(self.assignment.value)


class _Counts:
    """In how many sums and products each pair occurs; of thousands of pairs the few that occur twice stand apart."""

    def __init__(self) -> None:
        self._all: dict[_Pair, int] = {}
        self._repeated: dict[_Pair, int] = {}

    def add(self, pairs: Counter[_Pair], sign: int = 1) -> None:
        """Add the pairs of an entry, or take them away."""
        for pair, number in pairs.items():
            total = self._all[pair] = self._all.get(pair, 0) + sign * number
            if total > 1:
                self._repeated[pair] = total
            else:
                self._repeated.pop(pair, None)

    def most_frequent(self) -> _Pair | None:
        """Return the pair that occurs in most sums or products, the first of several; None if none occurs twice."""
        most = max(self._repeated.values(), default=0)
        return min(
            (pair for pair, number in self._repeated.items() if number == most), key=repr, default=None
        )


def share_pairs(program: Program) -> Program:
    """Name the pairs of terms and of factors that occur more than once.

    Examples
    --------
    >>> from strapgen.ir.program import Result
    >>> from strapgen.ir.signals import Signal
    >>> a, b, c, d = map(Reference, "abcd")
    >>> sums = [chain("add", [a, b, c]), chain("add", [a, d, b])]
    >>> body = tuple(Assignment(name, value) for name, value in zip("rs", sums))
    >>> results = tuple(Result(Signal.scalar(name), (Reference(name),)) for name in "rs")
    >>> signals = tuple(map(Signal.scalar, "abcd"))
    >>> share_pairs(Program("p", "p", "", "", "", (), signals, body, results)).operations["add"]
    3
    """
    inlined = _inlined(program)
    names = shared_names(inlined)
    entries = [_Entry(assignment, _flat(assignment.value)) for assignment in inlined.body]
    counts = _Counts()
    for entry in entries:
        counts.add(entry.pairs)
    while pair := counts.most_frequent():
        name = next(names)
        kind, a, b, equal = pair
        holders = [place for place, entry in enumerate(entries) if pair in entry.pairs]
        for entry in (entries[place] for place in holders):
            counts.add(entry.pairs, -1)
            _replace(entry.tree, pair, Reference(name))
            entry.pairs = _count(entry.tree)
            counts.add(entry.pairs)
        value = Operation(kind if equal else "subtract", (a, b))
        shared = _Entry(Assignment(name, value), _flat(value))
        counts.add(shared.pairs)
        entries.insert(holders[0], shared)
    if len(entries) == len(inlined.body):
        return program
    body = tuple(replace(entry.assignment, value=_tree(entry.tree)) for entry in entries)
    return replace(inlined, body=body)


def _inlined(program: Program) -> Program:
    """Put temporaries that are used once back into the tree that uses them."""
    counts = uses(program)
    held = {name for result in program.results for node in result.nodes for name in names_in(node)}
    values: dict[str, Node] = {}
    body = []

    def rule(node: Node) -> Node:
        return values.get(node.name, node) if isinstance(node, Reference) else node

    for assignment in program.body:
        value = rewritten(assignment.value, rule)
        if counts[assignment.name] == 1 and is_temporary(assignment.name) and assignment.name not in held:
            values[assignment.name] = value
        else:
            body.append(replace(assignment, value=value))
    return replace(program, body=tuple(body))


def _flat(node: Node) -> Node | _Many:
    if not isinstance(node, Operation):
        return node
    if node.kind in ("add", "subtract"):
        return _Many("add", [(sign, _flat(term)) for sign, term in _terms(node, True)])
    if node.kind == "multiply":
        return _Many("multiply", [(True, _flat(factor)) for factor in _factors(node)])
    return _Many(node.kind, [(True, _flat(argument)) for argument in node.arguments])


def _terms(node: Node, sign: bool) -> Iterator[Term]:
    if isinstance(node, Operation) and node.kind in ("add", "subtract"):
        left, right = node.arguments
        yield from _terms(left, sign)
        yield from _terms(right, sign == (node.kind == "add"))
    else:
        yield sign, node


def _factors(node: Node) -> Iterator[Node]:
    if isinstance(node, Operation) and node.kind == "multiply":
        for argument in node.arguments:
            yield from _factors(argument)
    else:
        yield node


def _tree(many: Node | _Many) -> Node:
    if not isinstance(many, _Many):
        return many
    members = [(sign, _tree(member)) for sign, member in many.members]
    if many.kind == "add":
        return plain(signed_sum(members))
    if many.kind == "multiply":
        return chain("multiply", [node for _, node in members])
    return Operation(many.kind, tuple(node for _, node in members))


def _inside(many: Node | _Many) -> Iterator[_Many]:
    if isinstance(many, _Many):
        yield many
        for _, member in many.members:
            yield from _inside(member)


def _pairs(many: _Many) -> Iterator[_Pair]:
    if many.kind in ("add", "multiply") and len(many.members) > 1:
        members = sorted(((_tree(member), sign) for sign, member in many.members), key=repr)
        for (a, one), (b, other) in combinations(members, 2):
            yield many.kind, a, b, one == other


@lru_cache(REMEMBERED)
def _pairs_of(value: Node) -> Counter[_Pair]:
    """Return in how many sums and products of a value each pair occurs; nobody changes it."""
    return _count(_flat(value))


def _count(tree: Node | _Many) -> Counter[_Pair]:
    """Return in how many sums and products of a tree each pair occurs."""
    counts: Counter[_Pair] = Counter()
    for many in _inside(tree):
        counts.update(set(_pairs(many)))
    return counts


def _replace(tree: Node | _Many, pair: _Pair, name: Reference) -> None:
    """Replace a pair once in each sum or product that holds it."""
    kind, a, b, equal = pair
    for many in list(_inside(tree)):
        if many.kind != kind:
            continue
        nodes = [_tree(member) for _, member in many.members]
        places = [
            (i, j) for i, x in enumerate(nodes) for j, y in enumerate(nodes) if i != j and (x, y) == (a, b)
        ]
        places = [(i, j) for i, j in places if (many.members[i][0] == many.members[j][0]) == equal]
        if places:
            i, j = places[0]
            many.members[i] = many.members[i][0], name
            del many.members[j]
