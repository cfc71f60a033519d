"""Errors in vector-invariant form: sums of vectors and cross products of the rate and its derivatives.

That form is not unique: three vectors in a plane are dependent, and so are the products of four. What is found is the
first solution in a fixed order of terms, the one of `Frame`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import sympy as sp

from strapgen.algebra import exact
from strapgen.lowering.canonical.decomposition import Coefficients, Decomposition, Frame
from strapgen.lowering.polynomials import Polynomial

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
        Coefficients of the unit matrix () and of the symmetrized products a b' + b a': (i, j), and (i, j, k) of i and
        j x k.
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
        Row by row, in the coordinates of the frame; over the rational numbers or a field of roots, whose elements are
        decomposed one power of its generator after the other.
    shown : callable, optional
        Rounds a rational coefficient; what it makes zero is left out.
    """
    domain = matrix[0].ring.domain
    if domain == sp.QQ:
        found = frame.matrix(list(matrix))
        return Invariants(_scaled(_rounded(found.vector, shown), Fraction(-1)), _rounded(found.symmetric, shown))
    drift: Coefficients = {}
    symmetric: Coefficients = {}
    for power in range(domain.mod.degree()):
        share = domain.ext.as_expr() ** power
        found = frame.matrix([_share(frame, element, power) for element in matrix])
        _add(drift, _scaled(found.vector, -share))
        _add(symmetric, _scaled(found.symmetric, share))
    return Invariants(drift, symmetric)


def _rounded(coefficients: Coefficients, shown: Callable[[Fraction], Fraction]) -> Coefficients:
    rounded = {
        c: {m: shown(x) for m, x in polynomial.items() if shown(x)} for c, polynomial in coefficients.items()
    }
    return {c: polynomial for c, polynomial in rounded.items() if polynomial}


def _share(frame: Frame, element: Any, power: int) -> Any:
    """Return the rational polynomial that belongs to a power of the generator of a field of roots."""
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
        c: {m: x * factor if isinstance(factor, Fraction) else exact(x) * factor for m, x in polynomial.items()}
        for c, polynomial in coefficients.items()
    }


def matrix(found: Invariants, vectors: Sequence[Sequence[Any]]) -> list[Any]:
    """Return the error matrix row by row for given vectors: numbers, symbols or polynomials."""
    return Decomposition(None, _scaled(found.drift, Fraction(-1)), found.symmetric).evaluate(
        [list(vector) for vector in vectors]
    )


def scalar(frame: Frame, element: Any) -> Polynomial:
    """Return a scalar, given in the coordinates of a frame, as a polynomial in scalar products.

    Parameters
    ----------
    frame : Frame
    element : ring element
        Over the rational numbers or a field of roots.
    """
    domain = element.ring.domain
    if domain == sp.QQ:
        return frame.quaternion([frame.ring.zero] * 3, element).scalar or {}
    total: Coefficients = {}
    for power in range(domain.mod.degree()):
        found = frame.quaternion([frame.ring.zero] * 3, _share(frame, element, power)).scalar or {}
        _add(total, _scaled({(): found}, domain.ext.as_expr() ** power))
    return total.get((), {})


def scalar_value(polynomial: Polynomial, vectors: Sequence[Sequence[Any]]) -> Any:
    """Return the value of a polynomial in scalar products for given vectors: numbers, symbols or polynomials."""
    return Decomposition(polynomial, {}, {}).evaluate([list(vector) for vector in vectors])[3]


def scalar_as_text(polynomial: Polynomial, name: str = "w") -> str:
    """Return a polynomial in scalar products as text.

    Examples
    --------
    >>> scalar_as_text({((0, 0), (0, 0)): Fraction(1, 4), ((0, 2),): Fraction(-1)})
    '-(w0 . w2) + 1/4 |w0|^4'
    """
    return as_text({(): polynomial}, name, symmetric=True).replace(" 1 ", " ").removesuffix(" 1")


def as_text(coefficients: Coefficients, name: str = "w", symmetric: bool = False) -> str:
    """Return a vector or a symmetric matrix as text.

    Parameters
    ----------
    coefficients : Coefficients
    name : str, optional
        Of the rate; its derivatives are numbered, |w0| is the length of the rate itself.
    symmetric : bool, optional
        Whether it is a matrix: then S(a, b) is a b' + b a', and 1 the unit matrix.

    Examples
    --------
    >>> as_text({(0,): {((0, 0),): Fraction(1, 6)}, (0, 1): {(): Fraction(-1, 12)}})
    '1/6 |w0|^2 w0 - 1/12 w0 x w1'
    >>> as_text({(): {((0, 0),): Fraction(-1)}, (0, 0): {(): Fraction(1, 2)}}, symmetric=True)
    '-|w0|^2 1 + 1/2 S(w0, w0)'
    """
    terms = []
    for covariant in sorted(coefficients, key=lambda c: (len(c), c)):
        polynomial = coefficients[covariant]
        for monomial in sorted(polynomial, key=lambda m: (len(m), m)):
            number = exact(polynomial[monomial])
            factors = [_number(number), *_products(monomial, name), _covariant(covariant, name, symmetric)]
            terms.append(("-" if number < 0 else "+", " ".join(filter(None, factors))))
    if not terms:
        return "0"
    (sign, first), *rest = terms
    text = f"-{first}" if sign == "-" else first
    return text + "".join(f" {sign} {term}" for sign, term in rest)


def _number(number: sp.Expr) -> str:
    size = abs(number)
    if size == 1:
        return ""
    if size.is_Rational:  # as a decimal where the method's own coefficients are decimals
        return str(size) if size.q < _DECIMAL else f"{float(size):.11e}"
    return f"({size})"


def _products(monomial: Sequence[tuple[int, ...]], name: str) -> list[str]:
    factors = []
    for product, power in Counter(monomial).items():
        if len(product) == 3:
            i, j, k = product
            text = f"({name}{i} . {name}{j} x {name}{k})"
        elif product[0] == product[1]:
            text, power = f"|{name}{product[0]}|", 2 * power
        else:
            text = f"({name}{product[0]} . {name}{product[1]})"
        factors.append(text if power == 1 else f"{text}^{power}")
    return factors


def _covariant(covariant: tuple[int, ...], name: str, symmetric: bool) -> str:
    words = [f"{name}{i}" for i in covariant]
    if not symmetric:
        return " x ".join(words)
    if not words:
        return "1"
    return f"S({words[0]}, {' x '.join(words[1:])})"
