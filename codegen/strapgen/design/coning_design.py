"""Designs coning coefficients for a band, or for a spectrum of vibration, as exact rationals.

The drift on coning is linear in the coefficients, see `coning_drift`. Some of its powers of the frequency can be
annulled; these conditions hold exactly, whatever the rest is rounded to.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import cached_property
from operator import mul
from typing import Any

import numpy as np

from strapgen.analysis.vibration.spectrum import Spectrum
from strapgen.catalogue.methods import coning_drift
from strapgen.catalogue.methods.coefficient_files import slug
from strapgen.catalogue.methods.coning_drift import ConingShape
from strapgen.catalogue.methods.sensor_response import Response
from strapgen.catalogue.methods.shaped_coning import ShapedConing
from strapgen.design.family import gyro_lines, number
from strapgen.design.filters import exchange
from strapgen.design.filters.band_grid import BITS, REAL, integer
from strapgen.design.filters.exchange import Responses
from strapgen.design.filters.filter_taps import TABLE_BITS, nearest
from strapgen.design.filters.mean_square import solve
from strapgen.ir.exceptions import InputError

#: What a design does in words, and where it comes from, by objective.
SOURCES = {
    "band": "strapgen coning; least largest drift over the band, by exchange",
    "worst": "strapgen coning; least drift under a spectrum for the worst phases",
    "random": "strapgen coning; least mean square of the drift under a spectrum of random phases",
}

#: Digits of the level in a file.
_LEVEL_DIGITS = 6


@dataclass(frozen=True)
class ConingBrief:
    """The requirements on coning coefficients."""

    #: N samples of the step, and samples from before it
    increments: int
    previous: int
    #: "band", "worst" or "random", see `shaped_coning.OBJECTIVES`
    objective: str
    #: Highest angular frequency in rad a sample, for "band"
    band: Fraction | None = None
    #: The spectrum, for the other two
    lines: Lines | None = None
    #: Number of powers of the frequency that the drift has not, from the third on
    powers: int = 0
    #: By default the increments are integrals of the rate
    gyro: Response | None = None
    #: Standard deviation of the noise of an increment, and the pulse of the gyro, in rad, for "random"
    noise: Fraction = Fraction(0)
    pulse: Fraction = Fraction(0)
    #: By default it says the samples and the band
    title: str = ""
    #: Highest total degree of products of two powers of time for which a step is exact
    products: int = 0

    @property
    def shape(self) -> ConingShape:
        """The samples and the gyro, which determine the drift beside the coefficients."""
        return ConingShape(self.increments, self.previous, self.gyro)

    @property
    def full_title(self) -> str:
        """The title, by default from the samples, what the coefficients are for, and the gyro."""
        purpose = "a spectrum" if self.band is None else f"{float(self.band):g} rad"
        parts = [f"Coning {self.increments}+{self.previous} to {purpose}"]
        if self.band is None:
            parts = [f"Coning {self.increments}+{self.previous} for a spectrum, {self.objective} phases"]
        if self.gyro is not None:
            parts.append(f"gyro {self.gyro.title}")
        return self.title or ", ".join(parts)


def design(brief: ConingBrief) -> ShapedConing:
    """Return the coefficients for a brief.

    >>> shape = design(ConingBrief(1, 2, "band", Fraction(1)))
    >>> [round(float(c), 9) for c in shape.coefficients], str(shape.level)
    ([0.127237734, -0.023056512], '0.000103062')
    """
    if not brief.shape.unknowns:
        raise InputError("samples 1 and previous 0 have no pairs of samples, hence no coefficients")
    problem = ConingProblem(brief.shape, brief.powers, brief.products)
    if brief.objective == "band":
        assert brief.band is not None, "a band is checked before"
        free = exchange.least_largest(problem, brief.band).free
    else:
        assert brief.lines is not None, "a spectrum is checked before"
        answers = problem.answers(brief.lines.radians)
        if brief.objective == "worst":
            free = exchange.least_absolute(answers, brief.lines.worst_weights)
        else:
            free = _mean_square(problem, answers, brief)
    coefficients = problem.rounded(free)
    level = None
    if brief.band is not None:
        largest = coning_drift.largest(brief.shape, coefficients, brief.band)
        level = Decimal(f"{largest:.{_LEVEL_DIGITS - 1}e}")
    title = brief.full_title
    return ShapedConing(
        slug(title),
        title,
        SOURCES[brief.objective],
        brief.increments,
        brief.previous,
        brief.objective,
        coefficients,
        brief.powers,
        brief.products,
        brief.band,
        brief.gyro,
        level,
    )


def annulling(shape: ConingShape) -> tuple[Fraction, ...]:
    """Return the coefficients that annul as many powers of the frequency as there are coefficients.

    >>> [str(c) for c in annulling(ConingShape(1, 2))]
    ['7/60', '-1/60']
    """
    return tuple(ConingProblem(shape, shape.unknowns).complete([]))


class ConingProblem:
    """The drift on coning as a function of the coefficients that no condition determines."""

    title = "the drift on coning"

    def __init__(self, shape: ConingShape, powers: int, products: int = 0) -> None:
        if products and shape.gyro is not None:
            raise InputError(
                "products of powers of time go with an ideal gyro, whose samples are integrals of the rate"
            )
        self._shape = shape
        conditions = [*coning_drift.powers(shape, powers), *coning_drift.products(shape, products)]
        self._pivots, self._reduce = _reduce(conditions, shape.unknowns)
        self._outer = [k for k in range(shape.unknowns) if k not in self._pivots]
        self.free = len(self._outer)

    def complete(self, outer: Sequence[Fraction]) -> list[Fraction]:
        """Return all coefficients from the free ones, exactly."""
        values = dict(zip(self._outer, outer, strict=True))
        for pivot, row in zip(self._pivots, self._reduce, strict=True):
            values[pivot] = row[-1] - sum(
                (row[k] * x for k, x in values.items() if k in self._outer), Fraction(0)
            )
        return [values[k] for k in range(self._shape.unknowns)]

    @cached_property
    def base(self) -> list[Fraction]:
        """All coefficients where the free ones are zero."""
        return self.complete([Fraction(0)] * self.free)

    @cached_property
    def directions(self) -> list[list[Fraction]]:
        """The derivatives of all coefficients by the free ones, (free, unknowns)."""
        units = [[Fraction(int(i == j)) for j in range(self.free)] for i in range(self.free)]
        return [[a - b for a, b in zip(self.complete(unit), self.base, strict=True)] for unit in units]

    def answers(self, points: Sequence[Any]) -> Responses:
        """Return the answers at frequencies in rad a sample."""
        directions = [[integer(x) for x in direction] for direction in self.directions]
        base = [integer(x) for x in self.base]
        columns: list[list[int]] = [[] for _ in directions]
        right = []
        for b in points:
            terms, rest = coning_drift.terms(self._shape, b, REAL)
            row = [integer(term) for term in terms]
            for column, direction in zip(columns, directions, strict=True):
                column.append(sum(map(mul, direction, row)) >> BITS)
            right.append(integer(rest) - (sum(map(mul, base, row)) >> BITS))
        return Responses(columns, right)

    def rounded(self, free: Sequence[Any], bits: int = TABLE_BITS) -> tuple[Fraction, ...]:
        """Return all coefficients as rationals: the free ones as nearest multiples of 2^-bits, the rest exactly."""
        return tuple(self.complete([nearest(value, bits) for value in free]))


def _reduce(
    conditions: Sequence[tuple[list[Fraction], Fraction]], unknowns: int
) -> tuple[list[int], list[list[Fraction]]]:
    """Return which unknowns conditions determine, and each of these in the others and a constant."""
    table = [[*row, right] for row, right in conditions]
    pivots: list[int] = []
    for column in range(unknowns + 1):
        done = len(pivots)
        place = next((line for line in range(done, len(table)) if table[line][column]), None)
        if place is None:
            continue
        if column == unknowns:
            raise InputError(
                f"the conditions on {unknowns} coefficients contradict each other; fewer powers or products are needed"
            )
        table[done], table[place] = table[place], table[done]
        head = [value / table[done][column] for value in table[done]]
        table = [
            head if line == done else [a - row[column] * b for a, b in zip(row, head, strict=True)]
            for line, row in enumerate(table)
        ]
        pivots.append(column)
    return pivots, table[: len(pivots)]


def _mean_square(problem: ConingProblem, answers: Responses, brief: ConingBrief) -> list[Any]:
    """Return the free coefficients of the least mean square of the drift, with that of noise and of pulses.

    A line of random phase, with the amplitude product S df, has a drift of the mean square (S df E / (N T))^2/2. The
    noise of the increments, crossed with the newest one, turns every step by sigma |K| at random. Over the time 1/df,
    in which lines at the distance df can be told apart, both drifts are in the ratio of the integral of S^2 E^2/2 over
    frequency to N T sigma^2 |K|^2 R, with the mean square R of an increment. Pulses q have the differences of
    neighbouring K in place of K, and q^2/12 in place of sigma^2.
    """
    assert brief.lines is not None, "a spectrum is checked before"
    weights = [integer(weight) for weight in brief.lines.square_weights]
    rows = [
        [[(w * x) >> BITS for w, x in zip(weights, column, strict=True)], column]
        for column in answers.columns
    ]
    matrix = [[_product(weighted, column) for _, column in rows] for weighted, _ in rows]
    right = [_product(weighted, answers.right) for weighted, _ in rows]
    lines = brief.lines
    interval = brief.increments / float(lines.sample_hz)
    size = interval * lines.increment_square(brief.gyro) / lines.square_unit
    for quadratic, weight in ((_squares, brief.noise**2), (_differences, brief.pulse**2 / 12)):
        factor = REAL.mpf(weight.numerator) / weight.denominator * REAL.mpf(size)
        if not factor:
            continue
        for i, one in enumerate(problem.directions):
            right[i] -= factor * _real(quadratic(one, problem.base))
            for j, other in enumerate(problem.directions):
                matrix[i][j] += factor * _real(quadratic(one, other))
    if not matrix:
        return []
    # The columns differ by many orders of magnitude: each is scaled to 1.
    scale = [1 / REAL.sqrt(matrix[i][i]) for i in range(len(matrix))]
    scaled = [[a * x * scale[j] for j, x in enumerate(row)] for a, row in zip(scale, matrix, strict=True)]
    (solution,) = solve(scaled, [[a * x for a, x in zip(scale, right, strict=True)]])
    return [a * x for a, x in zip(scale, solution, strict=True)]


def _product(left: Sequence[int], right: Sequence[int]) -> Any:
    return REAL.ldexp(REAL.mpf(sum(map(mul, left, right))), -2 * BITS)


def _squares(one: Sequence[Fraction], other: Sequence[Fraction]) -> Fraction:
    return sum((a * b for a, b in zip(one, other, strict=True)), Fraction(0))


def _differences(one: Sequence[Fraction], other: Sequence[Fraction]) -> Fraction:
    """Return the product of the differences of neighbours, with zeros before and after."""
    steps = [
        [b - a for a, b in zip([Fraction(0), *row], [*row, Fraction(0)], strict=True)] for row in (one, other)
    ]
    return _squares(*steps)


def _real(value: Fraction) -> Any:
    return REAL.mpf(value.numerator) / value.denominator


#: Number of lines.
LINES = 400
#: Weight of every line beside that of the spectrum, by the largest one: it decides where there is no vibration.
_LEAST = 1e-6
#: Binary digits of a weight by the largest one: the last digits in double precision depend on the machine.
_DIGITS = 30


@dataclass(frozen=True)
class Lines:
    """Lines of a vibration about x and y, at equal distances in frequency.

    >>> lines = Lines((10.0, 20.0), (1e-6, 4e-6), (2e-6, 8e-6), Fraction(100))
    >>> [float(b) for b in lines.radians]
    [0.6283185307179586, 1.2566370614359172]
    >>> [round(float(weight), 7) for weight in lines.worst_weights]
    [0.250001, 1.000001]
    """

    #: Frequencies in Hz
    hertz: tuple[float, ...]
    #: Amplitude about x times amplitude about y of each line, in rad^2
    products: tuple[float, ...]
    #: Sum of the squares of both, in rad^2
    squares: tuple[float, ...]
    #: Sampling frequency in Hz
    sample_hz: Fraction

    @cached_property
    def radians(self) -> list[Any]:
        """Angular frequencies in rad a sample."""
        rate = REAL.mpf(self.sample_hz.numerator) / self.sample_hz.denominator
        return [2 * REAL.pi * REAL.mpf(f) / rate for f in self.hertz]

    @cached_property
    def worst_weights(self) -> list[Any]:
        """Products by the largest one, and a little for every line."""
        return [REAL.mpf(w) + REAL.mpf(_LEAST) for w in _parts(self.products)]

    @cached_property
    def square_weights(self) -> list[Any]:
        """Half the square of each product by the distance of the lines, in units of the largest one, with the same."""
        return [w**2 / 2 for w in self.worst_weights]

    @property
    def square_unit(self) -> float:
        """The unit of `square_weights`, in rad^4/Hz."""
        return max(self.products) ** 2 / (self.hertz[1] - self.hertz[0])

    def increment_square(self, gyro: Response | None) -> float:
        """Return the mean square of an increment, both axes together, in rad^2."""
        b = 2 * np.pi * np.array(self.hertz) / float(self.sample_hz)
        power = np.ones(len(b))
        if gyro is not None:
            power = np.abs(gyro.gain(np.array(self.hertz))) ** 2
        return float((np.array(self.squares) * power * 2 * np.sin(b / 2) ** 2).sum())


def _parts(values: tuple[float, ...]) -> list[float]:
    largest = max(values)
    return [round(value / largest * 2**_DIGITS) / 2**_DIGITS for value in values]


def of_spectrum(spectrum: Spectrum, sample_hz: Fraction) -> Lines:
    """Return a spectrum as lines.

    A line in a band df has the amplitudes a with a^2/2 = P |H|^2 df about each axis, P the density of the input and H
    the transfer function to the angle.

    `sample_hz`: sampling frequency in Hz.

    >>> flat = Spectrum(lambda f: 5e-7 + 0 * f, {"angle_x": np.ones_like, "angle_y": np.ones_like}, (2.0, 40.0))
    >>> lines = of_spectrum(flat, Fraction(100))
    >>> len(lines.hertz), lines.hertz[0], lines.hertz[-1], round(sum(lines.products) * 1e6, 2)
    (400, 2.0, 40.0, 38.1)
    """
    low, high = spectrum.edges[0], spectrum.edges[-1]
    hertz = np.linspace(low or high / LINES, high, LINES)
    channels = spectrum.amplitudes(hertz)
    for axis in "xy":
        if f"angle_{axis}" not in channels:
            raise InputError(
                f"the spectrum does not turn about {axis}; angle_{axis}_rad is needed for coning"
            )
    sizes = [np.abs(channels[f"angle_{axis}"]) for axis in "xy"]
    power = 2 * spectrum.densities(hertz) * (hertz[1] - hertz[0])
    products = power * sizes[0] * sizes[1]
    if not 0 < products.max() < np.inf:
        raise InputError("the spectrum does not turn about x and y at one frequency; there is no coning")
    squares = power * (sizes[0] ** 2 + sizes[1] ** 2)
    return Lines(tuple(hertz.tolist()), tuple(products.tolist()), tuple(squares.tolist()), sample_hz)


def written(shape: ShapedConing, command: str, figures: Sequence[str] = ()) -> str:
    """Return coefficients as a TOML file that says which command designed them.

    >>> from strapgen.catalogue.methods.shaped_coning import SHAPES
    >>> print(*written(SHAPES["coning-shaped-8"], "strapgen coning ...").splitlines()[:4], sep=chr(10))
    # Designed by: strapgen coning ...
    name = "Coning 1+8 to 1.3 rad"
    source = "strapgen coning; least largest drift over the band, by exchange"
    samples = 1
    """
    head: dict[str, str | int] = {
        "name": shape.title,
        "source": shape.source,
        "samples": shape.increments,
        "previous": shape.previous,
        "objective": shape.objective,
        "powers": shape.powers,
    }
    if shape.products:
        head["products"] = shape.products
    if shape.band is not None:
        head["band"] = number(shape.band)
    if shape.level is not None:
        head["level"] = str(shape.level)
    lines = [f"# Designed by: {command}", *(f"# {line}" for line in figures)]
    lines += [f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in head.items()]
    lines += ["coefficients = [", *(f'  "{value}",' for value in shape.coefficients), "]"]
    if shape.gyro is not None:
        lines += ["", "[gyro]", *gyro_lines(shape.gyro)]
    return "\n".join(lines) + "\n"
