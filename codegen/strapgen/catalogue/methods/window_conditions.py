"""The conditions of a window's filters, exactly: E F = R holds for every rate that is a polynomial of low degree.

Row k says what the filters do with the rate u^k, u the time from the middle of the step by its length: E has the
increments of that rate, as the gyro shows them, and R its Legendre coefficients over the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import comb, factorial

from strapgen.catalogue.methods.sensor_response import Response
from strapgen.catalogue.methods.window import Taps, Window
from strapgen.ir.exceptions import InputError


def increments(samples: tuple[int, int, int], conditions: int, gyro: Response | None = None) -> list[Taps]:
    """Return E: for each power k below `conditions` the increments, oldest first, of the rate u^k times the step.

    The samples are N in the step, p before it and L ahead of it; without a gyro increments are integrals of the rate.

    >>> increments((1, 1, 1), 2)
    [(Fraction(1, 1), Fraction(1, 1), Fraction(1, 1)), (Fraction(-1, 1), Fraction(0, 1), Fraction(1, 1))]
    """
    number, previous, ahead = samples
    series = (gyro or Response()).series(conditions)
    middles = [Fraction(2 * j + 1 - number, 2) for j in range(-previous, number + ahead)]
    # (s T)^i turns t^k, t in samples, into k!/(k-i)! t^(k-i).
    derivatives = [
        [series[i] * factorial(k) / factorial(k - i) for i in range(k + 1)] for k in range(conditions)
    ]
    return [
        tuple(
            sum((g * t ** (k - i) for i, g in enumerate(row)), Fraction(0)) / number ** (k + 1)
            for t in middles
        )
        for k, row in enumerate(derivatives)
    ]


def coefficients(m: int, conditions: int) -> Taps:
    """Return R_m, the Legendre coefficients m over the step of the rates u^k times the step, k below `conditions`.

    They are (2m + 1) times the integral of (tau - 1/2)^k P_m(2 tau - 1) over tau from 0 to 1.

    >>> [str(value) for value in coefficients(1, 4)]
    ['0', '1/2', '0', '3/40']
    """
    # P_m(2u) has the coefficients below, in powers of u.
    legendre = [Fraction(0)] * (m + 1)
    for i in range(m // 2 + 1):
        weight = Fraction((-1) ** i * comb(m, i) * comb(2 * m - 2 * i, m), 2**m)
        legendre[m - 2 * i] = weight * 2 ** (m - 2 * i)
    half = Fraction(1, 2)
    return tuple(
        (2 * m + 1) * sum((c * _integral(k + i, -half, half) for i, c in enumerate(legendre)), Fraction(0))
        for k in range(conditions)
    )


def first_failure(window: Window) -> tuple[int, int, Fraction, Fraction] | None:
    """Return the first condition that does not hold: m, k, the sum and its due value; None if all hold."""
    samples = window.increments, window.previous, window.ahead
    rows = increments(samples, window.conditions, window.gyro)
    for m, taps in enumerate(window.filters):
        for k, (row, right) in enumerate(zip(rows, coefficients(m, window.conditions), strict=True)):
            total = sum((tap * d for tap, d in zip(taps, row, strict=True)), Fraction(0))
            if total != right:
                return m, k, total, right
    return None


def inner_taps(rows: Sequence[Taps], right: Sequence[Fraction]) -> list[Fraction]:
    """Return the exact solution of n equations, rows (n, n), in n unknowns.

    >>> inner_taps([(Fraction(2), Fraction(1)), (Fraction(0), Fraction(4))], [Fraction(1), Fraction(2)])
    [Fraction(1, 4), Fraction(1, 2)]
    """
    count = len(rows)
    table = [[*row, value] for row, value in zip(rows, right, strict=True)]
    for column in range(count):
        pivot = next((line for line in range(column, count) if table[line][column]), None)
        if pivot is None:
            raise InputError("the conditions of the filters do not determine their taps")
        table[column], table[pivot] = table[pivot], table[column]
        head = table[column][column]
        table[column] = [value / head for value in table[column]]
        for line in range(count):
            factor = table[line][column]
            if line != column and factor:
                table[line] = [a - factor * b for a, b in zip(table[line], table[column], strict=True)]
    return [row[-1] for row in table]


def _integral(power: int, low: Fraction, high: Fraction) -> Fraction:
    """Return the integral of t^power from one time to another."""
    return (high ** (power + 1) - low ** (power + 1)) / (power + 1)
