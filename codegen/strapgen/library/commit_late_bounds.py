"""Bounds how far rounding moves the attitude of now in fixed point from exact arithmetic on the same integers.

In each of its L steps three things add to the distance: what the step from Legendre coefficients rounds; the rounding
of the coefficients times their derivatives, which interval arithmetic bounds over all samples in range; and the
distance before the step times what a transition can stretch it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction

from strapgen.catalogue.methods.late_filters import LateFilters
from strapgen.fixedpoint.intervals import Interval
from strapgen.ir.attitude_step import Truncation
from strapgen.ir.fixed_interface import Argument, Interface
from strapgen.ir.program import Program
from strapgen.rounding.exact_ranges import ExactRanges
from strapgen.rounding.expressions import Expressions
from strapgen.rounding.sensitivities import sensitivities, slopes
from strapgen.support.exceptions import InputError
from strapgen.targets.commit_late_c.fixed_filters import FixedFilters

#: Binary digits of a square root.
_BITS = 80


def now_error(
    filters: LateFilters,
    fixed: FixedFilters,
    rotation: Program,
    interface: Interface,
    truncation: Truncation,
) -> Fraction:
    """Return a bound of the distance of the attitude of now from that of exact arithmetic.

    Parameters
    ----------
    filters : LateFilters
    fixed : FixedFilters
        The taps as integers.
    rotation : Program
        The step from Legendre coefficients.
    interface : Interface
        That of its code in fixed point.
    truncation : Truncation
        What the series of a transition leaves out of a rotation.

    Returns
    -------
    Fraction
        Length of the difference of the state, of a row for a matrix, with L samples ahead of the committed attitude and
        no gap: from the same integers of the committed attitude and of the samples, by the exact filters.

    Raises
    ------
    InputError
        If samples are so large that the series of a rotation does not converge.
    """
    box = {
        name: Interval.symmetric(argument.high * argument.unit)
        for argument in interface.inputs
        for name in argument.signal.elements
    }
    expressions = Expressions.of(rotation)
    exact = ExactRanges(rotation, expressions, box)
    derivatives = slopes(expressions, exact.ranges)
    moved = _moved(filters, fixed, interface)
    elements = []
    for place, error in zip(expressions.results["next"], interface.outputs[0].errors, strict=True):
        by = sensitivities(expressions, derivatives, place)
        elements.append(
            error
            + sum(
                (by.get(expressions.names[n], Fraction(0)) * size for n, size in moved.items()), Fraction(0)
            )
        )
    left_out = truncation.bound(exact.ranges[expressions.names[truncation.square]].magnitude)
    if left_out is None:
        raise InputError(
            f"{filters.window.name}: the rotations of one-sided filters have no bound for samples up to "
            f"{float(fixed.limit * Fraction(2) ** -fixed.fraction):g} rad; a smaller largest angle is needed"
        )
    width = 3 if len(elements) == 9 else len(elements)
    step = max(_length(elements[k : k + width]) for k in range(0, len(elements), width))
    total = Fraction(0)
    for _ in range(filters.window.ahead):
        total = (1 + left_out) * total + step
    return total


def _moved(filters: LateFilters, fixed: FixedFilters, interface: Interface) -> Mapping[str, Fraction]:
    """Return by how much rounding moves every element of a Legendre coefficient at most."""
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
                (abs(tap * unit - exact) for tap, exact in zip(taps[number], rows[m], strict=True)),
                Fraction(0),
            )
            for taps, rows in zip(fixed.sets, filters.sets, strict=True)
        )
        moved |= dict.fromkeys(argument.signal.elements, off * sample + argument.unit / 2)
    return moved


def _length(values: list[Fraction]) -> Fraction:
    """Return a number not below the length of a vector, and hardly above."""
    square = sum((value * value for value in values), Fraction(0))
    return Fraction(math.isqrt(math.ceil(square * 4**_BITS)) + 1, 2**_BITS)
