"""Integers for committing late in fixed point: functions whose formats fit together, and the taps of all filters.

A sum of taps times samples is exact in 64 bits and rounded once, to the format that the step from Legendre coefficients
takes. Taps are rounded inside their conditions: a constant rate and one that grows evenly give what they must, exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

from strapgen import pipeline
from strapgen.catalogue import Choice
from strapgen.design.commit_late import commit_late_bounds
from strapgen.design.commit_late.fixed_filters import FixedFilters, Integers
from strapgen.design.commit_late.late_filters import LateFilters, Rows
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import finest
from strapgen.ir.interfaces import Argument, Interface
from strapgen.ir.kernel_info import Truncation
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
    errors = commit_late_bounds.now_errors(
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
    """Return what the series of the rotation of a step leaves out."""
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
