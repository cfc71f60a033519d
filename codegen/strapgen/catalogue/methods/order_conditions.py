"""Order conditions of Runge-Kutta methods, for general equations and for attitude kinematics, exactly.

For general equations the conditions of order p belong to the rooted trees with p nodes: b' Phi(t) = 1/gamma(t), after
Butcher.

For linear equations x' = A(t) x most of them coincide or are not needed. A word (k_1, ..., k_m) stands for the product
A^(k_1) A^(k_2) ... A^(k_m) of derivatives of A. Its order is p = sum (k_i + 1), and there are 2^(p - 1) words of this
order. In the exact solution, a series of iterated integrals (Peano and Baker), its coefficient is

    int_0^1 s_1^k_1 int_0^s_1 s_2^k_2 ... int_0^s_(m-1) s_m^k_m ds_m ... ds_1 = prod_i 1 / sum_(j >= i) (k_j + 1)

and in the method it is b' C^k_1 A C^k_2 A ... C^k_m 1 with the diagonal matrix C of the nodes; a factor
1/(k_1! ... k_m!) is common to both. Attitude kinematics is linear. In the form x' = x A all products are reversed on
both sides, and the conditions are the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache, lru_cache
from itertools import combinations_with_replacement, groupby, product
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from strapgen.catalogue.coefficients import Number
    from strapgen.catalogue.methods.tableaux import Tableau

#: A rooted tree as the tuple of the subtrees of its root, in a fixed order.
Tree: TypeAlias = "tuple[Tree, ...]"
#: A product of derivatives of A(t), as the tuple of the orders of the derivatives, the last in time first.
Word: TypeAlias = tuple[int, ...]


# Trees


@cache
def trees(order: int) -> tuple[Tree, ...]:
    """Return the rooted trees with `order` nodes, the tree with all leaves on the root first.

    >>> trees(3)
    (((), ()), (((),),))
    >>> [len(trees(order)) for order in range(1, 9)]
    [1, 1, 2, 4, 9, 20, 48, 115]
    """
    return tuple(
        tuple(subtree for choice in chosen for subtree in choice)
        for sizes in _partitions(order - 1, order - 1)
        for chosen in product(
            *(combinations_with_replacement(trees(nodes), len([*same])) for nodes, same in groupby(sizes))
        )
    )


def _partitions(total: int, largest: int) -> Iterator[tuple[int, ...]]:
    """Yield the partitions of a number, with the parts of each in ascending order."""
    if total == 0:
        yield ()
    for last in range(1, min(total, largest) + 1):
        for rest in _partitions(total - last, last):
            yield (*rest, last)


@cache
def size(tree: Tree) -> int:
    """Return the number of nodes of a tree, which is the order of its condition."""
    return 1 + sum(map(size, tree))


@cache
def density(tree: Tree) -> int:
    """Return gamma, the product of the sizes of a tree and of all its subtrees.

    >>> density((((),),))
    6
    """
    return size(tree) * math.prod(map(density, tree))


@cache
def symmetry(tree: Tree) -> int:
    """Return sigma, the number of exchanges of branches that leave a tree unchanged.

    >>> symmetry(((), (), ()))
    6
    """
    return math.prod(
        math.factorial(number) * symmetry(subtree) ** number
        for subtree in dict.fromkeys(tree)
        for number in [tree.count(subtree)]
    )


def weight_text(tree: Tree) -> str:
    """Return the elementary weight of a tree in the usual notation.

    >>> [weight_text(tree) for tree in trees(3)]
    ['sum b_i c_i^2', 'sum b_i a_ij c_j']
    """
    letters = iter("ijklmnopqrstuvwxyz")

    def factors(tree: Tree, at: str) -> list[str]:
        leaves = tree.count(())
        parts = [f"c_{at}" + (f"^{leaves}" if leaves > 1 else "")] if leaves else []
        for subtree in tree:
            if subtree:
                below = next(letters)
                parts += [f"a_{at}{below}", *factors(subtree, below)]
        return parts

    root = next(letters)
    return " ".join(["sum", f"b_{root}", *factors(tree, root)])


# Words


def words(order: int, derivatives: int | None = None) -> list[Word]:
    """Return the products of derivatives of A(t) of an order, the shortest first, none of a derivative above a limit.

    >>> words(3), words(3, derivatives=0)
    ([(2,), (1, 0), (0, 1), (0, 0, 0)], [(0, 0, 0)])
    """
    if order == 0:
        return [()]
    highest = order - 1 if derivatives is None else min(derivatives, order - 1)
    products = [(k, *rest) for k in range(highest, -1, -1) for rest in words(order - 1 - k, derivatives)]
    return sorted(products, key=len)


def word_text(word: Word) -> str:
    """Return the weight of a word in a tableau in the usual notation.

    >>> [word_text(word) for word in words(3)]
    ['sum b_i c_i^2', 'sum b_i c_i a_ij', 'sum b_i a_ij c_j', 'sum b_i a_ij a_jk']
    """
    letters, parts = "ijklmnopqrstuvwxyz", ["sum b_i"]
    for place, power in enumerate(word):
        if place:
            parts.append(f"a_{letters[place - 1]}{letters[place]}")
        if power:
            parts.append(f"c_{letters[place]}" + (f"^{power}" if power > 1 else ""))
    return " ".join(parts)


def word_coefficient(word: Word) -> Fraction:
    """Return the coefficient of a word in the exact solution, times the factorials of its derivatives.

    >>> word_coefficient((0, 1))  # int_0^1 int_0^s t dt ds
    Fraction(1, 6)
    """
    return Fraction(1, math.prod(sum(k + 1 for k in word[place:]) for place in range(len(word))))


# Tableaux


class Stages:
    """A tableau's coefficients in a ring or field, where a zero is recognized, and vectors with an element a stage."""

    def __init__(
        self,
        rows: Sequence[Sequence[Any]],
        rational: Callable[[Fraction], Any] = Fraction,
        number: Callable[[Any], Any] = Fraction,
    ) -> None:
        self.rational, self.number = rational, number  # a fraction to an element, and an element to a number
        self.nodes, self.weights, *self.matrix = rows
        self.zero, one = self.rational(Fraction(0)), self.rational(Fraction(1))
        self.ones = [one] * len(self.nodes)
        self.trees: dict[Tree, list[Any]] = {(): self.ones}
        self.branches: dict[Tree, list[Any]] = {(): [*self.nodes]}
        self.words: dict[Word, list[Any]] = {(): self.ones}

    @classmethod
    def of(cls, tableau: Tableau) -> Stages:
        """Return the coefficients of a tableau as fractions, or in the smallest algebraic field that holds them."""
        rows = [tableau.nodes, tableau.weights, *tableau.matrix]
        if tableau.rational:
            return cls(rows)
        import sympy as sp
        from sympy.polys.constructor import construct_domain

        values = [sp.sympify(value) for row in rows for value in row]
        domain, elements = construct_domain(values, extension=True, field=True)
        rest_of_elements = iter(elements)
        return cls(
            [[next(rest_of_elements) for _ in row] for row in rows],
            lambda value: domain.from_sympy(sp.Rational(value.numerator, value.denominator)),
            domain.to_sympy,
        )

    def applied(self, vector: list[Any]) -> list[Any]:
        """Return the matrix of the tableau times a vector."""
        return [self.sum(row, vector[: len(row)]) for row in self.matrix]

    def sum(self, left: Sequence[Any], right: Sequence[Any]) -> Any:
        """Return the scalar product of two vectors."""
        return sum((x * y for x, y in zip(left, right, strict=True) if x and y), self.zero)

    def tree(self, tree: Tree) -> list[Any]:
        """Return the product over the subtrees of the matrix times their vectors, or the nodes for a leaf."""
        if tree not in self.trees:
            *others, last = tree
            rest, factor = self.tree(tuple(others)), self.branch(last)
            self.trees[tree] = [x * y for x, y in zip(rest, factor, strict=True)] if others else factor
        return self.trees[tree]

    def branch(self, subtree: Tree) -> list[Any]:
        """Return the matrix times the vector of a subtree, which many trees have; the nodes for a leaf."""
        if subtree not in self.branches:
            self.branches[subtree] = self.applied(self.tree(subtree))
        return self.branches[subtree]

    def word(self, word: Word) -> list[Any]:
        """Return C^k_1 A C^k_2 A ... C^k_m 1."""
        if word not in self.words:
            first, *rest = word
            if first:
                shorter = self.word((first - 1, *rest))
                self.words[word] = [c * x for c, x in zip(self.nodes, shorter, strict=True)]
            else:
                self.words[word] = self.applied(self.word(tuple(rest))) if rest else self.ones
        return self.words[word]

    def residual(self, vector: list[Any], exact: Fraction) -> Any:
        """Return b' times a vector, minus the exact value."""
        return self.sum(self.weights, vector) - self.rational(exact)

    def row_residuals(self) -> list[Any]:
        """Return the sum of each row minus its node."""
        sums = self.applied(self.ones)
        return [total - node for total, node in zip(sums, self.nodes, strict=True)]

    def tree_residual(self, tree: Tree) -> Any:
        """Return the elementary weight of a tree minus 1/gamma."""
        return self.residual(self.tree(tree), Fraction(1, density(tree)))

    def word_residual(self, word: Word) -> Any:
        """Return the weight of a word minus its coefficient in the exact solution."""
        return self.residual(self.word(word), word_coefficient(word))


