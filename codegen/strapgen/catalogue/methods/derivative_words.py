"""Products of derivatives of A(t), the words of the order conditions for x' = A(t) x; see `order_conditions`."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import TypeAlias

#: A product of derivatives of A(t), as the tuple of the orders of the derivatives, the last in time first.
Word: TypeAlias = tuple[int, ...]


def words(order: int, derivatives: int | None = None) -> list[Word]:
    """Return the products of derivatives of A(t) of an order, without derivatives above `derivatives` if it is set.

    Parameters
    ----------
    order : int
    derivatives : int, optional
        Highest derivative.

    Returns
    -------
    list of Word
        The shortest first.

    Examples
    --------
    >>> words(3)
    [(2,), (1, 0), (0, 1), (0, 0, 0)]
    >>> words(3, derivatives=0)
    [(0, 0, 0)]
    """
    if order == 0:
        return [()]
    highest = order - 1 if derivatives is None else min(derivatives, order - 1)
    products = [(k, *rest) for k in range(highest, -1, -1) for rest in words(order - 1 - k, derivatives)]
    return sorted(products, key=len)


def word_text(word: Word) -> str:
    """Return the weight of a word in a tableau in the usual notation.

    Examples
    --------
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

    Examples
    --------
    >>> word_coefficient((0, 1))  # int_0^1 int_0^s t dt ds
    Fraction(1, 6)
    """
    return Fraction(1, math.prod(sum(k + 1 for k in word[place:]) for place in range(len(word))))
