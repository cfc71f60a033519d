"""Filters of least mean square error over a band, under their conditions, and of the least largest one by iteration.

Lawson's iteration changes the weights of least squares by the errors that these leave. It serves where errors are
complex: with a gyro, or with unlike sides. It converges slowly; in the digits of `band_grid` it is the same everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from operator import mul
from typing import Any

from strapgen.catalogue.methods.window import Taps
from strapgen.design.filters.band_grid import (
    BITS,
    ONE,
    REAL,
    BandGrid,
    distance,
    integer,
    magnitude,
    mean_grid,
    real,
)
from strapgen.design.filters.filter_taps import Shape
from strapgen.ir.exceptions import InputError


def mean_square_filters(
    shape: Shape,
    degrees: Sequence[int],
    band: Fraction,
    noise: Fraction,
    spectrum: Sequence[int] | None = None,
    lever: Taps | None = None,
) -> list[list[Any]]:
    """Return the filters of the least mean of S |sum_j F_j A_j - C_m|^2 over a band plus sigma^2 sum_j F_j^2.

    `band`: highest angular frequency in rad a sample; the mean is over `band_grid.mean_points`. `lever`: v of a pair
    whose u this is; the error is that of their product, by the root mean square of v.

    >>> taps, = mean_square_filters(Shape(1, 1, 3), [1], Fraction(1), Fraction(0))
    >>> [round(float(tap), 12) for tap in taps]
    [-0.25, 0.0, 0.25]
    """
    grid = _grid(shape, band, lever)
    weights = [ONE] * len(grid.points) if spectrum is None else list(spectrum)
    weights = [weight // len(weights) for weight in weights]
    if lever is not None:
        squares = _squares(grid.response(list(map(integer, lever))))
        weights = [weight * square >> BITS for weight, square in zip(weights, squares, strict=True)]
        weights = [(weight << BITS) // sum(weights) for weight in weights]
    wanted = [_wanted(grid, shape, m, lever) for m in degrees]
    return least_squares(grid, shape, degrees, wanted, weights, noise)


def _grid(shape: Shape, band: Fraction, lever: Taps | None) -> BandGrid:
    return mean_grid(band, max(shape.samples, len(lever or ())) - 1, shape.gyro, shape.increments)


def _squares(values: Sequence[tuple[int, int]]) -> list[int]:
    return [(x * x + y * y) >> BITS for x, y in values]


def _wanted(grid: BandGrid, shape: Shape, m: int, lever: Taps | None) -> list[tuple[int, int]]:
    """Return the response that a filter is to have: u of a pair that of coning by the conjugate of v."""
    if lever is None:
        return shape.wanted(grid, m)
    levers = grid.response(list(map(integer, lever)))
    parts = zip(grid.coning(), levers, _squares(levers), strict=True)
    return [(-value * y // square, value * x // square) for value, (x, y), square in parts]


def least_squares(
    grid: BandGrid,
    shape: Shape,
    degrees: Sequence[int],
    wanted: Sequence[Sequence[tuple[int, int]]],
    weights: Sequence[int],
    noise: Fraction = Fraction(0),
) -> list[list[Any]]:
    """Return the filters of least weighted sum of squares of errors on a grid, under their conditions.

    `wanted`: for each degree the response by frequency.
    """
    count, powers = shape.samples, shape.conditions
    scaled = [(w * square) >> BITS for w, square in zip(weights, grid.squares(), strict=True)]
    lags = [real(sum(map(mul, scaled, column)) >> BITS) for column in zip(*grid.lags, strict=True)]
    lags[0] += REAL.mpf(noise.numerator) ** 2 / noise.denominator**2
    rows = [[REAL.mpf(value.numerator) / value.denominator for value in row] for row in shape.rows]
    matrix = [
        [*(lags[abs(i - j)] for j in range(count)), *(row[i] for row in rows)] for i in range(count)
    ] + [[*row, *[REAL.mpf(0)] * powers] for row in rows]
    rights = [
        _products(grid, shape, weights, response)
        + [REAL.mpf(r.numerator) / r.denominator for r in shape.right(m)]
        for m, response in zip(degrees, wanted, strict=True)
    ]
    return [solution[:count] for solution in solve(matrix, rights)]


def _products(
    grid: BandGrid, shape: Shape, weights: Sequence[int], wanted: Sequence[tuple[int, int]]
) -> list[Any]:
    """Return the products of the functions of the samples with a response."""
    parts = [
        (x, y, w * p >> BITS, w * q >> BITS)
        for w, (x, y), (p, q) in zip(weights, grid.gains, wanted, strict=True)
    ]
    even = [(x * p + y * q) >> BITS for x, y, p, q in parts]
    odd = [(x * q - y * p) >> BITS for x, y, p, q in parts]
    result = []
    for place in range(shape.samples):
        number, after = distance(place, shape.twice_middle)
        cosines = [row[number] for row in grid.cosines]
        sines = [row[number] if after else -row[number] for row in grid.sines]
        result.append(real((sum(map(mul, even, cosines)) + sum(map(mul, odd, sines))) >> BITS))
    return result


def solve(matrix: Sequence[Sequence[Any]], rights: Sequence[Sequence[Any]]) -> list[list[Any]]:
    """Return the solutions of linear equations for several right sides, in the digits of `REAL`.

    >>> [[float(x) for x in row] for row in solve([[REAL.mpf(2), REAL.mpf(0)], [REAL.mpf(1), REAL.mpf(1)]], [[4, 3]])]
    [[2.0, 1.0]]
    """
    table = [[*row, *(right[i] for right in rights)] for i, row in enumerate(matrix)]
    count = len(table)
    for column in range(count):
        pivot = max(range(column, count), key=lambda line: abs(table[line][column]))
        table[column], table[pivot] = table[pivot], table[column]
        head = table[column]
        if abs(head[column]) < REAL.ldexp(1, -BITS + 40):
            raise InputError(
                "the band is too narrow, or the samples are too many, for a filter to be the best one"
            )
        for line in range(column + 1, count):
            row = table[line]
            factor = row[column] / head[column]
            if factor:
                for place in range(column + 1, len(row)):
                    row[place] -= factor * head[place]
    solutions = []
    for number in range(count, count + len(rights)):
        solution = [REAL.mpf(0)] * count
        for line in reversed(range(count)):
            rest = sum((table[line][k] * solution[k] for k in range(line + 1, count)), REAL.mpf(0))
            solution[line] = (table[line][number] - rest) / table[line][line]
        solutions.append(solution)
    return solutions


#: Rounds of the iteration, and the least weight of a frequency, of weights that sum to 1.
ROUNDS = 60
_LEAST_WEIGHT = ONE // 10**12


def lawson_filters(
    shape: Shape, degrees: Sequence[int], band: Fraction, lever: Taps | None = None
) -> list[list[Any]]:
    """Return filters with the least largest errors over a band, of those that the iteration passes.

    `band`: highest angular frequency in rad a sample; the errors are those at `band_grid.mean_points`. `lever`: v of a
    pair whose u this is; the error is that of their product.

    >>> taps, = lawson_filters(Shape(1, 1, 3), [1], Fraction(1))
    >>> [round(float(tap), 12) for tap in taps]
    [-0.25, 0.0, 0.25]
    """
    return [_filter(shape, m, band, lever) for m in degrees]


def _filter(shape: Shape, m: int, band: Fraction, lever: Taps | None) -> list[Any]:
    grid = _grid(shape, band, lever)
    weights = [ONE // len(grid.points)] * len(grid.points)
    levers = [ONE] * len(weights)
    if lever is not None:
        levers = [magnitude(*one) for one in grid.response(list(map(integer, lever)))]
    wanted = _wanted(grid, shape, m, lever)
    best: tuple[int, list[Any]] | None = None
    for _ in range(ROUNDS):
        scaled = [w * v * v >> 2 * BITS for w, v in zip(weights, levers, strict=True)]
        (taps,) = least_squares(grid, shape, [m], [wanted], scaled)
        found = zip(levers, grid.response(list(map(integer, taps)), shape.previous), wanted, strict=True)
        errors = [v * magnitude(x - p, y - q) >> BITS for v, (x, y), (p, q) in found]
        if best is None or max(errors) < best[0]:
            best = max(errors), taps
        products = [w * e >> BITS for w, e in zip(weights, errors, strict=True)]
        total = sum(products)
        if not total:
            break
        weights = [(value << BITS) // total + _LEAST_WEIGHT for value in products]
    assert best is not None
    return best[1]