@lru_cache(maxsize=32)
def _stages(tableau: Tableau) -> Stages:
    return Stages.of(tableau)


def _holds(tableau: Tableau, defect: Any) -> bool:
    """Return whether a residual is zero, or within the tableau's tolerance for rounded coefficients."""
    if not defect:
        return True
    return bool(tableau.tolerance) and abs(_stages(tableau).number(defect)) <= tableau.tolerance


def row_residuals(tableau: Tableau) -> list[Number]:
    """Return the sum of each row of the matrix minus its node."""
    stages = _stages(tableau)
    return [stages.number(defect) for defect in stages.row_residuals()]


def residuals(tableau: Tableau, order: int) -> list[tuple[Tree, Number]]:
    """Return every tree of an order with its elementary weight minus 1/gamma, which is 0 if the condition holds.

    >>> from strapgen.catalogue.methods.tableaux import TABLEAUX
    >>> residuals(TABLEAUX["rk2"], 3)
    [(((), ()), Fraction(1, 6)), ((((),),), Fraction(-1, 6))]
    """
    stages = _stages(tableau)
    return [(tree, stages.number(stages.tree_residual(tree))) for tree in trees(order)]


def first_failure(tableau: Tableau, order: int) -> tuple[Tree, Number] | None:
    """Return the tree and the residual of the first condition of an order that fails; None if all hold."""
    stages = _stages(tableau)
    for tree in trees(order):
        defect = stages.tree_residual(tree)
        if not _holds(tableau, defect):
            return tree, stages.number(defect)
    return None


