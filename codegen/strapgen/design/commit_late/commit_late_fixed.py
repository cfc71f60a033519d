"""Committing late in fixed point: functions whose formats fit together, integer taps, and bounds of the rounding.

A sum of taps times samples is exact in 64 bits and rounded once, to the format that the step from Legendre coefficients
takes. Taps are rounded inside their conditions: a constant rate and one that grows evenly give what they must, exactly.

The bounds say how far rounding moves the attitude of now from exact arithmetic on the same integers. That attitude is
the committed one after the intervals that wait: L of them in a run, p + L at the end of the start, and those of a gap.
In each of them three things add to the distance: the rounding of the step; for the step from Legendre coefficients the
rounding of these times their derivatives, which interval arithmetic bounds over all samples; and the distance before
the step times what a transition can stretch it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.design.commit_late.late_filters import (
    REACH,
    FixedFilters,
    Integers,
    LateFilters,
    PresentErrors,
    Rows,
)
from strapgen.fixedpoint.floating.errors import Expressions, sensitivities, slopes
from strapgen.fixedpoint.floating.exact_ranges import ExactRanges
from strapgen.fixedpoint.intervals import Interval
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import finest
from strapgen.ir.interfaces import Argument, Interface
from strapgen.ir.kernel_info import Truncation
from strapgen.ir.program import Program
from strapgen.ir.sources import Sources

#: Bits of a word, and of a sum of products.
WORD, WIDE = 32, 64


def functions(
    filters: LateFilters, choices: tuple[Choice, Choice, Choice], target: str, settings: Settings
) -> tuple[tuple[Sources, Sources, Sources], FixedFilters, LateFilters]:
    """Return the generated functions in formats that fit together, and the taps for them."""
    if filters.exact:
        raise InputError(
            f"the rotation of {filters.window.name} is exact; in fixed point only that to fourth order can be "
            "committed late"
        )
    if settings.word != WORD:
        raise InputError(f"word is {settings.word}; words of {WORD} bits commit late")
    if settings.input_bits not in (None, settings.default_input_bits, WORD):
        raise InputError(
            f"input bits is {settings.input_bits}; what commits late takes samples as words of {WORD}"
        )
    if settings.state or settings.ranges or settings.formats:
        raise InputError("what commits late has neither a state that saturates nor ranges or formats")
    filters = replace(filters, calm_start=True)
    if settings.sensor is not None:
        filters = replace(filters, scale=settings.sensor.scale)
        settings = replace(settings, input_bits=WORD)
    step = pipeline.compile(choices[0], target, settings)
    interface = interface_of(step)
    samples = interface.inputs[1]
    sums = filters.sums
    fractions = {
        m: _fraction([row[m] for row in (*filters.sets, *filters.short)], samples.high) for m in sums
    }
    rotation = pipeline.compile(choices[1], target, _of_rotation(filters, interface))
    normalization = pipeline.compile(choices[2], target, interface.companion_settings)
    inputs = {argument.signal.name: argument for argument in interface_of(rotation).inputs}
    moments = 2 if filters.window.gyro is None else 1

    def integers(groups: Sequence[Rows]) -> tuple[tuple[Integers, ...], ...]:
        return tuple(tuple(rounded(group[m], fractions[m], moments) for m in sums) for group in groups)

    restoration = filters.restoration
    bits = _fraction(restoration, samples.high)
    fixed = FixedFilters(
        samples.high,
        samples.format.fraction,
        sums,
        integers(filters.sets),
        integers(filters.short),
        tuple(fractions[m] + samples.format.fraction - inputs[f"legendre_{m}"].format.fraction for m in sums),
        (rounded(restoration.lost, bits, 1), rounded(restoration.merged, bits, 1)),
        bits,
    )
    _require_room(fixed, inputs)
    errors = now_errors(
        filters,
        fixed,
        (pipeline.program(choices[0]), pipeline.program(choices[1])),
        (interface, interface_of(rotation)),
        _truncation(choices[0]),
    )
    return (step, rotation, normalization), replace(fixed, now_errors=errors), filters


def _of_rotation(filters: LateFilters, interface: Interface) -> Settings:
    """Return the settings of the step from Legendre coefficients: it takes any sums, and samples in their format."""
    state, samples = interface.inputs
    size = samples.high * samples.format.unit
    largest = {
        m: max(sum(map(abs, row[m]), Fraction(0)) for row in (*filters.sets, *filters.short)) * size * _SPARE
        for m in filters.sums
    }
    formats = {"state": str(state.format), "next": str(state.format)}
    if filters.sums.start:
        formats["legendre_0"] = str(samples.format)
        largest[0] = size
    ranges = {f"legendre_{m}": largest[m] for m in sorted(largest)}
    settings = replace(interface.settings, sensor=None, input_bits=None, stated="")
    return replace(settings, carry="none", ranges=ranges, formats=formats)


def _truncation(step: Choice) -> Truncation:
    """Return the truncation error of the series for the rotation of a step."""
    kernels = pipeline.program(step).attitude_step
    assert kernels is not None
    assert kernels.truncation is not None, "the rotation is a series"
    return kernels.truncation


#: What rounding may add to a sum.
_SPARE = Fraction(1 + Fraction(1, 1 << 20))


def interface_of(sources: Sources) -> Interface:
    """Return the interface of sources in fixed point."""
    assert sources.fixed is not None, "its target is one of fixed point"
    return sources.fixed


def rounded(taps: Sequence[Fraction], fraction: int, moments: int) -> Integers:
    """Return taps as integers times 2^-fraction, whose first moments over the samples are exact.

    The error of each tap goes on to the next ones, and the last taps take up what is left, a few units.

    >>> rounded([Fraction(-1, 3), Fraction(0), Fraction(1, 3)], 4, 1)
    (-5, 0, 5)
    """
    exact = [tap * (1 << fraction) for tap in taps]
    result: list[int] = []
    last = before = Fraction(0)
    for value in exact:
        aim = value - (2 * last - before if moments == 2 else last)
        result.append(round(aim))
        last, before = result[-1] - aim, last
    total = round(sum(exact, Fraction(0))) - sum(result)
    count = len(result)
    if moments == 1 or count == 1:
        result[-1] += total
        return tuple(result)
    moment = round(sum((j * x for j, x in enumerate(exact)), Fraction(0)))
    moment -= sum(j * y for j, y in enumerate(result))
    end = moment - (count - 2) * total
    result[-1] += end
    result[-2] += total - end
    return tuple(result)


def _fraction(rows: Sequence[Sequence[Fraction]], limit: int) -> int:
    """Return the fraction bits of taps: words hold them, and 64 bits the sum with samples of any size."""
    largest = max(abs(tap) for row in rows for tap in row)
    total = max(sum(map(abs, row), Fraction(0)) for row in rows)
    return min(finest(largest * _SPARE, WORD), finest(total * limit * _SPARE, WIDE - 1), WORD)


def _require_room(filters: FixedFilters, inputs: dict[str, Argument]) -> None:
    """Prove that no sum leaves 64 bits, and that the step takes every rounded sum."""
    for number, m in enumerate(filters.sums):
        sizes = [sum(map(abs, group[number])) for group in (*filters.sets, *filters.short)]
        shift = filters.shifts[number]
        most = max(sizes) * filters.limit + (1 << (shift - 1)) if shift > 0 else 0
        if shift <= 0:
            raise InputError(
                f"samples are at most {filters.limit} in magnitude, too few units to commit late; a finer count, or a "
                "larger rate, is needed"
            )
        assert most < 1 << (WIDE - 1), "a sum leaves its word"
        assert most >> shift <= inputs[f"legendre_{m}"].high, "a coefficient leaves its range"
    assert max(sum(map(abs, row)) for row in filters.restoring) * filters.limit < 1 << (WIDE - 2)
    taps = [tap for rows in (*filters.sets, *filters.short, filters.restoring) for row in rows for tap in row]
    assert max(map(abs, taps)) < 1 << (WORD - 1), "a tap leaves its word"


#: Binary digits of a square root.
_BITS = 80


# Bounds how far rounding moves the attitude of now in fixed point from exact arithmetic on the same integers.
#
# The attitude of now is the committed one after the intervals that wait: L of them in a run, p + L at the end of the
# start, and those of a gap. In each of them three things add to the distance: the rounding of the step; for the step
# from Legendre coefficients the rounding of these times their derivatives, which interval arithmetic bounds over all
# samples; and the distance before the step times what a transition can stretch it.


class Advance(NamedTuple):
    """Growth of the distance from exact arithmetic in one step."""

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
) -> PresentErrors:
    """Return bounds of the distance of the attitude of now from that of exact arithmetic."""
    running = _rounding_of_filters(filters.sets, fixed.sets, fixed, interfaces[1])
    starting = _rounding_of_filters(filters.short, fixed.short, fixed, interfaces[1])
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
    return PresentErrors(_total([by_sets] * ahead), start, max(start, _total(gap)))


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
    """Return the largest factor by which the transition of a step stretches a distance."""
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
    """Return the rounding of the step from Legendre coefficients, and of its inputs, as a distance."""
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


def _rounding_of_filters(
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
