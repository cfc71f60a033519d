"""Writes integers as sums of powers of two with signs, so that a product with one is a sum of shifted terms."""

from __future__ import annotations

#: How products with a constant are computed, and what that is in words.
MULTIPLICATIONS = {
    "product": "by the processor's multiplication",
    "shift-add": "as sums of shifted terms, by the canonical signed digits of the constant",
}


def signed_digits(value: int, most: int = 0) -> tuple[tuple[int, int], ...]:
    """Return the canonical signed digits of an integer, of which no two are neighbours: the `most` largest, 0 for all.

    Each has a sign and a power of two.

    >>> signed_digits(7), signed_digits(-11), signed_digits(1365, 2)
    (((1, 3), (-1, 0)), ((-1, 4), (1, 2), (1, 0)), ((1, 10), (1, 8)))
    """
    digits: list[tuple[int, int]] = []
    rest, power = abs(value), 0
    while rest:
        if rest & 1:
            digit = 2 - (rest & 3)
            digits.append((digit if value > 0 else -digit, power))
            rest -= digit
        rest >>= 1
        power += 1
    digits.reverse()
    return tuple(digits[:most] if most else digits)


def from_digits(digits: tuple[tuple[int, int], ...]) -> int:
    """Return the integer that digits stand for."""
    return sum(sign << power for sign, power in digits)
