"""Integers of the filters that commit late: conditions hold exactly, sums have room, formats fit together."""

from __future__ import annotations

from fractions import Fraction

import pytest

from strapgen.catalogue.methods.windows import WINDOWS
from strapgen.design.commit_late import late_filters
from strapgen.design.commit_late.commit_late_fixed import functions, interface_of, rounded
from strapgen.design.commit_late.commit_late_sources import kernels
from strapgen.design.commit_late.late_filters import LateFilters
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.units import Sensor

FILTERS = LateFilters(WINDOWS["window-7-7"], calm_start=True)
#: Of a step that is generated more quickly.
SMALL = LateFilters(WINDOWS["window-3-3"], calm_start=True)


def fixed(filters=FILTERS, **settings):
    return functions(filters, kernels(filters, "euler"), "c-fixed", Settings(**settings))


@pytest.mark.long
def test_rounded_filters_hold_their_first_two_conditions_exactly():
    (_, rotation, _), integers, _ = fixed()
    formats = {argument.signal.name: argument.format.fraction for argument in interface_of(rotation).inputs}
    for group, rows in zip(integers.sets, FILTERS.sets, strict=True):
        for m, shift, taps in zip(integers.sums, integers.shifts, group, strict=True):
            unit = Fraction(2) ** (integers.fraction - shift - formats[f"legendre_{m}"])
            for power in range(2):
                total = sum(tap * unit * j**power for j, tap in enumerate(taps))
                assert total == sum(tap * j**power for j, tap in enumerate(rows[m]))
            # Errors that go on to the next two taps are up to two units, and the last taps take up a few.
            assert max(abs(tap - exact / unit) for tap, exact in zip(taps, rows[m], strict=True)) < 4


@pytest.mark.long
def test_filters_of_counts_have_their_scale():
    scale = Sensor.of("0.0175dps", Fraction(1, 100))
    (_, rotation, _), integers, filters = fixed(sensor=scale, largest_angle=Fraction(7, 100))
    formats = {argument.signal.name: argument.format.fraction for argument in interface_of(rotation).inputs}
    assert (filters.scale, integers.sums, integers.limit) == (scale.scale, range(5), 22919)
    for group, rows in zip(integers.sets, FILTERS.sets, strict=True):
        for m, shift, taps in zip(integers.sums, integers.shifts, group, strict=True):
            unit = Fraction(2) ** (integers.fraction - shift - formats[f"legendre_{m}"])
            assert all(
                abs(n * unit - scale.scale * tap) < 4 * unit for n, tap in zip(taps, rows[m], strict=True)
            )
            # Of a constant rate c_0 has the scale to a unit, and all others have nothing.
            assert abs(sum(taps) * unit - (m == 0) * scale.scale) < unit
            assert m == 0 or sum(taps) == 0


def test_restoring_filters_leave_a_constant_rate_as_it_is():
    _, integers, _ = fixed(SMALL)
    assert all(sum(taps) == 1 << integers.restoring_shift for taps in integers.restoring)
    lost, merged = integers.restoring
    assert lost[late_filters.REACH] == 0
    assert merged[late_filters.REACH] != 0


@pytest.mark.long
@pytest.mark.parametrize("angle", [Fraction(1, 100), Fraction(1, 7), Fraction(1, 4)])
def test_formats_fit_together_and_sums_have_room(angle):
    (step, rotation, normalization), integers, _ = fixed(largest_angle=angle, carry="full")
    state, samples = interface_of(step).inputs
    inputs = {argument.signal.name: argument for argument in interface_of(rotation).inputs}
    assert inputs["state"].format == interface_of(normalization).inputs[0].format == state.format
    assert interface_of(rotation).outputs[0].format == state.format
    assert (inputs["legendre_0"].format, inputs["legendre_0"].high) == (samples.format, samples.high)
    for m, number, shift in zip(integers.sums, range(4), integers.shifts, strict=True):
        worst = (
            max(sum(map(abs, group[number])) for group in (*integers.sets, *integers.short)) * samples.high
        )
        assert worst + (1 << (shift - 1)) < 1 << 63
        assert (worst + (1 << (shift - 1))) >> shift <= inputs[f"legendre_{m}"].high


@pytest.mark.parametrize("moments", [1, 2])
@pytest.mark.parametrize("count", [1, 2, 3, 9])
def test_moments_are_exact_and_taps_near(moments, count):
    taps = [Fraction(k * k + 1, 7) for k in range(count)]
    result = rounded(taps, 0, moments)
    assert sum(result) == round(sum(taps))
    if moments == 2 and count > 1:
        assert sum(j * x for j, x in enumerate(result)) == round(sum(j * x for j, x in enumerate(taps)))
    assert max(abs(x - tap) for x, tap in zip(result, taps, strict=True)) < 4


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"word": 16}, "words of 32 bits"),
        ({"state": "q31"}, "saturates"),
        ({"ranges": {"legendre_1": Fraction(1)}}, "ranges or formats"),
        ({"formats": {"state": "Q2.29"}}, "ranges or formats"),
        ({"input_bits": 24}, "samples as words of 32"),
        (
            {"sensor": Sensor.of("0.02rad"), "largest_angle": Fraction(1, 50), "input_bits": 16},
            "at most 1 in magnitude, too few units",
        ),
        ({"largest_angle": Fraction(3, 4)}, "up to 0.75 rad; a smaller largest angle"),
    ],
)
def test_other_settings_are_refused(settings, reason):
    with pytest.raises(InputError, match=reason):
        fixed(SMALL, **settings)
