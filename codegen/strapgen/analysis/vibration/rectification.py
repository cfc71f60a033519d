"""The mean rate that an attitude step computes under lines, less the true one, to fourth order in the amplitudes.

The attitude is C(n) = C(0) exp(n T Omega) P(n) with a constant Omega and an oscillation P. With the transition A of a
step P(n + 1) = exp(-T Omega) P(n) A(n), which is solved order by order in the amplitudes of the lines: what has a mean
belongs to Omega, all else is the difference of an oscillation. So is P' = P [w x] - Omega P for the true attitude.

Line i is a pair of oscillations exp(j omega t) and exp(-j omega t) with the numbers 2 i and 2 i + 1. A product of up to
four of them has a mean if its frequencies add up to zero or, for an algorithm that sees it once a step, to whole
periods in a step: it is a resonance. Products that divide no resonance lead to none, and are dropped.
"""

from __future__ import annotations

import cmath
import itertools
import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from strapgen.catalogue import AnyAlgorithm
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import short_repr
from strapgen.ir.read_only import read_only
from strapgen.kernel.power_series import Powers
from strapgen.lab import one_step

#: Highest degree in the amplitudes of the lines.
DEGREE = 4
#: The numbers of oscillations in a product, in order.
Product = tuple[int, ...]
Array = NDArray[np.complex128]


def resonances(shares: Sequence[Fraction]) -> list[Product]:
    """Return the products of up to four oscillations that have a mean.

    One line, and a second one of twice its frequency:

    >>> len(resonances([Fraction(1, 10)]))
    2
    >>> [product for product in resonances([Fraction(1, 10), Fraction(1, 5)]) if len(product) == 3]
    [(0, 0, 3), (1, 1, 2)]
    """
    whole = math.lcm(*(share.denominator for share in shares))
    parts = [sign * int(share * whole) % whole for share in shares for sign in (1, -1)]
    by_sum: list[dict[int, list[Product]]] = [defaultdict(list) for _ in range(3)]
    by_sum[0][0].append(())
    for size in (1, 2):
        for product in itertools.combinations_with_replacement(range(len(parts)), size):
            by_sum[size][sum(parts[k] for k in product) % whole].append(product)
    found: set[Product] = set()
    for left, right in ((0, 1), (0, 2), (1, 2), (2, 2)):
        for rest, products in by_sum[left].items():
            others = by_sum[right].get(-rest % whole, [])
            found |= {tuple(sorted(one + other)) for one in products for other in others}
    return sorted(found, key=lambda product: (len(product), product))


class Oscillations:
    """The ring of polynomials in the oscillations of lines, up to what divides no resonance.

    It takes the place of a ring of SymPy as that of the coefficients of `power_series.Powers`.
    """

    #: The numbers of the kernels, in double.
    domain = sp.RR

    def __init__(self, shares: Sequence[Fraction]) -> None:
        self.resonant = resonances(shares)
        kept: list[set[Product]] = [{()}, *(set() for _ in range(DEGREE))]
        for product in self.resonant:
            for degree in range(1, len(product) + 1):
                kept[degree].update(itertools.combinations(product, degree))
        self.products = [sorted(one) for one in kept]
        self.places = [{product: k for k, product in enumerate(one)} for one in self.products]
        self._tables = {(a, b): self._table(a, b) for a in range(DEGREE + 1) for b in range(DEGREE + 1 - a)}
        self.zero = self(0)

    def __call__(self, number: Any) -> Polynomial:
        """Return a number as a polynomial; a polynomial itself."""
        if isinstance(number, Polynomial):
            return number
        return Polynomial(self, 0, np.array([complex(number)]))

    def oscillating(self, amplitudes: Iterable[complex]) -> Polynomial:
        """Return Re(sum_i c_i exp(j omega_i t)) for the complex amplitudes c_i of all lines."""
        values = [half for c in amplitudes for half in (c / 2, complex(c).conjugate() / 2)]
        return Polynomial(self, 1, np.array([values[k] for (k,) in self.products[1]]))

    def _table(self, a: int, b: int) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
        """Return the places of all pairs of factors of all products of a degree, and where each product begins."""
        left: list[int] = []
        right: list[int] = []
        begins: list[int] = []
        for product in self.products[a + b]:
            begins.append(len(left))
            splits = {
                (
                    tuple(product[k] for k in chosen),
                    tuple(product[k] for k in range(a + b) if k not in chosen),
                )
                for chosen in itertools.combinations(range(a + b), a)
            }
            for one, other in splits:
                left.append(self.places[a][one])
                right.append(self.places[b][other])
        return np.array(left, np.intp), np.array(right, np.intp), np.array(begins, np.intp)

    def product(self, a: int, x: Array, b: int, y: Array, form: str = "n,n->n") -> Array:
        """Return the coefficients of a product of homogeneous polynomials, or of matrices of them.

        `x, y` (..., number of products): coefficients by the products of each degree.
        """
        left, right, begins = self._tables[a, b]
        terms = np.einsum(form, x[..., left], y[..., right])
        return np.asarray(np.add.reduceat(terms, begins, axis=-1), complex)


