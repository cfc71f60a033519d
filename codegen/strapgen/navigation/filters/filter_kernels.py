"""Derives the kernels of filters: sections of one or two trapezoidal integrators, one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import sympy as sp

from strapgen.ir.signals import ANY, Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.filters.filter_file import Filter
from strapgen.navigation.filters.proof import ROOM, bounds
from strapgen.navigation.filters.sections import Section
from strapgen.navigation.frame.frame_rates import FENNER

SAMPLE = Signal.vector("sample", "x", unit=ANY, meaning="what is filtered, any axes", frame=ANY)
FIRST, SECOND = (
    Signal.vector(name, name, unit=ANY, meaning=f"state of the {name} integrator, any axes", frame=ANY)
    for name in ("first", "second")
)
LOSS, COUPLING, SQUARE = (
    Signal.scalar(
        name, unit="1", meaning=f"{meaning}, K = tan(pi fc/fs), n = 1 + sqrt(2) K + K^2", bound=bound
    )
    for name, meaning, bound in (
        ("loss", "1 - 1/n", Fraction(1)),
        ("coupling", "K/n", Fraction(3, 10)),
        ("square", "K^2/n", Fraction(1)),
    )
)


@dataclass
class _Cascade:
    """The sections of a kernel as they are added."""

    build: KernelBuilder
    #: What the sections so far pass on, and their number in names; empty in a kernel of one section
    passed: Any
    suffix: str = ""

    def named(self, name: str, meaning: str, expression: Any) -> Any:
        """Name an intermediate quantity: a rounding is then one and the same wherever it is used."""
        name += self.suffix
        signal = replace(SAMPLE, name=name, elements=_named(name), meaning=meaning)
        return self.build.stage(signal, expression)

    def add(self, one: Section, signals: Sequence[Signal], states: Sequence[Any], is_last: bool) -> None:
        """Add a section whose coefficients are numbers or symbols, with its one or two states."""
        x, second, s2 = self.passed, signals[-1], states[-1]
        apart = self.named("apart", "sample less the second state", x - s2)
        change = one.square * apart
        if len(states) > 1:
            s1 = states[0]
            self.build.feedback(signals[0], s1 + 2 * (one.enter * apart - one.loss * s1))
            change = one.cross * s1 + change
        later = self.build.feedback(second, s2 + 2 * change)
        if is_last and not one.high and not one.centre and one.low == 1:
            self.passed = (s2 + later) / 2
            return
        slow, total = s2 + change, sp.zeros(3, 1)
        band = None
        if len(states) > 1 and not one.high == one.centre == 0:
            width, across = one.band
            band = self.named("band", "part of the sample at the centre", width * apart + across * s1)
            total += one.centre * band
        if one.high and one.high == one.low and band is not None:
            rest = x - band
            total += one.high * self.named("ends", "sample less that", rest)
        else:
            if one.high:
                slow = self.named("slow", "slow part of the sample", slow)
                rest = x - slow if band is None else x - band - slow
                total += one.high * self.named("fast", "fast part of the sample", rest)
            total += one.low * slow
        self.passed = total if is_last else self.named("passed", "output of the section", total)


def _named(prefix: str) -> tuple[str, ...]:
    """Return the names of the elements of a vector."""
    return tuple(f"{prefix}_{axis}" for axis in "xyz")


def _filtered(build: KernelBuilder, expression: Any, unit: str = ANY) -> None:
    signal = replace(SAMPLE, name="filtered", elements=_named("y"), meaning="the sample, filtered, any axes")
    build.output(replace(signal, unit=unit), expression)


def butterworth() -> Kernel:
    """Return a Butterworth filter of second order by the bilinear transformation, as two trapezoidal integrators.

    The analog filter is x1' = w (u - x2 - sqrt(2) x1), x2' = w x1, with w the angular frequency of the edge. By the
    trapezoidal rule with K = tan(pi fc/fs) in place of w T/2 its transfer function is
    (K^2/n) (1 + z^-1)^2/(1 + a1 z^-1 + a2 z^-2), n = 1 + sqrt(2) K + K^2, a1 = 2 (K^2 - 1)/n,
    a2 = (1 - sqrt(2) K + K^2)/n. The states are those of the integrators, so that no cycle lengthens their vector
    while the input is zero, and a constant input passes unchanged whatever the coefficients are rounded to.
    """
    build = KernelBuilder()
    *states, sample = map(build.input, (FIRST, SECOND, SAMPLE))
    cascade = _Cascade(build, sample)
    loss, coupling, square = map(build.scalar, (LOSS, COUPLING, SQUARE))
    cascade.add(Section(square, coupling, loss, coupling), (FIRST, SECOND), states, is_last=True)
    _filtered(build, cascade.passed)
    return build.kernel(
        "butterworth-2",
        "Butterworth filter of second order, bilinear, prewarped",
        f"type printed in {FENNER}; digital form derived: bilinear, prewarped, as integrators",
        notes=(
            "For rates and accelerations that are shown or control; never in the way of attitude or velocity.",
            "Unit any stands for the unit of the sample.",
        ),
    )


def cascade(described: Filter) -> Kernel:
    """Return the kernel of a filter that a file describes, its coefficients constants, its ranges proved."""
    build = KernelBuilder()
    proved = iter(bounds(described.sections).states)
    signals = [
        [
            replace(
                signal,
                name=f"{signal.name}{suffix}",
                elements=_named(f"{signal.name}{suffix}"),
                unit=described.unit,
                bound=_rounded_up(next(proved) * described.range * ROOM),
            )
            for signal in (FIRST, SECOND)[-len(one.states) :]
        ]
        for suffix, one in described.numbered
    ]
    states = [list(map(build.input, several)) for several in signals]
    sample = build.input(replace(SAMPLE, unit=described.unit, bound=described.range))
    whole = _Cascade(build, sample)
    for several, values, (suffix, one) in zip(signals, states, described.numbered, strict=True):
        whole.suffix = suffix
        whole.add(one, several, values, is_last=several is signals[-1])
    _filtered(build, whole.passed, described.unit)
    hertz = f"{float(described.sample_hz):g}"
    return build.kernel(
        f"filter-{described.name}",
        f"{described.title}, a filter for {hertz} samples in a second",
        described.source,
        arguments=f"filter {described.option}",
        notes=(
            f"All poles are inside the unit circle. Samples up to {float(described.range):g} take no state from "
            "zero beyond 16/17 of its range in exact arithmetic; strapgen study output-filter adds the rounding.",
        ),
    )


def _rounded_up(value: Fraction) -> Fraction:
    """Return a number that is not smaller, with few digits."""
    unit = Fraction(2) ** (value.numerator.bit_length() - value.denominator.bit_length() - 10)
    return -(-value // unit) * unit
