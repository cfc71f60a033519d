"""Vectors that are linear in a step's input vectors, and their scalar products, with few operations."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from operator import add, sub

from strapgen.kernel.polynomials import Polynomial, atom, atoms, substitute

#: Coefficients of the input vectors.
Form = tuple[Fraction, ...]


@dataclass(frozen=True)
class _Vector:
    """A named vector."""

    name: str
    form: Form  # its coefficients along the input vectors
    parts: tuple[tuple[Fraction, str], ...] = ()  # the vectors whose sum it is; empty for an input
    meaning: str = ""

    @property
    def operations(self) -> int:
        """Number of scalar operations that the vector takes."""
        products = sum(abs(coefficient) != 1 for coefficient, _ in self.parts)
        return 3 * (products + max(len(self.parts) - 1, 0))


def proportion(a: Form, b: Form) -> Fraction | None:
    """Return the number c with a = c b, None if there is none."""
    if not any(b) or any(bool(x) is not bool(y) for x, y in zip(a, b, strict=True)):
        return None
    k = next(k for k, x in enumerate(b) if x)
    c = a[k] / b[k]
    return c if all(x == c * y for x, y in zip(a, b, strict=True)) else None


def normalized(form: Form) -> Form:
    """Return a form scaled so that most of its coefficients are 1 or -1, the first one positive."""
    counts = Counter(abs(x) for x in form if x)
    most = max(counts.values())
    unit = max(x for x, number in counts.items() if number == most)
    first = next(x for x in form if x)
    return tuple(x / (unit if first > 0 else -unit) for x in form)


def mirrored(form: Form) -> Form:
    """Return the form with the input vectors in the opposite order."""
    return form[::-1]


def independent(forms: Sequence[Form]) -> list[int]:
    """Return the indices of the first forms that span all of them."""
    rows: list[list[Fraction]] = []
    chosen = []
    for place, form in enumerate(forms):
        row = list(form)
        for other in rows:
            pivot = next(k for k, x in enumerate(other) if x)
            if row[pivot]:
                factor = row[pivot] / other[pivot]
                row = [x - factor * y for x, y in zip(row, other, strict=True)]
        if any(row):
            rows.append(row)
            chosen.append(place)
    return chosen


def components(form: Form, basis: Sequence[Form]) -> list[Fraction]:
    """Return the components of a form along a basis, see `all_components`."""
    return all_components([form], basis)[0]


def all_components(forms: Sequence[Form], basis: Sequence[Form]) -> list[list[Fraction]]:
    """Return the components of each of some forms along a basis of independent forms that spans them."""
    rows = [list(row) for row in zip(*basis, *forms, strict=True)]
    count = len(basis)
    for pivot in range(count):
        k = next(k for k in range(pivot, len(rows)) if rows[k][pivot])
        rows[pivot], rows[k] = rows[k], rows[pivot]
        if (unit := rows[pivot][pivot]) != 1:
            rows[pivot] = [x / unit for x in rows[pivot]]
        for other in range(len(rows)):
            if other != pivot and rows[other][pivot]:
                factor = rows[other][pivot]
                rows[other] = [
                    x - factor * y if y else x for x, y in zip(rows[other], rows[pivot], strict=True)
                ]
    if any(any(row[count:]) for row in rows[count:]):
        raise ValueError("a form lies outside the span of the basis")
    return [[row[count + k] for row in rows[:count]] for k in range(len(forms))]


class Pool:
    """The vectors that have a name, each defined once, in the order of computation."""

    def __init__(self, inputs: list[str], names: dict[Form, tuple[str, str]]) -> None:
        self._inputs = inputs
        self._names = names
        self.vectors: dict[str, _Vector] = {}
        for k, name in enumerate(inputs):
            form = tuple(Fraction(int(k == j)) for j in range(len(inputs)))
            self.vectors[name] = _Vector(name, form)

    def copy(self) -> Pool:
        """Return a pool to which vectors can be added without changing this one."""
        other = Pool(self._inputs, self._names)
        other.vectors = dict(self.vectors)
        return other

    def operations(self, names: Iterable[str]) -> int:
        """Return the number of scalar operations of vectors and their parts; names outside the pool are free."""
        needed = set(names)
        for vector in reversed(self.vectors.values()):
            if vector.name in needed:
                needed |= {name for _, name in vector.parts}
        return sum(vector.operations for vector in self.vectors.values() if vector.name in needed)

    def find(self, form: Form) -> tuple[str, Fraction] | None:
        """Return the vector that is proportional to a form, and the ratio form / vector; None if there is none."""
        for vector in self.vectors.values():
            factor = proportion(form, vector.form)
            if factor is not None:
                return vector.name, factor
        return None

    def define(self, form: Form) -> tuple[str, Fraction]:
        """Return the vector that is proportional to a form, and the ratio form / vector; define it if it is new."""
        known = self.find(form)
        if known:
            return known
        unit = normalized(form)
        self._add(unit, self._sum_of_two(unit) or self._sum_of_pairs(unit) or self._sum_of_inputs(unit))
        return self.define(form)

    def define_mirrored(self, form: Form) -> None:
        """Define a form and its mirror image together, as the sum and the difference of their even and odd halves."""
        other = mirrored(form)
        halves = [tuple((x + s * y) / 2 for x, y in zip(form, other, strict=True)) for s in (1, -1)]
        if not all(map(any, halves)):
            return
        even = normalized(halves[0])
        scale = proportion(even, halves[0]) or Fraction(1)
        odd = tuple(scale * x for x in halves[1])
        names = []
        for half in (even, odd):
            known = self.find(half)
            if known is None:
                names.append(self._add(half, self._sum_of_pairs(half) or self._sum_of_inputs(half)))
            elif known[1] == 1:
                names.append(known[0])
            else:
                return
        for sign in (1, -1):
            whole = tuple(x + sign * y for x, y in zip(even, odd, strict=True))
            if self.find(whole) is None:
                self._add(whole, ((Fraction(1), names[0]), (Fraction(sign), names[1])))

    def _add(self, form: Form, parts: tuple[tuple[Fraction, str], ...]) -> str:
        name, meaning = self._named(form, parts)
        self.vectors[name] = _Vector(name, form, parts, meaning)
        return name

    def _sum_of_two(self, form: Form) -> tuple[tuple[Fraction, str], ...] | None:
        """Return a form as the sum or difference of two vectors of the pool; None if it is not one."""
        names = list(self.vectors)
        for k, first in enumerate(names):
            for second in names[k + 1 :]:
                a, b = self.vectors[first].form, self.vectors[second].form
                for sign, combined in ((1, map(add, a, b)), (-1, map(sub, a, b))):
                    factor = proportion(form, tuple(combined))
                    if factor is not None and abs(factor) == 1:
                        return (factor, first), (factor * sign, second)
        return None

    def _sum_of_pairs(self, form: Form) -> tuple[tuple[Fraction, str], ...] | None:
        """Return a form that is even or odd in time as sums or differences of pairs of inputs; None for others."""
        sign = next((s for s in (1, -1) if form == tuple(s * x for x in mirrored(form))), None)
        count = len(form)
        if sign is None or sum(map(bool, form)) < 3:
            return None
        parts = []
        for k in range((count + 1) // 2):
            if not form[k]:
                continue
            pair = [Fraction(0)] * count
            pair[k] += 1
            if k != count - 1 - k:
                pair[count - 1 - k] += sign
            name, factor = self.define(tuple(pair))
            parts.append((form[k] * factor, name))
        return tuple(parts)

    def _sum_of_inputs(self, form: Form) -> tuple[tuple[Fraction, str], ...]:
        return tuple((x, name) for x, name in zip(form, self._inputs, strict=True) if x)

    def _named(self, form: Form, parts: tuple[tuple[Fraction, str], ...]) -> tuple[str, str]:
        for known, (name, meaning) in self._names.items():
            factor = proportion(form, known)
            if factor is None:
                continue
            if factor != 1:
                name = f"minus_{name}" if factor == -1 else f"{name}_scaled"
                meaning = f"{meaning}, times {factor}" if meaning else ""
            if name not in self.vectors:
                return name, meaning
        if len(parts) == 2 and all(abs(coefficient) == 1 for coefficient, _ in parts):
            (a, first), (b, second) = sorted(parts, key=lambda part: part[0] < 0)
            name = f"{first}_{'plus' if b > 0 else 'minus'}_{second}"
            if a > 0 and name not in self.vectors:
                return name, ""
        kind = next(
            (k for k, s in (("even", 1), ("odd", -1)) if form == tuple(s * x for x in mirrored(form))),
            "mixed",
        )
        number = 1 + sum(name.split("_")[0] == kind for name in self.vectors)
        name = kind if number == 1 else f"{kind}_{number}"
        return name, "a combination of the inputs" + ("" if kind == "mixed" else f", {kind} in time")


#: The weight of a scalar product in the cost, in factors of a term.
_PRODUCT = 3


def choose_products(
    polynomials: Sequence[Polynomial], basis: Sequence[tuple[str, Form]], offered: dict[str, Form]
) -> list[Polynomial]:
    """Rewrite polynomials in products (i, j) and (i, j, k) of a basis in the scalar products that make them shortest.

    One product after another is exchanged for another product of the vectors on offer, those of the basis and others in
    its span, as long as that saves operations. The result is in products of names, (name, name) and (name, name, name).
    """
    names = [name for name, _ in basis]
    current = [substitute(p, lambda factor: atom(tuple(names[k] for k in factor))) for p in polynomials]
    # Every product on offer is written in products of the basis; each exchange rewrites these expansions too.
    expansions: dict[tuple[str, ...], Polynomial] = {}
    along = {name: components(form, [form for _, form in basis]) for name, form in offered.items()}
    for a, b in itertools.combinations_with_replacement(offered, 2):
        total: dict[tuple[str, ...], Fraction] = {}
        for (i, x), (j, y) in itertools.product(enumerate(along[a]), enumerate(along[b])):
            if x and y:
                key = tuple(names[k] for k in sorted((i, j)))
                total[key] = total.get(key, Fraction(0)) + x * y
        expansions[a, b] = {(key,): value for key, value in total.items() if value}
    cost = _cost(current)
    while True:
        best = None
        used = {name for name in atoms(current) if len(name) == 2}
        for new, expansion in expansions.items():
            if new in used:
                continue
            for (old,), coefficient in expansion.items():
                if old not in used or {(old,)} == expansion.keys():
                    continue
                value = {m: -c / coefficient for m, c in expansion.items() if m != (old,)}
                value[new,] = 1 / coefficient
                tried = [_exchange(p, old, value) for p in current]
                if (reduced := _cost(tried)) < cost:
                    cost, best = reduced, (new, old, value, tried)
        if best is None:
            return current
        new, old, value, current = best
        expansions = {key: _exchange(p, old, value) for key, p in expansions.items()}


def _exchange(p: Polynomial, old: tuple[str, ...], value: Polynomial) -> Polynomial:
    if not any(old in monomial for monomial in p):
        return p
    return substitute(p, lambda name: value if name == old else atom(name))


def _cost(polynomials: Sequence[Polynomial]) -> int:
    distinct = {frozenset(p.items()): p for p in polynomials}.values()
    terms = sum(len(monomial) for p in distinct for monomial in p)
    return terms + _PRODUCT * len(atoms(polynomials))