class Polynomial:
    """A homogeneous polynomial in the oscillations of lines.

    `values` (number of products): coefficients by the products of this degree.
    """

    __slots__ = ("degree", "ring", "values")

    def __init__(self, ring: Oscillations, degree: int, values: Array) -> None:
        self.ring, self.degree, self.values = ring, degree, values

    def __bool__(self) -> bool:
        return bool(self.values.any())

    @property
    def is_ground(self) -> bool:
        """Whether it is a number, as of a polynomial of SymPy."""
        return self.degree == 0

    @property
    def LC(self) -> Any:
        """The number that it is."""
        return self.ring.domain(self.values[0].real)

    def __add__(self, other: Polynomial) -> Polynomial:
        return Polynomial(self.ring, self.degree, self.values + other.values)

    def __neg__(self) -> Polynomial:
        return Polynomial(self.ring, self.degree, -self.values)

    def __mul__(self, other: Any) -> Polynomial:
        if not isinstance(other, Polynomial):
            return Polynomial(self.ring, self.degree, self.values * float(other))
        values = self.ring.product(self.degree, self.values, other.degree, other.values)
        return Polynomial(self.ring, self.degree + other.degree, values)


#: Returns the nine elements of a step's direction cosine matrix, row by row, from its samples and their ring.
Transition = Callable[[list[list[Powers]], Oscillations], list[Powers]]
#: Directions in a plane in which drifts are added up, over half a turn.
_DIRECTIONS = 720


class Tone(NamedTuple):
    """A vibration at one frequency: the integral of the body rate about each axis is Re(c exp(2 pi j f t)).

    Parameters
    ----------
    frequency_hz : number
        Above 0. Decimals are exact, and so are sums of frequencies.
    angles : tuple of complex
        Amplitudes c of the angles about x, y and z in rad, for a tone that begins at the phase 0; -1j is a sine.
    gain : complex, optional
        What the gyro passes on of them.

    Examples
    --------
    >>> coning = Tone(10, (-1e-3j, 1e-3, 0))  # a cone of 1 mrad at 10 Hz
    >>> coning.gain
    1.0
    """

    frequency_hz: float | str | Fraction
    angles: tuple[complex, complex, complex]
    gain: complex = 1.0


class Sampling(NamedTuple):
    """The samples that an attitude step takes."""

    #: Length of a step in s
    step: Fraction
    #: Samples of the step itself, of equal length
    samples: int
    #: Numbers of the sampling intervals that it takes: 0 is the first of the step, -1 the one before it
    intervals: range


class _Term(NamedTuple):
    """A term of the error of the mean rate: products of one order and phase."""

    order: int
    #: How often the start phase of each tone is in that of the term; the first one that is not 0 is positive
    turns: tuple[int, ...]
    #: (3,): the complex vector r in rad/s; the term is Re(r exp(j phase))
    rate: Array


@dataclass(frozen=True)
class Rectification:
    """The error of the mean rate that an algorithm computes under tones, by order in their amplitudes.

    Parameters
    ----------
    terms : tuple of _Term
        Terms of orders 1 to 4, with the phases on which they depend.

    Examples
    --------
    >>> from strapgen import vibration
    >>> tones = [vibration.Tone(10, (-1e-3j, 1e-3, 0))]
    >>> rectified = vibration.rectified("euler", "0.01", tones)
    >>> f"{rectified.worst():.1e} rad/s"
    '1.0e-08 rad/s'
    """

    terms: tuple[_Term, ...]

    __repr__ = short_repr

    def _in_words(self) -> str:
        return f"{len(self.terms)} terms, at most {self.worst():.3g} rad/s"

    def at(self, phases: Sequence[float], order: int | None = None) -> NDArray[np.float64]:
        """Return the error for tones that begin at given phases.

        Parameters
        ----------
        phases : sequence of float
            Phase in rad at which each tone begins.
        order : int, optional
            The order whose terms are taken; by default all of them.

        Returns
        -------
        array, (3,)
            Computed less true mean rate in rad/s, about x, y and z.
        """
        total = np.zeros(3)
        for term in self._of(order):
            phase = sum(count * phase for count, phase in zip(term.turns, phases, strict=True))
            total += (term.rate * cmath.exp(1j * phase)).real
        return total

    def worst(self, order: int | None = None) -> float:
        """Return a bound of the error's length at whatever phases the tones begin.

        Terms of equal phase are added up, and the phases of all others are taken to be independent of each other.

        Parameters
        ----------
        order : int, optional
            The order whose terms are taken; by default all of them.

        Returns
        -------
        float
            In rad/s.
        """
        rates: dict[tuple[int, ...], Any] = {}
        for term in self._of(order):
            rates[term.turns] = rates.get(term.turns, 0) + term.rate
        vectors = np.array([*rates.values()]).reshape(-1, 3)
        angles = np.arange(_DIRECTIONS) * math.pi / _DIRECTIONS
        across = np.abs(vectors[:, :2] @ [np.cos(angles), np.sin(angles)]).sum(axis=0).max()
        # The worst direction is at most half a spacing from one of these.
        return math.hypot(across / math.cos(math.pi / _DIRECTIONS / 2), np.abs(vectors[:, 2]).sum())

    def _of(self, order: int | None) -> list[_Term]:
        return [term for term in self.terms if order in (None, term.order)]


