"""Coning coefficients, which give the second-order term of the rotation vector from cross products.

The term is half the integral of (integral of the rate) x (rate). A design has a weight for the cross product of every
two samples. Samples do not determine the term, and the forms of a design differ in the rates for which they are exact:

- uncompressed is exact for the polynomial rate through the samples;
- compressed crosses the newest sample with a weighted sum of the older ones, and is exact on coning to the highest
  power of frequency times sampling interval. With three or more samples it is only of third order on other motion;
- combined is exact on coning to the same power, and on polynomials to the same order in the step as uncompressed. Among
  all such designs it is the one nearest to the uncompressed coefficients, in the sum of squares.

Sculling is half the integral of (integral of the rate) x a + (integral of a) x (rate), with the acceleration a. It is
the same bilinear form with one side replaced, so it has the coefficients of coning.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property
from itertools import count, pairwise

import sympy as sp
from sympy.polys.matrices import DomainMatrix

from strapgen.catalogue.methods import rotation_series
from strapgen.catalogue.methods.rotation_series import Scalars, fraction
from strapgen.ir import checks
from strapgen.ir.exceptions import InputError
from strapgen.ir.notebook_display import notebook_latex, short_repr
from strapgen.ir.read_only import ReadOnly

SOURCES = {
    "compressed": "M. B. Ignagni, J. Guid. Control Dyn. 13 (1990) 363-369",
    "uncompressed": "R. B. Miller, J. Guid. Control Dyn. 6 (1983) 287-291",
    "combined": "M. Song, W. Wu, X. Pan, J. Guid. Control Dyn. 36 (2013) 1872-1880, for polynomials and coning",
}
FORMS = tuple(SOURCES)
#: Most samples of a slow cycle, and most samples from before it.
MOST_SAMPLES, MOST_KEPT = 12, 32
#: Most samples in all of combined coefficients: the time of their design grows with the fourth power of that number.
MOST_COMBINED = 17


@dataclass(frozen=True)
class Design(ReadOnly):
    """Coefficients of the cross products of samples."""

    form: str  # one of `FORMS`, or "shaped" for coefficients of a file
    increments: int  # of the slow cycle
    previous: int  # samples from before it
    #: Coefficients of the cross products older x newer, by the numbers of the two samples, of which the oldest is 0; in
    #: the order of the newer sample, then of the older one.
    pairs: Scalars

    __repr__ = short_repr
    _repr_latex_ = notebook_latex

    def _in_words(self) -> str:
        return f"{self.form}, {self.increments} samples, {self.previous} before them, {len(self.pairs)} coefficients"

    @cached_property
    def degree(self) -> int:
        """The total degree up to which products of two powers of time in the rate are integrated exactly."""
        for total in count(1):
            for row, value in polynomial_conditions(self.increments, self.previous, total):
                if sum(row[pair] * c for pair, c in self.pairs.items()) != value:
                    return total - 1
        raise AssertionError("the samples are finite in number")

    def residual(self) -> _ResidualDrift:
        """Return the drift on coning that the design does not compensate."""
        sines: dict[int, Fraction] = {self.increments: Fraction(1, 2)}
        for (older, newer), c in self.pairs.items():
            distance = newer - older
            for multiple, weight in ((distance, 2), (distance + 1, -1), (distance - 1, -1)):
                sines[multiple] = sines.get(multiple, Fraction(0)) + weight * c
        nonzero = {m: c for m, c in sorted(sines.items()) if m and c}
        return _ResidualDrift(self.increments, nonzero)


@dataclass(frozen=True)
class _ResidualDrift:
    """The mean residual drift on coning, computed minus true, to second order in the half-angle of the cone.

    The rotation vector of the body is alpha (cos omega t, sin omega t, 0); samples are T apart, and lambda = omega T.
    Over a slow cycle of N samples the second-order term is alpha^2 (N lambda - sin(N lambda)) / 2 about the third axis.
    The cross product of two samples m apart is 2 alpha^2 (1 - cos lambda) sin(m lambda). The drift in rad/s is
    alpha^2 / (N T) times the sum of c_m sin(m lambda), minus N lambda / 2.
    """

    increments: int  # N
    sines: dict[int, Fraction]  # c_m by m

    def series(self) -> Iterator[tuple[int, Fraction]]:
        """Yield the powers of lambda with nonzero coefficients in the drift, in units of alpha^2 / (N T)."""
        for q in count():
            power = 2 * q + 1
            total = sum((c * m**power for m, c in self.sines.items()), Fraction(0))
            total *= Fraction((-1) ** q, math.factorial(power))
            total -= Fraction(self.increments, 2) if q == 0 else 0
            if total:
                yield power, total

    @property
    def leading(self) -> tuple[int, Fraction]:
        """The lowest power of lambda and its coefficient in the drift, in units of alpha^2 / (N T)."""
        return next(self.series())

    @property
    def expression(self) -> str:
        """The drift in rad/s as text that SymPy can read, in alpha (rad), omega (rad/s) and T (s)."""
        interval = _times(self.increments, "T")
        terms = [f"-{_times(Fraction(self.increments, 2), 'omega*T')}"]
        for m, c in self.sines.items():
            sine = f"sin({_times(m, 'omega*T')})"
            terms.append(f"{'+' if c > 0 else '-'} {_times(abs(c), sine)}")
        return f"alpha**2/{interval if self.increments == 1 else f'({interval})'}*({' '.join(terms)})"

    @property
    def leading_expression(self) -> str:
        """The leading term of the drift in rad/s, in the same symbols."""
        power, c = self.leading
        return f"{c / self.increments}*alpha**2*omega*(omega*T)**{power - 1}"


def _times(c: Fraction | int, factor: str) -> str:
    return factor if c == 1 else f"{c}*{factor}"


def design(samples: int, previous: int = 0, form: str = "compressed") -> Design:
    """Derive coning coefficients of a form in `FORMS` exactly, for samples of the slow cycle and ones before it.

    >>> [str(c) for c in design(3).pairs.values()]
    ['9/20', '27/20']
    >>> [str(c) for c in design(3, form="uncompressed").pairs.values()]
    ['57/80', '33/80', '57/80']
    """
    count = checks.count("samples", samples, largest=MOST_SAMPLES)
    before = checks.count("previous", previous, smallest=0, largest=MOST_KEPT)
    if checks.choice("form", form, FORMS) == "combined" and count + before > MOST_COMBINED:
        raise InputError(
            f"samples {count} and previous {before} are {count + before} together; at most {MOST_COMBINED} are allowed "
            "for combined coefficients"
        )
    return _design(count, before, form)


@cache
def _design(samples: int, previous: int, form: str) -> Design:
    solve = {"compressed": _compressed, "uncompressed": _uncompressed, "combined": _combined}
    return Design(form, samples, previous, solve[form](samples, previous))


def powers(samples: int, previous: int, power: int) -> list[Fraction]:
    """Return the samples of the rate t^power, oldest first, where t runs from 0 to 1 over the slow cycle."""
    integral = [Fraction(k, samples) ** (power + 1) / (power + 1) for k in range(-previous, samples + 1)]
    return [b - a for a, b in pairwise(integral)]


def _pairs(total: int) -> list[tuple[int, int]]:
    return [(older, newer) for newer in range(total) for older in range(newer)]


def _compressed(samples: int, previous: int) -> Scalars:
    total = samples + previous
    newest = [pair for pair in _pairs(total) if pair[1] == total - 1]
    rows = [([row[pair] for pair in newest], value) for row, value in _coning(samples, previous)]
    return dict(zip(newest, _nearest(rows, [Fraction(0)] * len(newest)), strict=True))


def _uncompressed(samples: int, previous: int) -> Scalars:
    total = samples + previous
    second = rotation_series.terms(total, 2)[1]
    coefficients = rotation_series.pairs(rotation_series.in_samples(second, samples, previous))
    return {pair: coefficients.get(pair, Fraction(0)) for pair in _pairs(total)}


def _combined(samples: int, previous: int) -> Scalars:
    total = samples + previous
    pairs, plain = _pairs(total), _uncompressed(samples, previous)
    conditions = [
        *(
            condition
            for degree in range(1, total)
            for condition in polynomial_conditions(samples, previous, degree)
        ),
        *_coning(samples, previous),
    ]
    rows = [([row[pair] for pair in pairs], value) for row, value in conditions]
    return dict(zip(pairs, _nearest(rows, [plain[pair] for pair in pairs]), strict=True))


def polynomial_conditions(samples: int, previous: int, total: int) -> Iterator[tuple[Scalars, Fraction]]:
    """Yield a condition for each product of two powers of time with a total degree: weights of the pairs, due value."""
    truth = rotation_series.pairs(rotation_series.terms(total + 1, 2)[1])
    for j in range((total + 1) // 2):
        k = total - j
        low, high = powers(samples, previous, j), powers(samples, previous, k)
        row = {(a, b): low[a] * high[b] - high[a] * low[b] for a, b in _pairs(len(low))}
        yield row, truth[j, k]


def _coning(samples: int, previous: int) -> Iterator[tuple[Scalars, Fraction]]:
    """Yield a condition for each power of lambda on coning: the coefficients of the pairs and the true value.

    They follow from the sines in `_ResidualDrift`: the coefficient of lambda^(2q+1) in sin(m lambda) is (-1)^q m^(2q+1)
    / (2q+1)!, whose factor without m is common to both sides and left out.
    """
    total = samples + previous
    for q in range(1, total):
        power = 2 * q + 1
        row = {(older, newer): power_of_coning(newer - older, power) for older, newer in _pairs(total)}
        yield row, -(Fraction(samples) ** power) / 2


def power_of_coning(distance: int, power: int) -> Fraction:
    """Return the coefficient of lambda^power, power odd, in 2 sin(m lambda) (1 - cos lambda), times +-power!."""
    m = Fraction(distance)
    return 2 * m**power - (m + 1) ** power - (m - 1) ** power


def _nearest(conditions: list[tuple[list[Fraction], Fraction]], start: list[Fraction]) -> list[Fraction]:
    """Return the solution of linear conditions that is nearest to a point, in the sum of squares."""
    if not conditions:
        return start
    system = [
        [*row, value - sum((a * x for a, x in zip(row, start, strict=True)), Fraction(0))]
        for row, value in conditions
    ]
    domain = sp.QQ
    reduced, pivots = DomainMatrix(
        [[domain(c.numerator, c.denominator) for c in row] for row in system],
        (len(system), len(start) + 1),
        domain,
    ).rref()
    if len(start) in pivots:
        raise InputError("the conditions on the coning coefficients contradict each other")
    rank = len(pivots)
    matrix = reduced.extract(range(rank), range(len(start)))
    right = reduced.extract(range(rank), [len(start)])
    step = matrix.transpose() * (matrix * matrix.transpose()).lu_solve(right)
    return [x + fraction(sp.Rational(c)) for x, c in zip(start, step.to_Matrix(), strict=True)]
