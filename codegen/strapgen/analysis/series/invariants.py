"""Writes errors in vector-invariant form, as sums of vectors and cross products of the rate and its derivatives.

The form is not unique, because any four vectors, and their products, are linearly dependent. The result is the first
solution in the fixed order of terms of `Frame`. Invariants, sums and intervals of angles have a text here too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import sympy as sp

from strapgen.ir.read_only import ReadOnly
from strapgen.kernel.algebra import exact
from strapgen.kernel.covariants import Coefficients, Decomposition, Frame
from strapgen.kernel.polynomials import Polynomial


@dataclass(frozen=True)
class Invariants(ReadOnly):
    """The drift and the symmetric part of an error matrix at one power of the step."""

    #: Coefficients of the vectors i and of the cross products (i, j), where i is the i-th derivative of the
    #: rate; each a polynomial in scalar products
    drift: Coefficients
    #: Coefficients of the unit matrix (), and of the symmetrized products a b' + b a': those of i and j as (i,
    #: j), those of i and j x k as (i, j, k)
    symmetric: Coefficients


def invariants(
    frame: Frame, matrix: Sequence[Any], shown: Callable[[Fraction], Fraction] = Fraction
) -> Invariants:
    """Return an error matrix in vector-invariant form.

    `matrix`: row by row, in the coordinates of the frame; over the rational numbers or a field of roots. In
    such a field each power of the generator is decomposed separately.
    """
    domain = matrix[0].ring.domain
    if domain == sp.QQ:
        decomposition = frame.matrix(list(matrix))
        return Invariants(
            _scale(_round(decomposition.vector, shown), Fraction(-1)),
            _round(decomposition.symmetric, shown),
        )
    drift: Coefficients = {}
    symmetric: Coefficients = {}
    for share, elements in _shares(frame, matrix):
        decomposition = frame.matrix(elements)
        _add(drift, _scale(decomposition.vector, -share))
        _add(symmetric, _scale(decomposition.symmetric, share))
    return Invariants(_without_zeros(drift), _without_zeros(symmetric))


def _round(coefficients: Coefficients, shown: Callable[[Fraction], Fraction]) -> Coefficients:
    rounded = {
        c: {m: shown(x) for m, x in polynomial.items() if shown(x)} for c, polynomial in coefficients.items()
    }
    return {c: polynomial for c, polynomial in rounded.items() if polynomial}


def _shares(frame: Frame, elements: Sequence[Any]) -> list[tuple[sp.Expr, list[Any]]]:
    """Return elements as sums of rational ones, each times an expression in roots and unknowns."""
    domain, divisor = elements[0].ring.domain, sp.S.One
    coefficients = [dict(element.terms()) for element in elements]
    if domain.is_Frac:  # all quotients get one divisor
        common = domain.get_ring().one
        for quotient in (c for row in coefficients for c in row.values()):
            common = common.lcm(quotient.denom)
        divisor, domain = common.as_expr(), domain.get_ring()
        coefficients = [
            {place: c.numer * common.exquo(c.denom) for place, c in row.items()} for row in coefficients
        ]
    terms: dict[sp.Expr, list[dict[Any, Any]]] = {}
    for number, row in enumerate(coefficients):
        for place, coefficient in row.items():
            for share, rational in _rational_parts(domain, coefficient):
                terms.setdefault(share / divisor, [{} for _ in elements])[number][place] = rational
    return [(share, [frame.ring.from_dict(row) for row in rows]) for share, rows in terms.items()]


def _rational_parts(domain: Any, number: Any) -> Iterator[tuple[sp.Expr, Any]]:
    """Yield the terms of a number of a domain: expressions in its generators, and their rational factors."""
    if domain.is_Poly:
        for exponents, coefficient in number.terms():
            product = sp.Mul(*(x**k for x, k in zip(domain.symbols, exponents, strict=True)))
            for share, rational in _rational_parts(domain.domain, coefficient):
                yield share * product, rational
    elif domain == sp.QQ:
        yield sp.S.One, number
    else:
        for power, rational in enumerate(number.to_list()[::-1]):
            if rational:
                yield domain.ext.as_expr() ** power, rational


def _without_zeros(coefficients: Coefficients) -> Coefficients:
    """Return coefficients without those whose parts cancel, which they may if they are quotients."""
    simple = {
        c: {m: exact(x) if exact(x).is_polynomial() else sp.cancel(x) for m, x in row.items()}
        for c, row in coefficients.items()
    }
    simple = {c: {m: x for m, x in row.items() if x != 0} for c, row in simple.items()}
    return {c: row for c, row in simple.items() if row}


def _add(total: Coefficients, more: Coefficients) -> None:
    for covariant, polynomial in more.items():
        sums = total.setdefault(covariant, {})
        for monomial, number in polynomial.items():
            sums[monomial] = sums[monomial] + number if monomial in sums else number


def _scale(coefficients: Coefficients, factor: Any) -> Coefficients:
    return {
        c: {
            m: x * factor if isinstance(factor, Fraction) else exact(x) * factor
            for m, x in polynomial.items()
        }
        for c, polynomial in coefficients.items()
    }


def matrix(parts: Invariants, vectors: Sequence[Sequence[Any]]) -> list[Any]:
    """Return the error matrix row by row for vectors of numbers, symbols or polynomials."""
    return Decomposition(None, _scale(parts.drift, Fraction(-1)), parts.symmetric).evaluate(
        [list(vector) for vector in vectors]
    )


def scalar_invariants(frame: Frame, element: Any) -> Polynomial:
    """Return a scalar as a polynomial in scalar products.

    `element`: the scalar in the coordinates of the frame, over the rational numbers or a field of roots.
    """
    domain = element.ring.domain
    if domain == sp.QQ:
        return frame.quaternion([frame.ring.zero] * 3, element).scalar or {}
    total: Coefficients = {}
    for share, (rational,) in _shares(frame, [element]):
        part = frame.quaternion([frame.ring.zero] * 3, rational).scalar or {}
        _add(total, _scale({(): part}, share))
    return _without_zeros(total).get((), {})


def vector_invariants(frame: Frame, elements: Sequence[Any]) -> Coefficients:
    """Return a vector as a sum of vectors and cross products.

    `elements`: the vector in the coordinates of the frame, over the rational numbers or a field of roots.
    """
    domain = elements[0].ring.domain
    if domain == sp.QQ:
        return frame.quaternion(list(elements), frame.ring.zero).vector
    total: Coefficients = {}
    for share, rationals in _shares(frame, elements):
        _add(total, _scale(frame.quaternion(rationals, frame.ring.zero).vector, share))
    return _without_zeros(total)


def scalar_value(polynomial: Polynomial, vectors: Sequence[Sequence[Any]]) -> Any:
    """Return the value of a polynomial in scalar products for vectors of numbers, symbols or polynomials."""
    return Decomposition(polynomial, {}, {}).evaluate([list(vector) for vector in vectors])[3]


#: Denominators from here on are those of rounded decimals.
_DECIMAL = 10**16


@dataclass(frozen=True)
class Notation:
    """Patterns in which invariants are written."""

    #: Writes a vector by its number; by default a derivative of the rate
    vector: Callable[[int], str]
    #: Patterns: of the length, the scalar, the cross and the triple product of vectors, of the symmetrized
    #: product of two vectors, of the unit matrix, and of a power
    length: str
    dot: str
    cross: str
    triple: str
    symmetric: str
    unit: str
    power: str
    #: Writes a number above 0
    number: Callable[[sp.Expr], str]
    #: What stands between factors
    space: str = " "


def _plain(size: sp.Expr) -> str:
    if size.is_Rational:  # as a decimal where the method's own coefficients are decimals
        return str(size) if size.q < _DECIMAL else f"{float(size):.11e}"
    return f"({size})"


def _typeset(size: sp.Expr) -> str:
    if size.is_Add and size.free_symbols:
        return rf"\left({sp.latex(size)}\right)"
    return str(sp.latex(size if not size.is_Rational or size.q < _DECIMAL else sp.Float(size, 12)))


TEXT = Notation(
    "w{}".format, "|{}|", "({} . {})", "{} x {}", "({} . {} x {})", "S({}, {})", "1", "{}^{}", _plain
)
LATEX = Notation(
    r"\boldsymbol\omega_{{{}}}".format,
    r"|{}|",
    r"({} \cdot {})",
    r"{} \times {}",
    r"({} \cdot {} \times {})",
    r"\mathrm{{S}}({}, {})",
    r"\mathbf{I}",
    "{}^{{{}}}",
    _typeset,
    r"\,",
)


def with_forces(notation: Notation, rates: int, force: Callable[[int], str] = "f{}".format) -> Notation:
    """Return a notation whose vectors from a number on are derivatives of the specific force.

    >>> from fractions import Fraction
    >>> covariant_text({(0, 3): {(): Fraction(1, 2)}}, notation=with_forces(TEXT, 2))
    '1/2 w0 x f1'
    """
    return replace(notation, vector=lambda i: notation.vector(i) if i < rates else force(i - rates))


def scalar_text(polynomial: Polynomial, notation: Notation = TEXT) -> str:
    """Return a polynomial in scalar products as text.

    >>> from fractions import Fraction
    >>> scalar_text({((0, 0), (0, 0)): Fraction(1, 4), ((0, 2),): Fraction(-1)})
    '-(w0 . w2) + 1/4 |w0|^4'
    """
    return _sum({(): polynomial}, notation, lambda _: "")


def covariant_text(coefficients: Coefficients, symmetric: bool = False, notation: Notation = TEXT) -> str:
    """Return a vector or a symmetric matrix as text, its terms in a fixed order.

    `symmetric`: whether it is a matrix: then S(a, b) is a b' + b a', and 1 the unit matrix.

    >>> from fractions import Fraction
    >>> covariant_text({(0,): {((0, 0),): Fraction(1, 6)}, (0, 1): {(): Fraction(-1, 12)}})
    '1/6 |w0|^2 w0 - 1/12 w0 x w1'
    >>> covariant_text({(): {((0, 0),): Fraction(-1)}, (0, 0): {(): Fraction(1, 2)}}, symmetric=True)
    '-|w0|^2 1 + 1/2 S(w0, w0)'
    """

    def covariant(indices: tuple[int, ...]) -> str:
        words = [notation.vector(i) for i in indices]
        if not symmetric:
            return notation.cross.format(*words) if len(words) > 1 else words[0]
        if not words:
            return notation.unit
        second = notation.cross.format(*words[1:]) if len(words) > 2 else words[1]
        return notation.symmetric.format(words[0], second)

    return _sum(coefficients, notation, covariant)


def _sum(coefficients: Coefficients, notation: Notation, covariant: Callable[[tuple[int, ...]], str]) -> str:
    terms = []
    for indices in sorted(coefficients, key=lambda c: (len(c), c)):
        polynomial = coefficients[indices]
        for monomial in sorted(polynomial, key=lambda m: (len(m), m)):
            number = exact(polynomial[monomial])
            negative = number.could_extract_minus_sign() if number.free_symbols else number < 0
            size = -number if negative else number
            factors = [*_products(monomial, notation), covariant(indices)]
            shown = [factor for factor in factors if factor]
            if size != 1 or not shown:
                shown.insert(0, notation.number(size))
            terms.append(("-" if negative else "+", notation.space.join(shown)))
    if not terms:
        return "0"
    (sign, first), *rest = terms
    text = f"-{first}" if sign == "-" else first
    return text + "".join(f" {sign} {term}" for sign, term in rest)


def _products(monomial: Sequence[tuple[int, ...]], notation: Notation) -> list[str]:
    factors = []
    for product, power in Counter(monomial).items():
        words = [notation.vector(i) for i in product]
        if len(product) == 3:
            text = notation.triple.format(*words)
        elif product[0] == product[1]:
            text, power = notation.length.format(words[0]), 2 * power
        else:
            text = notation.dot.format(*words)
        factors.append(text if power == 1 else notation.power.format(text, power))
    return factors


def intervals_text(intervals: Sequence[tuple[float, float | None]] | None) -> str:
    """Return intervals as text.

    >>> intervals_text([(0.0, 2.8284271)]), intervals_text([]), intervals_text(None)
    ('0 to 2.828', 'nowhere', 'kept')
    """
    if intervals is None:
        return "kept"
    parts = [f"{low:.4g} up" if high is None else f"{low:.4g} to {high:.4g}" for low, high in intervals]
    return ", ".join(parts) or "nowhere"


def sum_text(terms: Mapping[int, sp.Expr], symbol: sp.Symbol) -> str:
    """Return the sum of terms by power of a symbol as text that SymPy can read."""
    return str(sp.sstr(sp.Add(*(x * symbol**power for power, x in terms.items())), order="lex"))


def vector_texts(terms: Mapping[int, Sequence[sp.Expr]], symbol: sp.Symbol) -> list[str]:
    """Return the elements of vectors, by power of a symbol, as sums; three zeros for no terms."""
    return [sum_text({power: row[axis] for power, row in terms.items()}, symbol) for axis in range(3)]
