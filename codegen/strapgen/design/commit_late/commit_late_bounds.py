"""Bounds how far rounding moves the attitude of now in fixed point from exact arithmetic on the same integers.

The attitude of now is the committed one after the intervals that wait: L of them in a run, p + L at the end of the
start, and those of a gap. In each of them three things add to the distance: the rounding of the step; for the step from
Legendre coefficients the rounding of these times their derivatives, which interval arithmetic bounds over all samples;
and the distance before the step times what a transition can stretch it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

from strapgen.design.commit_late.fixed_filters import FixedFilters, Integers, NowErrors
from strapgen.design.commit_late.late_filters import LateFilters, Rows
from strapgen.design.commit_late.lost_samples import REACH
from strapgen.fixedpoint.floating.exact_ranges import ExactRanges
from strapgen.fixedpoint.floating.expressions import Expressions
from strapgen.fixedpoint.floating.sensitivities import sensitivities, slopes
from strapgen.fixedpoint.intervals import Interval
from strapgen.ir.exceptions import InputError
from strapgen.ir.interfaces import Argument, Interface
from strapgen.ir.kernel_info import Truncation
from strapgen.ir.program import Program

#: Binary digits of a square root.
_BITS = 80


class Advance(NamedTuple):
    """What one step adds to the distance from exact arithmetic."""

    #: Length of the difference that it adds, of a row for a matrix
    error: Fraction
    #: What it can multiply the distance before it by
    stretch: Fraction


def now_errors(
    filters: LateFilters,
    fixed: FixedFilters,
    programs: tuple[Program, Program],
    interfaces: tuple[Interface, Interface],
    truncation: Truncation,
) -> NowErrors:
    """Return bounds of the distance of the attitude of now from that of exact arithmetic."""
    running = _moved(filters.sets, fixed.sets, fixed, interfaces[1])
    starting = _moved(filters.short, fixed.short, fixed, interfaces[1])
    whole = _stretch(filters, fixed, programs[0], interfaces[0], truncation)
    part = _stretch(filters, fixed, programs[1], interfaces[1], truncation)
    step = Advance(_row_length(interfaces[0].outputs[0].errors), whole)
    by_sets, by_short = (
        Advance(_rounding(programs[1], interfaces[1], moved), part) for moved in (running, starting)
    )
    previous, ahead = filters.window.previous, filters.window.ahead
    # The most wait in a gap at the end of the start: p intervals with fewer samples before them, those of the gap,
    # which have all samples, and L with fewer samples ahead.
    gap = [by_sets] * previous + [step] * REACH + [by_sets] * ahead
    start = _total([by_short] * (previous + ahead))
    # A sample that is lost before the end of the start waits among the intervals of the start.
    return NowErrors(_total([by_sets] * ahead), start, max(start, _total(gap)))


def _total(steps: Iterable[Advance]) -> Fraction:
    """Return the distance after steps."""
    total = Fraction(0)
    for step in steps:
        total = step.stretch * total + step.error
    return total


def _box(interface: Interface) -> dict[str, Interval]:
    """Return the ranges of all elements of the inputs."""
    return {
        name: Interval.symmetric(argument.high * argument.unit)
        for argument in interface.inputs
        for name in argument.signal.elements
    }


def _stretch(
    filters: LateFilters, fixed: FixedFilters, program: Program, interface: Interface, truncation: Truncation
) -> Fraction:
    """Return what the transition of a step can multiply a distance by."""
    expressions = Expressions.of(program)
    ranges = ExactRanges(program, expressions, _box(interface)).ranges
    left_out = truncation.bound(ranges[expressions.names[truncation.square]].magnitude)
    if left_out is None:
        raise InputError(
            f"{filters.window.name}: the rotations of one-sided filters have no bound for samples up to "
            f"{float(fixed.limit * Fraction(2) ** -fixed.fraction):g} rad; a smaller largest angle is needed"
        )
    return 1 + left_out


def _rounding(program: Program, interface: Interface, moved: Mapping[str, Fraction]) -> Fraction:
    """Return what the step from Legendre coefficients adds to the distance: its rounding, and that of its inputs."""
    expressions = Expressions.of(program)
    derivatives = slopes(expressions, ExactRanges(program, expressions, _box(interface)).ranges)
    elements = []
    for place, error in zip(expressions.results["next"], interface.outputs[0].errors, strict=True):
        by = sensitivities(expressions, derivatives, place)
        inputs = (by.get(expressions.names[name], Fraction(0)) * size for name, size in moved.items())
        elements.append(error + sum(inputs, Fraction(0)))
    return _row_length(elements)


def _row_length(elements: Sequence[Fraction]) -> Fraction:
    """Return the length of a state's difference, or of the longest row of a matrix."""
    width = 3 if len(elements) == 9 else len(elements)
    return max(_length(elements[k : k + width]) for k in range(0, len(elements), width))


def _moved(
    exact: Sequence[Rows],
    integers: Sequence[tuple[Integers, ...]],
    fixed: FixedFilters,
    interface: Interface,
) -> Mapping[str, Fraction]:
    """Return by how much the rounding of filters moves every element of a Legendre coefficient at most."""
    inputs: dict[str, Argument] = {argument.signal.name: argument for argument in interface.inputs}
    sample = (
        fixed.limit * Fraction(2) ** -fixed.fraction
    )  # of a gyro's counts, less their scale, as in the taps
    moved: dict[str, Fraction] = {}
    for number, (m, shift) in enumerate(zip(fixed.sums, fixed.shifts, strict=True)):
        argument = inputs[f"legendre_{m}"]
        unit = Fraction(2) ** (fixed.fraction - shift - argument.format.fraction)
        off = max(
            sum(
                (abs(tap * unit - value) for tap, value in zip(taps[number], rows[m], strict=True)),
                Fraction(0),
            )
            for taps, rows in zip(integers, exact, strict=True)
        )
        moved |= dict.fromkeys(argument.signal.elements, off * sample + argument.unit / 2)
    return moved


def _length(values: Sequence[Fraction]) -> Fraction:
    """Return a number not below the length of a vector, and hardly above."""
    square = sum((value * value for value in values), Fraction(0))
    return Fraction(math.isqrt(math.ceil(square * 4**_BITS)) + 1, 2**_BITS)
