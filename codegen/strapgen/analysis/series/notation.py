"""Writes vector invariants and intervals of angles as text, for the data and the reports of an analysis."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import sympy as sp

from strapgen.kernel.algebra import exact
from strapgen.kernel.covariants import Coefficients
from strapgen.kernel.polynomials import Polynomial

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
