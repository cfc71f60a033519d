"""Steps and stages of kernels in LaTeX, as sums and products of vectors, quaternions and matrices where they are."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy as sp
from sympy.polys.matrices import DomainMatrix

from strapgen.ir.signals import Signal
from strapgen.kernel import algebra
from strapgen.kernel.kernel import Kernel, Stage
from strapgen.kernel.polynomials import Polynomial
from strapgen.lowering.canonical.vector_form import Sum, VectorForm
from strapgen.results.display.latex import equations, sum_text

#: Letters of the quantities that have one in the literature; the rest of a name is its index.
_LETTERS = {
    "half_turn": r"\boldsymbol{\vartheta}",
    "turn": r"\mathbf{w}",
    "slope": r"\mathbf{k}",
    "point": r"\mathbf{x}",
    "moment": r"\boldsymbol{\mu}",
    "phi": r"\boldsymbol{\phi}",
    "half_rate": r"\mathbf{h}",
    "rate": r"\mathbf{r}",
    "term": r"\mathbf{t}",
}
#: A sum of terms in polynomial form: coefficients by element and monomial.
_Terms = dict[tuple[int, tuple[int, ...]], sp.Rational]


@dataclass(frozen=True)
class _Quantity:
    """A vector, a quaternion, a matrix or a scalar with its symbols and its letter."""

    kind: str
    elements: tuple[sp.Expr, ...]
    letter: str

    @property
    def matrix(self) -> sp.Matrix:
        return sp.Matrix(3, 3, self.elements)

    @property
    def quaternion(self) -> sp.Matrix:
        """The quaternion, or that of a vector, whose scalar part is 0."""
        return sp.Matrix([*self.elements, *([0] if self.kind == "vector" else [])])

    @property
    def skew(self) -> sp.Matrix:
        return algebra.skew(sp.Matrix(self.elements))


def stages_latex(kernel: Kernel) -> str | None:
    r"""Return the stages and outputs of a kernel as one align environment; None if one of them is no such sum.

    A vector in a sum or product of quaternions stands for that with the scalar part 0, and 1 for the unit quaternion;
    \mathbf{a} \circ \mathbf{b} is their product, \exp the quaternion of half a rotation vector, or the matrix of one.
    """
    known = [quantity for signal in kernel.inputs for quantity in _inputs(signal)]
    rows = []
    domain = sp.QQ.frac_field(*_symbols(kernel.unknowns)) if kernel.unknowns else sp.QQ
    for stage in (*kernel.stages, *kernel.outputs):
        quantity = _quantity(stage.signal, _letter(stage.signal.name, kernel))
        text = None if quantity is None else _right_side(stage, quantity.kind, known, domain)
        if quantity is None or text is None:
            return None
        rows.append((quantity.letter, text))
        known.append(quantity)
    return equations(rows)


def _inputs(signal: Signal) -> Iterator[_Quantity]:
    """Yield an input, or its rows if it is an array of vectors."""
    if len(signal.shape) == 2 and signal.elements[0].endswith("_x"):
        for k in range(0, signal.size, 3):
            name = signal.elements[k].removesuffix("_x")
            yield _Quantity("vector", _symbols(signal.elements[k : k + 3]), _letter_of(name))
    else:
        quantity = _quantity(signal, rf"\mathbf{{{signal.elements[0].partition('_')[0]}}}")
        yield from [] if quantity is None else [quantity]


def _quantity(signal: Signal, letter: str) -> _Quantity | None:
    labels = [element.rpartition("_")[2] for element in signal.elements]
    kinds = {("x", "y", "z"): "vector", ("x", "y", "z", "s"): "quaternion"}
    kind = "matrix" if signal.shape == (3, 3) else "scalar" if not signal.shape else kinds.get(tuple(labels))
    return None if kind is None else _Quantity(kind, _symbols(signal.elements), letter)


def _symbols(names: Sequence[str]) -> tuple[sp.Expr, ...]:
    return tuple(sp.Symbol(name, real=True) for name in names)


def _letter(name: str, kernel: Kernel) -> str:
    """Return the letter of a stage: that of its elements for the transition, and of the state after the step."""
    signals = {stage.signal.name: stage.signal for stage in kernel.stages}
    if name == kernel.transition:
        return rf"\mathbf{{{signals[name].elements[0].partition('_')[0]}}}"
    if name == "next":
        return rf"\mathbf{{{kernel.inputs[0].elements[0].partition('_')[0]}}}^{{+}}"
    return _letter_of(name)


def _letter_of(name: str) -> str:
    """Return the letter of a name with its index, a fraction where that is a node: half_turn_1_3."""
    match = re.fullmatch(r"([a-z_]*?[a-z])_?(\d+(?:_\d+)?)?", name)
    if match is None:
        return rf"\mathbf{{{name.replace('_', ' ')}}}"
    letter = _LETTERS.get(match[1], rf"\mathbf{{{match[1].replace('_', ' ')}}}")
    return letter if match[2] is None else f"{letter}_{{{match[2].replace('_', '/')}}}"


def _right_side(stage: Stage, kind: str, known: Sequence[_Quantity], domain: Any) -> str | None:
    """Return the formula of a stage; None if it is no sum of products of two quantities with numbers of a domain."""
    expressions = [sp.sympify(x) for x in stage.expressions]
    free = set().union(*(x.free_symbols for x in expressions))
    used = [quantity for quantity in known if free & set(quantity.elements)]
    if len(used) == 1 and used[0].kind == "vector" and (text := _exponential(kind, expressions, used[0])):
        return text
    symbols = [symbol for quantity in used for symbol in quantity.elements]
    target = _terms(expressions, symbols, domain)
    if target is None:
        return None
    pairs = {frozenset(k for k, power in enumerate(monomial) if power) for _, monomial in target}
    owner = [place for place, quantity in enumerate(used) for _ in quantity.elements]
    together = {frozenset(owner[k] for k in pair) for pair in pairs}
    candidates = [
        (letters, terms)
        for letters, elements in _templates(kind, used, together)
        if (terms := _terms(elements, symbols, domain)) is not None
    ]
    numbers = _solve(target, [terms for _, terms in candidates], domain)
    if numbers is None:
        return None
    return sum_text([_term(c, letters) for c, (letters, _) in zip(numbers, candidates, strict=True) if c])


def _term(number: sp.Expr, letters: str) -> tuple[Fraction, str]:
    """Return a term of a sum as a number and a factor, which holds what is unknown."""
    if number.is_Rational:
        return Fraction(int(number.p), int(number.q)), letters
    sign = -1 if number.could_extract_minus_sign() else 1
    text = str(sp.latex(sign * number))
    return Fraction(sign), rf"\left({text}\right) {letters}" if number.is_Add else f"{text} {letters}"


def _exponential(kind: str, expressions: Sequence[sp.Expr], vector: _Quantity) -> str | None:
    """Return the exponential of a rotation vector, if the expressions are that."""
    v = sp.Matrix(vector.elements)
    makers: dict[str, tuple[Callable[[sp.Matrix], sp.Matrix], str]] = {
        "quaternion": (algebra.quaternion, rf"\exp(\tfrac{{1}}{{2}} {vector.letter})"),
        "matrix": (algebra.rotation, rf"\exp [{vector.letter}]_{{\times}}"),
    }
    if kind not in makers:
        return None
    make, text = makers[kind]
    return text if list(make(v)) == list(expressions) else None


def _templates(
    kind: str, used: Sequence[_Quantity], together: set[frozenset[int]]
) -> Iterator[tuple[str, Sequence[sp.Expr]]]:
    """Yield the terms that a formula of a kind may have: their letters and their elements."""
    if kind in ("quaternion", "scalar"):
        yield "", [0, 0, 0, 1] if kind == "quaternion" else [1]
    if kind == "matrix":
        yield r"\mathbf{I}", list(sp.eye(3))
    for quantity in used:
        if quantity.kind == kind:
            yield quantity.letter, quantity.elements
        elif quantity.kind == "vector" and kind == "quaternion":
            yield quantity.letter, list(quantity.quaternion)
        elif quantity.kind == "vector" and kind == "matrix":
            yield rf"[{quantity.letter}]_{{\times}}", list(quantity.skew)
    for i, first in enumerate(used):
        for j, second in enumerate(used):
            if frozenset((i, j)) in together:
                yield from _products(kind, first, second)


def _products(kind: str, first: _Quantity, second: _Quantity) -> Iterator[tuple[str, Sequence[sp.Expr]]]:
    """Yield the products of two quantities that are of a kind."""
    kinds, a, b = (first.kind, second.kind), first.letter, second.letter
    if kind == "quaternion" and set(kinds) <= {"vector", "quaternion"}:
        yield rf"{a} \circ {b}", list(algebra.quaternion_product(first.quaternion, second.quaternion))
    elif kind == "vector" and kinds == ("vector", "vector"):
        yield rf"{a} \times {b}", algebra.cross_elements(first.elements, second.elements)
    elif kind == "vector" and kinds == ("matrix", "vector"):
        yield rf"{a} {b}", list(first.matrix * sp.Matrix(second.elements))
    elif kind == "matrix" and kinds == ("matrix", "matrix"):
        yield rf"{a} {b}", list(first.matrix * second.matrix)
        yield rf"{a} {b}^{{T}}", list(first.matrix * second.matrix.T)
    elif kind == "matrix" and kinds == ("matrix", "vector"):
        yield rf"{a} [{b}]_{{\times}}", list(first.matrix * second.skew)
    elif kind == "matrix" and kinds == ("vector", "matrix"):
        yield rf"[{a}]_{{\times}} {b}", list(first.skew * second.matrix)
    elif kind == "scalar" and kinds[0] == kinds[1]:
        yield rf"{a} \cdot {b}", [algebra.dot(first.elements, second.elements)]


def _terms(elements: Sequence[sp.Expr], symbols: Sequence[sp.Expr], domain: Any) -> _Terms | None:
    """Return expressions as coefficients by element and monomial; None if one is no polynomial over the domain."""
    terms: _Terms = {}
    try:
        for place, element in enumerate(elements):
            polynomial = sp.Poly(element, *symbols, domain=domain) if symbols else None
            pairs = polynomial.terms() if polynomial else [((), sp.Rational(element))]
            terms |= {(place, monomial): c for monomial, c in pairs if c}
    except (sp.PolynomialError, sp.CoercionFailed, TypeError, ValueError):
        return None
    return terms


def _solve(target: _Terms, candidates: Sequence[_Terms], domain: Any) -> list[sp.Expr] | None:
    """Return the numbers by which candidates add up to a target, 0 where one is not needed; None if there are none."""
    places = list(dict.fromkeys([*target, *(place for terms in candidates for place in terms)]))
    columns = [*candidates, target]
    rows = [[domain.from_sympy(sp.sympify(terms.get(place, 0))) for terms in columns] for place in places]
    if not rows:
        return [sp.S.Zero] * len(candidates)
    reduced, pivots = DomainMatrix(rows, (len(rows), len(columns)), domain).rref()
    if len(candidates) in pivots:
        return None
    dense = reduced.to_list()
    numbers = [sp.S.Zero] * len(candidates)
    for row, pivot in enumerate(pivots):
        numbers[pivot] = domain.to_sympy(dense[row][-1])
    return numbers


#: Letters for scalar products; C is the direction cosine matrix, I the unit matrix, S a symmetrized product.
_PRODUCT_LETTERS = "ABDEFGHJKLMNPQRTUVWXYZ"
#: Letters of the vectors that have a name.
_NAMED = {"sigma": r"\boldsymbol{\sigma}", "delta": r"\boldsymbol{\delta}"}


def vectors_latex(form: VectorForm, state: str = "") -> str:
    """Return a step in vectors as one align environment: vectors, products, the transition, and its use on a state.

    d_k are the increments, w the rates at nodes times the step, both in rad.
    """
    names = _vector_names(form)
    squares_first = sorted(form.products, key=lambda product: (len(set(product)) > 1, product))
    products = {product: _product_letter(k) for k, product in enumerate(squares_first)}
    terms = {name: zip(coefficients, form.inputs, strict=True) for name, coefficients in form.vectors.items()}
    definitions = [
        (names[name], sum_text([(c, names[i]) for c, i in pairs if c])) for name, pairs in terms.items()
    ]
    definitions += [(letter, _product(product, names)) for product, letter in products.items()]
    rows = []
    if definitions:
        (left, right), *others = definitions
        rows = [(left, r", \quad ".join([right, *(f"{name} = {text}" for name, text in others)]))]
    if form.matrix:
        rows += _matrix(form, names, products)
    else:
        rows.append((r"\mathbf{p}", _sum(form.vector, names, products)))
        rows.append(("p_s", _polynomial(form.scalar, products)))
    if state:
        after = (
            rf"\mathbf{{{state}}} \mathbf{{M}}"
            if form.matrix
            else rf"\mathbf{{{state}}} \circ (\mathbf{{p}}, p_s)"
        )
        rows.append((rf"\mathbf{{{state}}}^{{+}}", after))
    return equations(rows)


def _matrix(
    form: VectorForm, names: Mapping[str, str], products: Mapping[tuple[str, ...], str]
) -> list[tuple[str, str]]:
    """Return the rows of a transition matrix and of its parts."""
    several = len(form.outers) > 1
    partners = {
        name: rf"\mathbf{{y}}_{{{k}}}" if several else r"\mathbf{y}" for k, name in enumerate(form.outers, 1)
    }
    text = r"(1 + \mu) \mathbf{I}" if form.scalar.get((), Fraction(0)) == 1 else r"\mu \mathbf{I}"
    if form.vector:
        text += r" + [\mathbf{v}]_{\times}"
    for name, partner in partners.items():
        vector = names[name]
        text += rf" + {vector} {partner}^{{T}} + {partner} {vector}^{{T}}"
    rows = [(r"\mathbf{M}", text)]
    if form.vector:
        rows.append((r"\mathbf{v}", _sum(form.vector, names, products)))
    rows += [(partner, _sum(form.outers[name], names, products)) for name, partner in partners.items()]
    diagonal = dict(form.scalar)
    if diagonal.get((), Fraction(0)) == 1:
        del diagonal[()]
    return [*rows, (r"\mu", _polynomial(diagonal, products))]


def _vector_names(form: VectorForm) -> dict[str, str]:
    """Return the letters of all vectors; those without a name in the field are numbered."""
    names = {name: _input(name) for name in form.inputs}
    number = 0
    for name in form.vectors:
        number += name not in _NAMED
        names[name] = _NAMED.get(name, rf"\mathbf{{u}}_{{{number}}}")
    return names


def _input(name: str) -> str:
    """Return the letter of an increment, or of the rate at a node times the step."""
    if increment := re.fullmatch(r"([a-z])_?(\d+)", name):
        return rf"\mathbf{{{increment[1]}}}_{{{increment[2]}}}"
    if node := re.fullmatch(r"turn_(\d+)(?:_(\d+))?", name):
        return rf"\mathbf{{w}}_{{{node[1] + (f'/{node[2]}' if node[2] else '')}}}"
    return rf"\mathbf{{{name.replace('_', ' ')}}}"


def _product_letter(number: int) -> str:
    """Return the letter of a scalar product, numbered once all letters are in use."""
    turn, place = divmod(number, len(_PRODUCT_LETTERS))
    return _PRODUCT_LETTERS[place] + (f"_{{{turn}}}" if turn else "")


def _product(product: tuple[str, ...], names: Mapping[str, str]) -> str:
    first, second, *third = (names[name] for name in product)
    return rf"{first} \cdot {second}" + "".join(rf" \times {name}" for name in third)


def _polynomial(polynomial: Polynomial, products: Mapping[tuple[str, ...], str]) -> str:
    """Return a polynomial in products, its terms by their degree."""
    letters = [(sorted(products[product] for product in monomial), c) for monomial, c in polynomial.items()]
    terms = sorted(letters, key=lambda term: (len(term[0]), term[0]))
    return sum_text([(number, _powers(factors)) for factors, number in terms])


def _powers(letters: Sequence[str]) -> str:
    counts = Counter(letters)
    return " ".join(letter if power == 1 else f"{letter}^{{{power}}}" for letter, power in counts.items())


def _sum(terms: Sum, names: Mapping[str, str], products: Mapping[tuple[str, ...], str]) -> str:
    """Return a sum of vectors and cross products; a weight of several terms is in brackets."""
    text = ""
    for vector, weight in sorted(terms.items(), key=lambda term: len(term[0])):
        shown = r" \times ".join(names[name] for name in vector)
        if len(weight) == 1:
            ((monomial, number),) = weight.items()
            term = sum_text([(number, f"{_powers(sorted(products[p] for p in monomial))} {shown}".strip())])
        else:
            term = rf"({_polynomial(weight, products)})\, {shown}"
        joined = f" - {term[1:]}" if term.startswith("-") else f" + {term}"
        text += joined if text else term
    return text or "0"