def rectified(choice: AnyAlgorithm, step: float | str | Fraction, tones: Sequence[Tone]) -> Rectification:
    """Return the error of the mean rate that an attitude step computes under tones, to fourth order.

    Where a frequency is the sum of two others, or twice another, there is a mean of third order. It depends on the
    phases at which the tones begin. Sums that are whole periods in a step have a mean too, since every step sees the
    same of them. A sum that is not zero, however small, is a slow oscillation without a mean.

    Parameters
    ----------
    choice : Choice, AttitudeAlgorithm or str
        A step that takes increments and is linear in its state.
    step : number
        Length of a step in s.
    tones : sequence of Tone

    Returns
    -------
    Rectification

    Raises
    ------
    InputError
        If the step is no such step, or a number is not allowed.

    Examples
    --------
    Two tones of which one is twice the other, of 3 mrad:

    >>> from strapgen import choose
    >>> tones = [Tone("5.4", (-0.003j, 0.003, 0)), Tone("10.8", (-0.003j, 0.003, 0))]
    >>> found = rectified(choose("euler", "coning-compressed", 3), "0.015", tones)
    >>> [f"{found.worst(order):.2g}" for order in (2, 3, 4)]
    ['3.3e-09', '3e-09', '2.9e-11']
    """
    attitude_step = one_step.linear_step(choice)
    if attitude_step.nodes is not None:
        raise InputError(
            f"kernel {attitude_step.kernel.name} takes rates; a step that takes increments is needed"
        )

    def transition(samples: list[list[Powers]], ring: Oscillations) -> list[Powers]:
        elements = [element for sample in samples for element in sample]
        state = one_step.state_of(attitude_step, elements, ring, DEGREE)
        return one_step.matrix_of(attitude_step, state, ring, DEGREE)

    length = checks.number("step", step, positive=True)
    intervals = attitude_step.intervals
    return of_transition(transition, Sampling(length, attitude_step.increments_per_step, intervals), tones)


def of_transition(transition: Transition, sampling: Sampling, tones: Sequence[Tone]) -> Rectification:
    """Return the error of the mean rate of anything that turns the attitude once a step, see `rectified`."""
    if not tones:
        raise InputError("tones is empty; one or more is needed")
    hertz = [checks.number("frequency-hz", tone.frequency_hz, positive=True) for tone in tones]
    ring = _oscillations(tuple(frequency * sampling.step for frequency in hertz))
    per_step = _generator(ring, _driving(transition, sampling, hertz, tones, ring), hertz, sampling.step)
    per_second = _generator(ring, _true_driving(hertz, tones, ring), hertz, None)
    sums: dict[tuple[int, tuple[int, ...]], Array] = {}
    for product in ring.resonant:
        degree = len(product)
        place = ring.places[degree][product]
        rate = per_step[degree][:, place] / float(sampling.step) - per_second[degree][:, place]
        turns = tuple(product.count(2 * k) - product.count(2 * k + 1) for k in range(len(tones)))
        first = next((count for count in turns if count), 0)
        if first < 0:  # the complex conjugate of another product
            continue
        key = degree, turns
        sums[key] = sums.get(key, np.zeros(3, complex)) + rate * (2 if first else 1)
    return Rectification(tuple(_Term(*key, read_only(rate)) for key, rate in sums.items()))


@lru_cache(maxsize=16)
def _oscillations(shares: tuple[Fraction, ...]) -> Oscillations:
    """Return the ring of some tones, which all algorithms with equal steps share."""
    return Oscillations(shares)


