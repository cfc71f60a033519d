"""Errors in vector-invariant form: sums of vectors and cross products of the rate and its derivatives.

The form is not unique, because any four vectors, and their products, are linearly dependent. The result is the first
solution in the fixed order of terms of `Frame`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy as sp

from strapgen.symbolic.covariants import Coefficients, Decomposition, Frame
from strapgen.symbolic.evaluation import exact
from strapgen.symbolic.polynomials import Polynomial

#: Denominators from here on are those of rounded decimals.
_DECIMAL = 10**16


@dataclass(frozen=True)
class Invariants:
    """The drift and the symmetric part of an error matrix at one power of the step.

    Parameters
    ----------
    drift : Coefficients
        Coefficients of the vectors i and of the cross products (i, j), where i is the i-th derivative of the rate; each
        a polynomial in scalar products.
    symmetric : Coefficients
        Coefficients of the unit matrix (), and of the symmetrized products a b' + b a': those of i and j as (i, j),
        those of i and j x k as (i, j, k).
    """

    drift: Coefficients
    symmetric: Coefficients


def invariants(
    frame: Frame, matrix: Sequence[Any], shown: Callable[[Fraction], Fraction] = Fraction
) -> Invariants:
    """Return an error matrix in vector-invariant form.

    Parameters
    ----------
    frame : Frame
    matrix : sequence of ring element
        Row by row, in the coordinates of the frame; over the rational numbers or a field of roots. In such a field
        each power of the generator is decomposed separately.
    shown : callable, optional
        Rounds a rational coefficient; coefficients that become zero are omitted.

    Returns
    -------
    Invariants

    Raises
    ------
    NotCovariantError
        If the matrix does not commute with rotations of the vectors.
    """
    domain = matrix[0].ring.domain
    if domain == sp.QQ:
        decomposition = frame.matrix(list(matrix))
        return Invariants(
            _scaled(_rounded(decomposition.vector, shown), Fraction(-1)),
            _rounded(decomposition.symmetric, shown),
        )
    drift: Coefficients = {}
    symmetric: Coefficients = {}
    for power in range(domain.mod.degree()):
        share = domain.ext.as_expr() ** power
        decomposition = frame.matrix([_share(frame, element, power) for element in matrix])
        _add(drift, _scaled(decomposition.vector, -share))
        _add(symmetric, _scaled(decomposition.symmetric, share))
    return Invariants(drift, symmetric)


def _rounded(coefficients: Coefficients, shown: Callable[[Fraction], Fraction]) -> Coefficients:
    rounded = {
        c: {m: shown(x) for m, x in polynomial.items() if shown(x)} for c, polynomial in coefficients.items()
    }
    return {c: polynomial for c, polynomial in rounded.items() if polynomial}


def _share(frame: Frame, element: Any, power: int) -> Any:
    """Return the rational polynomial that multiplies a power of the generator of a field of roots."""
    terms = {}
    for place, number in element.terms():
        numbers = number.to_list()[::-1]
        if power < len(numbers) and numbers[power]:
            terms[place] = numbers[power]
    return frame.ring.from_dict(terms)


def _add(total: Coefficients, more: Coefficients) -> None:
    for covariant, polynomial in more.items():
        sums = total.setdefault(covariant, {})
        for monomial, number in polynomial.items():
            sums[monomial] = sums[monomial] + number if monomial in sums else number


def _scaled(coefficients: Coefficients, factor: Any) -> Coefficients:
    return {
        c: {
            m: x * factor if isinstance(factor, Fraction) else exact(x) * factor
            for m, x in polynomial.items()
        }
        for c, polynomial in coefficients.items()
    }


def matrix(found: Invariants, vectors: Sequence[Sequence[Any]]) -> list[Any]:
    """Return the error matrix row by row for vectors of numbers, symbols or polynomials."""
    return Decomposition(None, _scaled(found.drift, Fraction(-1)), found.symmetric).evaluate(
        [list(vector) for vector in vectors]
    )


def scalar(frame: Frame, element: Any) -> Polynomial:
    """Return a scalar as a polynomial in scalar products.

    Parameters
    ----------
    frame : Frame
    element : ring element
        The scalar in the coordinates of the frame, over the rational numbers or a field of roots.
    """
    domain = element.ring.domain
    if domain == sp.QQ:
        return frame.quaternion([frame.ring.zero] * 3, element).scalar or {}
    total: Coefficients = {}
    for power in range(domain.mod.degree()):
        part = frame.quaternion([frame.ring.zero] * 3, _share(frame, element, power)).scalar or {}
        _add(total, _scaled({(): part}, domain.ext.as_expr() ** power))
    return total.get((), {})


def scalar_value(polynomial: Polynomial, vectors: Sequence[Sequence[Any]]) -> Any:
    """Return the value of a polynomial in scalar products for vectors of numbers, symbols or polynomials."""
    return Decomposition(polynomial, {}, {}).evaluate([list(vector) for vector in vectors])[3]


@dataclass(frozen=True)
class Notation:
    """Patterns in which invariants are written.

    Parameters
    ----------
    vector, length, dot, cross, triple, symmetric, unit, power : str
        Patterns: of a derivative of the rate by its number, of the length, the scalar, the cross and the triple product
        of vectors, of the symmetrized product of two vectors, of the unit matrix, and of a power.
    space : str
        What stands between factors.
    number : callable
        Writes a number above 0.
    """

    vector: str
    length: str
    dot: str
    cross: str
    triple: str
    symmetric: str
    unit: str
    power: str
    number: Callable[[sp.Expr], str]
    space: str = " "


def _plain(size: sp.Expr) -> str:
    if size.is_Rational:  # as a decimal where the method's own coefficients are decimals
        return str(size) if size.q < _DECIMAL else f"{float(size):.11e}"
    return f"({size})"


def _typeset(size: sp.Expr) -> str:
    return str(sp.latex(size if not size.is_Rational or size.q < _DECIMAL else sp.Float(size, 12)))


TEXT = Notation("w{}", "|{}|", "({} . {})", "{} x {}", "({} . {} x {})", "S({}, {})", "1", "{}^{}", _plain)
LATEX = Notation(
    r"\boldsymbol\omega_{{{}}}",
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


def scalar_as_text(polynomial: Polynomial, notation: Notation = TEXT) -> str:
    """Return a polynomial in scalar products as text.

    Examples
    --------
    >>> scalar_as_text({((0, 0), (0, 0)): Fraction(1, 4), ((0, 2),): Fraction(-1)})
    '-(w0 . w2) + 1/4 |w0|^4'
    """
    return _sum({(): polynomial}, notation, lambda _: "")


def as_text(coefficients: Coefficients, symmetric: bool = False, notation: Notation = TEXT) -> str:
    """Return a vector or a symmetric matrix as text, its terms in a fixed order.

    Parameters
    ----------
    coefficients : Coefficients
    symmetric : bool, optional
        Whether it is a matrix: then S(a, b) is a b' + b a', and 1 the unit matrix.
    notation : Notation, optional

    Examples
    --------
    >>> as_text({(0,): {((0, 0),): Fraction(1, 6)}, (0, 1): {(): Fraction(-1, 12)}})
    '1/6 |w0|^2 w0 - 1/12 w0 x w1'
    >>> as_text({(): {((0, 0),): Fraction(-1)}, (0, 0): {(): Fraction(1, 2)}}, symmetric=True)
    '-|w0|^2 1 + 1/2 S(w0, w0)'
    """

    def covariant(indices: tuple[int, ...]) -> str:
        words = [notation.vector.format(i) for i in indices]
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
            size = abs(number)
            factors = [*_products(monomial, notation), covariant(indices)]
            shown = [factor for factor in factors if factor]
            if size != 1 or not shown:
                shown.insert(0, notation.number(size))
            terms.append(("-" if number < 0 else "+", notation.space.join(shown)))
    if not terms:
        return "0"
    (sign, first), *rest = terms
    text = f"-{first}" if sign == "-" else first
    return text + "".join(f" {sign} {term}" for sign, term in rest)


def _products(monomial: Sequence[tuple[int, ...]], notation: Notation) -> list[str]:
    factors = []
    for product, power in Counter(monomial).items():
        words = [notation.vector.format(i) for i in product]
        if len(product) == 3:
            text = notation.triple.format(*words)
        elif product[0] == product[1]:
            text, power = notation.length.format(words[0]), 2 * power
        else:
            text = notation.dot.format(*words)
        factors.append(text if power == 1 else notation.power.format(text, power))
    return factors