def order(tableau: Tableau, most: int = 20, known: int = 0) -> int:
    """Return the classical order of a method, at most `most`; conditions up to the order `known` are taken to hold."""
    return next((p - 1 for p in range(known + 1, most + 1) if first_failure(tableau, p)), most)


def embedded_order(tableau: Tableau) -> int:
    """Return the classical order of the embedded weights."""
    assert tableau.embedded_weights is not None
    return order(replace(tableau, weights=tableau.embedded_weights, embedded_weights=None))


@lru_cache(maxsize=128)
def attitude_order(tableau: Tableau, derivatives: int | None = None) -> int:
    """Return the order of a method on attitude kinematics, or on any x' = A(t) x with A of degree `derivatives` in t.

    It is at least the classical order and can exceed it, since fewer products have to agree. Relations among the
    matrices of one representation are not used, for instance that the square of a rate is a scalar for quaternions. For
    a constant rate, 0, it is the order to which the step agrees with the exponential.

    >>> from strapgen.catalogue.methods.tableaux import TABLEAUX
    >>> attitude_order(TABLEAUX["rk4"]), attitude_order(TABLEAUX["butcher5"], derivatives=0)
    (4, 5)
    """
    stages = _stages(tableau)
    # With s stages the weight of the word (0, ..., 0) of order s + 1 is zero, so the order is at most s.
    most = len(tableau.nodes)
    return next(
        (
            p - 1
            for p in range(1, most + 1)
            for word in words(p, derivatives)
            if not _holds(tableau, stages.word_residual(word))
        ),
        most,
    )


def principal_error_norm(tableau: Tableau) -> float:
    """Return the 2-norm of the error coefficients (Phi - 1/gamma)/sigma of the first order that fails.

    >>> from strapgen.catalogue.methods.tableaux import TABLEAUX
    >>> round(principal_error_norm(TABLEAUX["rk4"]), 6)
    0.014505
    """
    stages = _stages(tableau)
    leading = trees(order(tableau) + 1)
    return math.hypot(
        *(float(stages.number(stages.tree_residual(tree))) / symmetry(tree) for tree in leading)
    )


def conditions(tableau: Tableau) -> int:
    """Return the number of conditions for a tableau's order: its row sums, and the trees up to the order."""
    return len(tableau.nodes) + sum(len(trees(p)) for p in range(1, tableau.order + 1))


def largest_residual(tableau: Tableau) -> Number:
    """Return the largest residual of the row sums and the conditions up to the order, in absolute value."""
    defects = [abs(defect) for defect in row_residuals(tableau)]
    defects += [abs(defect) for p in range(1, tableau.order + 1) for _, defect in residuals(tableau, p)]
    return max(defects)
