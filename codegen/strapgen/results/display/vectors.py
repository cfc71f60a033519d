"""The vector form of a step as LaTeX, in the letters of the literature."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from fractions import Fraction

from strapgen.kernel.polynomials import Polynomial
from strapgen.lowering.canonical.vector_form import Sum, VectorForm
from strapgen.results.display.latex import equations, sum_text

#: Letters for scalar products; C is the direction cosine matrix, I the unit matrix, S a symmetrized product.
_LETTERS = "ABDEFGHJKLMNPQRTUVWXYZ"
#: Letters of the vectors that have a name.
_NAMED = {"sigma": r"\boldsymbol{\sigma}", "delta": r"\boldsymbol{\delta}"}


def vectors_latex(form: VectorForm, state: str = "") -> str:
    """Return a step in vectors as one align environment: vectors, products, the transition, and its use on a state.

    d_k are the increments, w the rates at nodes times the step, both in rad.
    """
    names = _vector_names(form)
    squares_first = sorted(form.products, key=lambda product: (len(set(product)) > 1, product))
    products = {product: _letter(k) for k, product in enumerate(squares_first)}
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


def _letter(number: int) -> str:
    """Return the letter of a scalar product, numbered once all letters are in use."""
    turn, place = divmod(number, len(_LETTERS))
    return _LETTERS[place] + (f"_{{{turn}}}" if turn else "")


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
    """Return a sum of vectors and cross products; a weight of several terms stands in brackets."""
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
