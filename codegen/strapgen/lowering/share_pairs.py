"""The pass `share_pairs` computes pairs of terms or factors that occur together once.

A comparison of trees does not find what x^2 + y^2 and x^2 + y^2 + z^2 have in common. This pass treats sums and
products as sets of members: it names the pair that occurs in most of them and repeats this until no pair occurs twice.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations

from strapgen.ir.program import Assignment, Node, Operation, Program, Reference, names_in, once
from strapgen.lowering.trees import (
    REMEMBERED,
    Term,
    chain,
    is_temporary,
    plain,
    rewritten,
    shared_names,
    signed_sum,
    terms_of,
    uses,
)

#: The kind of the sum or product, two members, and whether their signs are equal; those of factors always are.
_Pair = tuple[str, Node, Node, bool]


@dataclass(eq=False)
class _Many:
    """A sum or a product of any number of members; its node and its pairs are worked out once until it changes."""

    kind: str
    members: list[tuple[bool, Node | _Many]]

    @once
    def terms(self) -> list[Term]:
        return [(sign, _tree(member)) for sign, member in self.members]

    @once
    def node(self) -> Node:
        if self.kind == "add":
            return plain(signed_sum(self.terms))
        nodes = [node for _, node in self.terms]
        return chain("multiply", nodes) if self.kind == "multiply" else Operation(self.kind, tuple(nodes))

    @once
    def pairs(self) -> frozenset[_Pair]:
        if self.kind not in ("add", "multiply"):
            return frozenset()
        members = sorted([(node, sign) for sign, node in self.terms], key=repr)
        return frozenset(
            [(self.kind, a, b, one == other) for (a, one), (b, other) in combinations(members, 2)]
        )

    def places(self, pair: _Pair) -> tuple[int, ...]:
        """Return the places of the first two members that are a pair; none if the pair does not occur."""
        kind, a, b, equal = pair
        if self.kind != kind:
            return ()
        first = [(k, sign) for k, (sign, node) in enumerate(self.terms) if node == a]
        second = [(k, sign) for k, (sign, node) in enumerate(self.terms) if node == b] if first else []
        places = ((i, j) for i, one in first for j, other in second if i != j and (one == other) == equal)
        return next(places, ())

    def forget(self) -> None:
        """Have all be worked out anew."""
        for name in ("terms", "node", "pairs"):
            self.__dict__.pop(name, None)


class _Counts:
    """The number of sums and products in which each pair occurs; of thousands, the few that occur twice stand apart."""

    def __init__(self) -> None:
        self.numbers: dict[_Pair, int] = {}
        self._all: Counter[int] = Counter()
        self._repeated: dict[int, int] = {}
        self._texts: dict[int, str] = {}
        self._pairs: list[_Pair] = []

    def number(self, pair: _Pair) -> int:
        """Return the number by which a pair is counted: its hash takes long."""
        number = self.numbers.setdefault(pair, len(self._pairs))
        if number == len(self._pairs):
            self._pairs.append(pair)
        return number

    def add(self, number: int, times: int) -> None:
        """Count a pair so many times more."""
        total = self._all[number] = self._all[number] + times
        if total > 1:
            self._repeated[number] = total
        else:
            self._repeated.pop(number, None)

    def most_frequent(self) -> _Pair | None:
        """Return the pair that occurs in most sums or products, the first of several; None if none occurs twice."""
        most = max(self._repeated.values(), default=0)
        several = [number for number, times in self._repeated.items() if times == most]
        return self._pairs[min(several, key=self._text)] if several else None

    def _text(self, number: int) -> str:
        if number not in self._texts:
            self._texts[number] = repr(self._pairs[number])
        return self._texts[number]


class _Entry:
    """An assignment, its value as sums and products, and the number of these in which each pair occurs."""

    def __init__(self, assignment: Assignment, counts: _Counts) -> None:
        self.assignment = assignment
        self.tree = _flat(assignment.value)
        self.pairs: Counter[int] = Counter()
        self._counts = counts
        for pair, times in _pairs_of(assignment.value).items():
            self._count(pair, times)

    def _count(self, pair: _Pair, times: int) -> None:
        number = self._counts.number(pair)
        self._counts.add(number, times)
        self.pairs[number] += times
        if not self.pairs[number]:
            del self.pairs[number]

    def replace(self, pair: _Pair, name: Reference) -> None:
        """Replace a pair once in each sum or product that holds it."""
        self._replace(self.tree, pair, name)

    def _replace(self, many: Node | _Many, pair: _Pair, name: Reference) -> bool:
        """Replace a pair in a part of the tree; return whether it occurs there."""
        if not isinstance(many, _Many):
            return False
        before, places = many.terms, many.places(pair)
        removed = [many.members[k][1] for k in places]
        others = [member for k, (_, member) in enumerate(many.members) if k not in places]
        below = [self._replace(member, pair, name) for member in others]
        if not places and not any(below):
            return False
        assert many.terms is before, "the pairs are those of what stood here"
        pairs = many.pairs
        if places:
            i, j = places
            many.members[i] = many.members[i][0], name
            del many.members[j]
        many.forget()
        for gone in pairs - many.pairs:
            self._count(gone, -1)
        for new in many.pairs - pairs:
            self._count(new, 1)
        for gone in (gone for member in removed for part in _inside(member) for gone in part.pairs):
            self._count(gone, -1)
        return True


def share_pairs(program: Program) -> Program:
    """Name the pairs of terms and of factors that occur more than once."""
    inlined = _inline(program)
    names = shared_names(inlined)
    counts = _Counts()
    entries = [_Entry(assignment, counts) for assignment in inlined.body]
    while pair := counts.most_frequent():
        name = next(names)
        kind, a, b, equal = pair
        number = counts.number(pair)
        holders = [place for place, entry in enumerate(entries) if number in entry.pairs]
        for place in holders:
            entries[place].replace(pair, Reference(name))
        value = Operation(kind if equal else "subtract", (a, b))
        entries.insert(holders[0], _Entry(Assignment(name, value), counts))
    if len(entries) == len(inlined.body):
        return program
    body = tuple(replace(entry.assignment, value=_tree(entry.tree)) for entry in entries)
    return replace(inlined, body=body)


def _inline(program: Program) -> Program:
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
        return _Many("add", [(sign, _flat(term)) for sign, term in terms_of(node)])
    if node.kind == "multiply":
        return _Many("multiply", [(True, _flat(factor)) for factor in _factors(node)])
    return _Many(node.kind, [(True, _flat(argument)) for argument in node.arguments])


def _factors(node: Node) -> Iterator[Node]:
    if isinstance(node, Operation) and node.kind == "multiply":
        for argument in node.arguments:
            yield from _factors(argument)
    else:
        yield node


def _tree(many: Node | _Many) -> Node:
    return many.node if isinstance(many, _Many) else many


def _inside(many: Node | _Many) -> Iterator[_Many]:
    if isinstance(many, _Many):
        yield many
        for _, member in many.members:
            yield from _inside(member)


@lru_cache(REMEMBERED)
def _pairs_of(value: Node) -> Counter[_Pair]:
    """Return the number of sums and products of a value in which each pair occurs; nobody changes it."""
    counts: Counter[_Pair] = Counter()
    for many in _inside(_flat(value)):
        counts.update(many.pairs)
    return counts