def _driving(
    transition: Transition,
    sampling: Sampling,
    hertz: Sequence[Fraction],
    tones: Sequence[Tone],
    ring: Oscillations,
) -> dict[int, Array]:
    """Return the transition of a step that begins at time zero, by degree, less the identity."""
    interval = float(sampling.step) / sampling.samples
    turns = [2j * math.pi * float(frequency) * interval for frequency in hertz]
    samples = []
    for k in sampling.intervals:
        gains = [
            (cmath.exp(turn * (k + 1)) - cmath.exp(turn * k)) * tone.gain
            for turn, tone in zip(turns, tones, strict=True)
        ]
        angles = zip(*(tone.angles for tone in tones), strict=True)
        increments = [[gain * c for gain, c in zip(gains, axis, strict=True)] for axis in angles]
        samples.append([Powers(ring, {1: ring.oscillating(axis)}, DEGREE) for axis in increments])
    elements = transition(samples, ring)
    return {
        degree: np.array(
            [element.parts[degree].values if degree in element.parts else none for element in elements]
        ).reshape(3, 3, -1)
        for degree in range(1, DEGREE + 1)
        for none in [np.zeros(len(ring.products[degree]), complex)]
    }


def _true_driving(hertz: Sequence[Fraction], tones: Sequence[Tone], ring: Oscillations) -> dict[int, Array]:
    """Return the skew-symmetric matrix of the body rate, of degree 1."""
    rates = [
        [2j * math.pi * float(frequency) * c for frequency, c in zip(hertz, axis, strict=True)]
        for axis in zip(*(tone.angles for tone in tones), strict=True)
    ]
    x, y, z = (ring.oscillating(axis).values for axis in rates)
    none = np.zeros_like(x)
    return {1: np.array([[none, -z, y], [z, none, -x], [-y, x, none]])}


def _generator(
    ring: Oscillations, driving: Mapping[int, Array], hertz: Sequence[Fraction], step: Fraction | None
) -> dict[int, Array]:
    """Return Omega of each degree as a vector for every product, in rad a step, or in rad/s without a step.

    `driving` (3, 3, number of products): a - I by degree, or [w x]. `step`: length of a step in s.
    """
    oscillating = {0: np.eye(3, dtype=complex)[:, :, None]}
    moved: dict[int, Array] = {}
    constant: dict[int, Array] = {}

    def times(a: int, x: Array, b: int, y: Array) -> Array:
        return ring.product(a, x, b, y, "ijn,jkn->ikn")

    for degree in range(1, DEGREE + 1):
        grown = np.zeros((3, 3, len(ring.products[degree])), complex)
        for part in driving.keys() & range(1, degree + 1):
            grown += times(degree - part, oscillating[degree - part], part, driving[part])
        rest = grown.copy()
        for part in range(1, degree):
            rest -= times(part, constant[part], degree - part, moved[degree - part])
        factors = np.array([_difference(product, hertz, step) for product in ring.products[degree]])
        has_mean = factors == 0
        constant[degree] = np.where(has_mean, rest, 0)
        oscillating[degree] = np.where(has_mean, 0, rest / np.where(has_mean, 1, factors))
        moved[degree] = oscillating[degree] if step is None else oscillating[degree] + grown
    if step is not None:
        constant = _logarithm(constant, times)
    return {degree: _axial(matrix) for degree, matrix in constant.items()}


def _logarithm(removed: Mapping[int, Array], times: Callable[..., Array]) -> dict[int, Array]:
    """Return -log(I - W) = W + W^2/2 + ... by degree."""
    total, power = dict(removed), dict(removed)
    for exponent in range(2, DEGREE + 1):
        power = {
            degree: sum(
                (
                    times(part, power[part], degree - part, removed[degree - part])
                    for part in power
                    if part < degree
                ),
                np.zeros_like(removed[degree]),
            )
            for degree in range(exponent, DEGREE + 1)
        }
        for degree, matrix in power.items():
            total[degree] = total[degree] + matrix / exponent
    return total


def _axial(matrix: Array) -> Array:
    """Return the vector of the skew-symmetric part of a matrix, (3, number of products)."""
    skew = [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    return np.asarray(np.array(skew) / 2, complex)


def _difference(product: Product, hertz: Sequence[Fraction], step: Fraction | None) -> complex:
    """Return the factor of a product for its difference from step to step, or for its derivative."""
    frequency = sum((hertz[k // 2] * (-1) ** k for k in product), Fraction(0))
    if step is None:
        return 2j * math.pi * float(frequency)
    periods = frequency * step % 1
    return cmath.exp(2j * math.pi * float(periods)) - 1 if periods else 0.0
