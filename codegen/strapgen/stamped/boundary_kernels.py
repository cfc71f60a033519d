"""Derives the integral of the rate from a boundary of an even grid to the instant that a stamp gives for it.

A sample is the integral of the rate between two instants. These are a little off the boundaries of an even grid, by
delta_j sampling intervals, and e_j = w_j delta_j + w'_j delta_j^2/2 is the integral between the two, w_j the rate at
the boundary and w'_j its slope. So d_j + e_j - e_(j+1) is the sample of the grid. Rate and slope follow from pairs of
samples around the boundary, the first from their sums and the other from their differences.
"""

from __future__ import annotations

import tomllib
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import NamedTuple

import sympy as sp

from strapgen.ir.signals import CYCLE, Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.stamped.kernel_names import WITH_SLOPE, kernel_name

_FILE = Path(__file__).with_name("boundary_filters.toml")
#: Largest distance of an instant from its boundary, in sampling intervals.
FARTHEST = Fraction(1, 20)


class BoundaryFilters(NamedTuple):
    """Weights of the pairs of samples around a boundary, the nearest pair first."""

    #: Of their sums, for the rate
    rate: tuple[Fraction, ...]
    #: Of their differences, for its slope
    slope: tuple[Fraction, ...]

    @property
    def largest(self) -> Fraction:
        """The most that samples of magnitude 1 make of a correction, and the most that errors of them do."""
        rate, slope = (2 * sum(map(abs, weights), Fraction(0)) for weights in self)
        return FARTHEST * (rate + FARTHEST / 2 * slope)


@cache
def filters(pairs: int) -> BoundaryFilters:
    """Return the filters of a number of pairs: 1, 2, 3, 5 or 7.

    >>> [str(weight) for weight in filters(2).rate], float(filters(3).largest)
    (['7/12', '-1/12'], 0.084...)
    """
    table = tomllib.loads(_FILE.read_text("utf-8"))[f"pairs-{pairs}"]
    return BoundaryFilters(*(tuple(map(Fraction, table[name])) for name in BoundaryFilters._fields))


def correction(pairs: int) -> Kernel:
    """Derive the integral of the rate from a boundary to its instant, from pairs of samples around it."""
    build = KernelBuilder()
    elements = tuple(f"d{k}_{axis}" for k in range(1, 2 * pairs + 1) for axis in "xyz")
    around = build.input(
        Signal(
            "increments",
            (2 * pairs, 3),
            elements,
            unit="rad",
            meaning=f"angle increments around the boundary, body axes, oldest first: {pairs} before it, {pairs} after "
            "it; the formula is linear in them, and takes velocity increments as well",
            bound=Fraction(1),
            frame="b",
            over=CYCLE,
        )
    )
    offset = build.scalar(
        Signal.scalar(
            "offset", meaning="instant less boundary, in intervals of the even grid", bound=FARTHEST
        )
    )
    vectors = [around[k, :].T for k in range(2 * pairs)]
    before, after = vectors[pairs - 1 :: -1], vectors[pairs:]
    weights = filters(pairs)

    def total(name: str, sign: int, taps: tuple[Fraction, ...], meaning: str) -> sp.Matrix:
        summed = sp.zeros(3, 1)
        for tap, old, new in zip(taps, before, after, strict=True):
            summed += sp.Rational(tap.numerator, tap.denominator) * (new + sign * old)
        return build.stage(Signal.vector(name, name, unit="rad", meaning=meaning, frame="b"), summed)

    mean = total("rate", 1, weights.rate, "rate at the boundary times the interval")
    if pairs in WITH_SLOPE:
        slope = total("slope", -1, weights.slope, "its change over an interval")
        mean = build.stage(
            Signal.vector(
                "mean",
                "mean",
                unit="rad",
                meaning="mean rate from the boundary to the instant, times the interval",
                frame="b",
            ),
            mean + offset / 2 * slope,
        )
    build.output(
        Signal.vector(
            "correction",
            "e",
            unit="rad",
            meaning="integral of the rate from the boundary to the instant, body axes",
            frame="b",
        ),
        offset * mean,
    )
    return build.kernel(
        kernel_name(pairs),
        f"Integral of the rate from a boundary of an even grid to its instant, from {pairs} pairs of samples"
        + ("" if pairs in WITH_SLOPE else ", without the slope of the rate"),
        "weights of the least largest error up to 1.3 rad a sample, exact on polynomials of the third degree"
        if pairs > 2
        else "the polynomial that has the samples",
    )
