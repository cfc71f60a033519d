"""Steps by a window: filters on samples from both sides of the step give the rate over it.

The filters give the Legendre coefficients c_m of the rate over the step. The rotation vector is their series to fourth
order in the rate, whose terms of third and fourth order take c_0, c_1 and c_2 alone. In its lean form two products of
second order that share the coefficient of odd degree are one product, and the even coefficients enter it as filters of
their own: c_k x e_(k-1) with e_(k-1) = c_(k+1) / (2 (2k+1) (2k+3)) - c_(k-1) / (2 (2k-1) (2k+1)).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cache

import sympy as sp

from strapgen.catalogue.kinematics import Kinematics
from strapgen.catalogue.methods import polynomial_rotation, rate_fit, rotation_series
from strapgen.catalogue.methods.method import PHI, Method, Samples
from strapgen.catalogue.methods.rotation_series import Scalars, Words, fraction
from strapgen.catalogue.methods.window import Taps, Window
from strapgen.ir.kernel_info import Truncation
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import cross, dot, exact
from strapgen.kernel.kernel import KernelBuilder

#: Highest degree of the Legendre coefficients in the rotation vector, and order of a step with its terms.
DEGREE, _FOURTH = 4, 6
#: Highest power of the rotation vector in its exponential. At half a radian the powers left out are below 3e-18 in
#: Euler parameters, which are of half the angle, and below 3e-14 in direction cosines.
SERIES = 12
#: Name of the square of the angle.
_SQUARE = "angle_square"


def method(window: Window, filtered: Filtered | None = None) -> Method:
    """Return the step by a window, in a kernel that has its filters on them."""

    def rotation_vector(build: KernelBuilder, samples: Samples) -> sp.Matrix:
        return build.stage(PHI, _rotation_vector(build, filtered or Filtered(build, samples, window)))

    def transition(build: KernelBuilder, kinematics: Kinematics, samples: Samples) -> sp.Matrix:
        phi = rotation_vector(build, samples)
        square = build.value(_SQUARE, dot(phi, phi), "square of the angle of the step")
        return kinematics.exponential(phi, SERIES, square)

    def exact_rotation(build: KernelBuilder, kinematics: Kinematics, samples: Samples) -> sp.Matrix:
        rate = filtered or Filtered(build, samples, window)
        coefficients = [rate.coefficient(m) for m in range(window.degree + 1)]
        return polynomial_rotation.rotation(build, kinematics, coefficients, window.terms, window.increments)

    fourth = Method(
        window.name,
        window.title,
        f"{window.source}; {rotation_series.SOURCE}",
        _FOURTH,
        transition,
        option=window.option,
        rotation_vector=rotation_vector,
        limit=lambda increments, previous, ahead: _order(window),
        fit=lambda increments, previous, ahead: rate_fit.from_legendre(window.filters),
        conditions=window.conditions,
        isometry=lambda count: True,
        truncation=lambda kinematics: Truncation(SERIES, fraction(kinematics.scale), _SQUARE),
        window=window,
    )
    if window.rotation == "fourth":
        return fourth
    return replace(
        fourth,
        source=f"{window.source}; {polynomial_rotation.SOURCE}",
        order=window.terms,
        transition=exact_rotation,
        rotation_vector=None,
        truncation=None,
    )


def _order(window: Window) -> int:
    """Return the order that the filters allow: that of the drift which the first power of time outside them leaves.

    With the conditions r the coefficient c_m errs by the power r + 1 of the step, or by the next one where r is of the
    other parity than m and the filters have a parity; the product with c_0, or with c_1, has one power more, or two.
    """
    return window.conditions + (2 if window.parity and window.conditions % 2 == 0 else 1)


@cache
def _lever(odd: int, degree: int) -> dict[int, Fraction]:
    """Return the weights of the even Legendre coefficients in the vector e that an odd one is crossed with."""
    pairs = rotation_series.pairs(rotation_series.legendre_terms(degree + 1, 2)[1])
    below = {odd - 1: -pairs[odd - 1, odd]}
    return below if odd == degree else {**below, odd + 1: pairs[odd, odd + 1]}


class Filtered:
    """The filters of a window as stages of a kernel, on sums and differences of samples where they have a parity."""

    def __init__(self, build: KernelBuilder, samples: Samples, window: Window) -> None:
        self._build, self._samples, self._window = build, samples, window
        self._folded: dict[tuple[int, int], sp.Matrix] = {}
        self._known: dict[str, sp.Matrix] = {}
        self.degree: int = min(window.degree, DEGREE)

    def coefficient(self, m: int) -> sp.Matrix:
        """Return a Legendre coefficient of the rate times the step."""
        meaning = f"Legendre coefficient {m} of the rate times the step"
        return self._sum(f"legendre_{m}", self._window.filters[m], m, meaning)

    def lever(self, odd: int) -> sp.Matrix:
        """Return the vector that an odd Legendre coefficient is crossed with."""
        parts = _lever(odd, self.degree)
        rows = [[weight * tap for tap in self._window.filters[m]] for m, weight in parts.items()]
        taps = tuple(sum(column, Fraction(0)) for column in zip(*rows, strict=True))
        meaning = " and ".join(map(str, parts))
        return self._sum(
            f"lever_{odd}", taps, odd - 1, f"what Legendre coefficient {odd} is crossed with, of {meaning}"
        )

    def _sum(self, name: str, taps: Taps, m: int, meaning: str) -> sp.Matrix:
        """Add a stage for the sum of the samples, each times its tap, once."""
        if name not in self._known:
            self._known[name] = self._added(name, taps, m, meaning)
        return self._known[name]

    def _added(self, name: str, taps: Taps, m: int, meaning: str) -> sp.Matrix:
        if not self._window.parity:
            return self._samples.combination(name, [exact(tap) for tap in taps], meaning)
        sign, count = (-1) ** m, self._window.increments
        after = self._window.previous + count
        total = sp.zeros(3, 1)
        for j in (*range(1, self._window.ahead + 1), *range(1 - count // 2, 1)):
            if taps[after + j - 1]:
                total += exact(taps[after + j - 1]) * self._pair(j, sign)
        if count % 2 and taps[after - (count + 1) // 2]:
            total += exact(taps[after - (count + 1) // 2]) * self._sample(after - (count + 1) // 2)
        return self._build.stage(Signal.vector(name, name, unit="rad", meaning=meaning), total)

    def _pair(self, j: int, sign: int) -> sp.Matrix:
        """Return the sum or the difference of the samples j after the step and j before it, from 0 down those in it."""
        if (j, sign) not in self._folded:
            weights = [sp.Integer(0)] * self._window.total_increments
            weights[self._window.previous + self._window.increments - 1 + j] = sp.Integer(1)
            weights[self._window.previous - j] = sp.Integer(sign)
            name, what = ("pair", "sum") if sign > 0 else ("gap", "difference")
            meaning = f"{what} of the samples {j} after the step and before it"
            if j < 1:
                name, meaning = f"inner_{name}", f"{what} of the samples {1 - j} from the ends of the step"
            name = f"{name}_{j if j > 0 else 1 - j}"
            self._folded[j, sign] = self._samples.combination(name, weights, meaning)
        return self._folded[j, sign]

    def _sample(self, k: int) -> sp.Matrix:
        return self._samples.combination(
            "", [sp.Integer(int(k == other)) for other in range(self._window.total_increments)], ""
        )


def _rotation_vector(build: KernelBuilder, rate: Filtered) -> sp.Matrix:
    """Return the rotation vector to fourth order in its lean form, from c_0, c_1 and e_0, and from c_3 and e_2."""
    vectors = [rate.coefficient(0), rate.coefficient(1), *([rate.lever(1)] if rate.degree > 1 else [])]
    second, third, fourth = _lean_series(len(vectors))
    scalars = _Scalars(build, vectors)

    def crossed(k: int, m: int) -> sp.Expr:
        constant = second.get((k, m), Fraction(0))
        return scalars.weight(f"weight_{k}_{m}", constant, fourth.get((k, m), {}))

    phi = sp.zeros(3, 1)
    for k, vector in enumerate(vectors):
        phi += scalars.weight(f"weight_{k}", Fraction(int(k == 0)), third.get(k, {})) * vector
    beside = sp.zeros(3, 1)
    for m, vector in enumerate(vectors[1:], 1):
        beside += crossed(0, m) * vector
    signal = Signal.vector("beside_0", "beside_0", unit="rad", meaning="what c_0 is crossed with")
    phi += cross(vectors[0], build.stage(signal, beside))
    if rate.degree > 1:
        phi += crossed(1, 2) * _cross(build, "cross_1", vectors[1], vectors[2], "c_1 x e_0")
    for odd in range(3, rate.degree + 1, 2):
        meaning = f"c_{odd} x e_{odd - 1}"
        phi += _cross(build, f"cross_{odd}", rate.coefficient(odd), rate.lever(odd), meaning)
    return phi


@cache
def _lean_series(vectors: int) -> tuple[Scalars, dict[int, Scalars], dict[tuple[int, int], Scalars]]:
    """Return the terms of second, third and fourth order of a rate of two or three vectors, in c_0, c_1 and e_0.

    In powers of the step c_m is of the order m + 1. What is of higher order than the step is left out, but of the
    products with c_0 x c_1: without the last of them a fast cone of 15 degrees drifts four times as much.
    """
    _, second, third, fourth = rotation_series.legendre_terms(vectors, 4)
    table = [{0: Fraction(1)}, {1: Fraction(1)}]
    if vectors == 3:  # c_2 from e_0 and c_0
        lever = _lever(1, 2)
        table.append({0: -lever[0] / lever[2], 2: 1 / lever[2]})
    crossed = rotation_series.pairs(rotation_series.substituted(second, table))
    scaled: dict[int, Scalars] = {}
    words: Words = {
        (k, *key): c for k, row in rotation_series.third_order(third).items() for key, c in row.items()
    }
    for (k, *key), c in rotation_series.substituted(words, table).items():
        _collect(scaled.setdefault(k, {}), key, c)
    turned: dict[tuple[int, int], Scalars] = {}
    words = {
        (*pair, *key): c
        for pair, row in rotation_series.fourth_order(fourth).items()
        for key, c in row.items()
        if pair == (0, 1) or sum(pair) + sum(key) + 4 <= _FOURTH + 1
    }
    for (k, m, *key), c in rotation_series.substituted(words, table).items():
        if k != m:
            _collect(turned.setdefault((min(k, m), max(k, m)), {}), key, c if k < m else -c)
    return crossed, scaled, turned


def _collect(row: Scalars, key: list[int], c: Fraction) -> None:
    low, high = sorted(key)
    row[low, high] = row.get((low, high), Fraction(0)) + c


class _Scalars:
    """The weights of vectors in the terms of third and fourth order: sums of scalar products of coefficients."""

    def __init__(self, build: KernelBuilder, vectors: Sequence[sp.Matrix]) -> None:
        self._build, self._vectors = build, vectors
        self._products: dict[tuple[int, int], sp.Symbol] = {}

    def weight(self, name: str, constant: Fraction, row: Scalars) -> sp.Expr:
        """Return a constant plus scalar products, each times its coefficient."""
        total: sp.Expr = exact(constant)
        for (i, j), c in sorted((key, c) for key, c in row.items() if c):
            if (i, j) not in self._products:
                self._products[i, j] = self._build.value(
                    f"product_{i}_{j}",
                    dot(self._vectors[i], self._vectors[j]),
                    f"scalar product of Legendre coefficients {i} and {j}",
                )
            total += exact(c) * self._products[i, j]
        return self._build.value(name, total, "weight of a vector") if any(row.values()) else total


def _cross(build: KernelBuilder, name: str, left: sp.Matrix, right: sp.Matrix, meaning: str) -> sp.Matrix:
    return build.stage(Signal.vector(name, name, meaning=meaning), cross(left, right))
