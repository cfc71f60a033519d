"""Committing late on integers: conditions hold exactly, sums have room, and bounds of now are near and above."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from functools import cache
from math import isqrt

import mpmath
import numpy as np
import pytest

from strapgen import pipeline
from strapgen.catalogue.kinematics import EULER
from strapgen.catalogue.methods.windows import WINDOWS
from strapgen.design.commit_late import commit_late_fixed, commit_late_sources, late_filters
from strapgen.design.commit_late.commit_late_fixed import Advance, functions, interface_of, rounded
from strapgen.design.commit_late.commit_late_sources import LateSources, kernels
from strapgen.design.commit_late.late_filters import REACH, FixedFilters, LateFilters, polynomial
from strapgen.design.commit_late.late_unit import LateUnitOnIntegers, state_argument
from strapgen.fixedpoint import quantize
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import above
from strapgen.ir.kernel_info import Truncation
from strapgen.ir.signals import Signal
from strapgen.ir.units import Sensor
from strapgen.kernel.kernel import KernelBuilder
from strapgen.lowering import lower
from strapgen.run.exact import DIGITS, Interpreter, number

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
    for m, place, shift in zip(integers.sums, range(4), integers.shifts, strict=True):
        worst = max(sum(map(abs, group[place])) for group in (*integers.sets, *integers.short)) * samples.high
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


#: Samples as integers, three axes each.
Samples = Sequence[Sequence[int]]


@cache
def parts(window: str, algorithm: str = "euler", **settings: object) -> LateSources:
    """Return the integer model of a unit at 400 deg/s and 100 Hz."""
    chosen = Settings.of(max_rate_deg_s=400, sample_hz=100, increments=1, **settings)
    return commit_late_sources.parts(commit_late_sources.family(window), algorithm, "fixed-model", chosen)


def unit_after(
    sources: LateSources, samples: Samples, state: Sequence[int] | None = None, lost: Iterable[int] = ()
) -> LateUnitOnIntegers:
    """Return a unit that has taken samples, of which some were lost."""
    unit = LateUnitOnIntegers(sources)
    if state is not None:
        unit.reset(np.array(state, np.int64).reshape(unit.attitude.shape))
    for place, sample in enumerate(samples):
        unit.push(np.array(sample), int(place in set(lost)))
    return unit


class Exact:
    """The attitude of now by the exact filters and steps, from the integers that a unit holds."""

    def __init__(self, sources: LateSources, algorithm: str = "euler") -> None:
        self.sources = sources
        choices = commit_late_sources.kernels(sources.filters, algorithm)
        self.step, self.rotation = (Interpreter(pipeline.program(choice)) for choice in choices[:2])
        self.unit = state_argument(sources.step).format.unit
        assert sources.step.fixed is not None and sources.fixed is not None
        self.sample = Fraction(2) ** -sources.fixed.fraction

    def now(self, unit: LateUnitOnIntegers) -> list[mpmath.mpf]:
        """Return the elements of the attitude."""
        filters, window = self.sources.filters, self.sources.filters.window
        held = [[int(x) * self.sample for x in row] for row in unit._samples]
        state = [number(int(x) * self.unit) for x in unit.attitude.ravel()]
        for place in range(len(held) - unit.pending, len(held)):
            after = len(held) - 1 - place
            if len(held) >= filters.samples and place >= window.previous and after >= window.ahead:
                taken = held[place - window.previous : place + window.ahead + 1]
                inputs = [state, [number(x * filters.scale) for row in taken for x in row]]
                state = self.step.outputs(*inputs)["next"]
                continue
            if len(held) < filters.samples:
                first, count = min(max(place - 1, 0), max(len(held) - 4, 0)), min(len(held), 4)
                rows = polynomial(count, place - first, filters.degree)
                rows = tuple(tuple(tap * filters.scale for tap in row) for row in rows)
            else:
                before = place if after > window.ahead else filters.samples - 1 - after
                first, count, rows = place - before, filters.samples, filters.sets[before]
            sums = [
                [
                    number(sum((tap * held[first + k][axis] for k, tap in enumerate(row)), Fraction(0)))
                    for axis in range(3)
                ]
                for row in rows
            ]
            if filters.sums.start:
                sums[0] = [number(x) for x in held[place]]
            state = self.rotation.outputs(state, *sums)["next"]
        return list(state)

    def error(self, unit: LateUnitOnIntegers) -> float:
        """Return the distance of the attitude of now from it: of the state, or of the row that is furthest."""
        with mpmath.workdps(DIGITS):
            exact = self.now(unit)
            computed = unit.now().ravel()
            off = [int(x) * number(self.unit) - value for x, value in zip(computed, exact, strict=True)]
            width = 3 if len(off) == 9 else len(off)
            return max(
                float(mpmath.sqrt(sum(x * x for x in off[k : k + width]))) for k in range(0, len(off), width)
            )


def search(
    sources: LateSources, exact: Exact, count: int, lost: Iterable[int], tries: int, seed: int
) -> tuple[float, list[list[int]], list[int]]:
    """Return the largest error that a climb from random inputs finds, with its samples and its committed attitude.

    Samples begin near the ends of their range, with few or many changes of sign; a try moves the last bits of a few
    numbers, or the sign of one, and stays where the error grows.
    """
    random = np.random.default_rng(seed)
    assert sources.fixed is not None
    limit = sources.fixed.limit
    one = 1 << state_argument(sources.step).format.fraction
    size = state_argument(sources.step).signal.size

    def begin() -> tuple[np.ndarray, np.ndarray]:
        signs = random.choice([-1, 1], (1, 3)) * random.choice([-1, 1], (count, 1)) ** random.integers(2)
        samples = signs * (limit - random.integers(0, 1 + limit // 1_000_000, (count, 3)))
        if size == 9:
            state, _ = np.linalg.qr(random.normal(size=(3, 3)))
        else:
            state = random.normal(size=4)
            state /= np.linalg.norm(state)
        return samples, np.rint(state.ravel() * one).astype(np.int64)

    def error(samples: np.ndarray, state: np.ndarray) -> float:
        return exact.error(unit_after(sources, samples.tolist(), state.tolist(), lost))

    best, found = -1.0, begin()
    for attempt in range(tries):
        if attempt < tries // 4:
            samples, state = begin()
        else:
            samples, state = found[0].copy(), found[1].copy()
            for _ in range(random.integers(1, 4)):
                place = tuple(random.integers(0, samples.shape))
                if random.integers(8) == 0:
                    samples[place] *= -1
                else:
                    samples[place] = np.clip(samples[place] + random.integers(-400, 401), -limit, limit)
            if random.integers(3) == 0:
                state = state + random.integers(-3, 4, state.shape)
        off = error(samples, state)
        if off > best:
            best, found = off, (samples, state)
    return best, found[0].tolist(), found[1].tolist()


P = L = 3
#: Samples and a committed attitude whose error at the end of the start is more than half of its bound.
START = [
    (599689678, -599690398, -599689698),
    (599689762, -599690195, -599689644),
    (599690213, -599690038, -599690265),
    (599689905, -599689594, -599690528),
    (599689993, -599690114, -599690089),
    (599689638, -599689908, -599690408),
]
ATTITUDE = (-317537299, -141784127, 173853576, 1000881493)


def test_attitude_of_now_at_the_start_is_near_its_bound_and_below():
    """It is beyond the bound of L intervals: p + L wait."""
    late = parts("window-3-3", rounding="truncation")
    unit = unit_after(late, START, ATTITUDE)
    error, errors = Exact(late).error(unit), late.fixed.now_errors
    assert unit.pending == P + L
    assert errors.running < error < errors.start < 2 * error


@pytest.mark.parametrize(
    ("count", "lost", "which"), [(P + L + 3, (), "running"), (P + L, (), "start"), (16, (8,), "gap")]
)
def test_climb_stays_below_the_bounds_of_now(count, lost, which):
    late = parts("window-3-3", rounding="truncation")
    error, *_ = search(late, Exact(late), count, lost, 60, 1)
    bound = getattr(late.fixed.now_errors, which)
    assert bound / 5 < error < bound


@pytest.mark.long
@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
@pytest.mark.parametrize("window", ["window-3-3", "window-5-5", "window-7-7"])
@pytest.mark.parametrize(
    "settings",
    [
        {"rounding": "truncation"},
        {"rounding": "nearest"},
        {"rounding": "truncation", "carry": "full"},
        {"lsb": "0.0175dps"},
    ],
    ids=["truncation", "nearest", "carry", "counts"],
)
def test_longer_climbs_stay_below_the_bounds_of_now(settings, window, algorithm):
    late = parts(window, algorithm, **settings)
    exact, filters, errors = Exact(late, algorithm), late.filters, late.fixed.now_errors
    gap = max(REACH, filters.samples - 1)
    for count, lost, bound in (
        (filters.samples - 1, (), errors.start),
        (filters.samples + 2, (), errors.running),
        (gap + REACH, (gap,), errors.gap),
    ):
        error, *_ = search(late, exact, count, lost, 150, 2)
        assert error < bound
        if settings == {"rounding": "truncation"} and window == "window-3-3" and not lost:
            assert error > bound * 0.4


def test_steps_add_up_with_their_stretch():
    assert commit_late_fixed._total([Advance(Fraction(1), Fraction(2))] * 3) == 7
    assert (
        commit_late_fixed._total([Advance(Fraction(1), Fraction(5)), Advance(Fraction(3), Fraction(2))]) == 5
    )


@pytest.mark.parametrize("rotation", [10**6, 1], ids=["gap-of-its-own", "gap-inside-the-start"])
def test_every_interval_that_waits_is_counted(rotation, monkeypatch):
    """With 1 for filters on all samples, 1000 for those of the start and the step's own error."""
    filters = LateFilters(WINDOWS["window-3-3"], calm_start=True)
    late = parts("window-3-3")
    monkeypatch.setattr(
        commit_late_fixed, "_rounding_of_filters", lambda exact, integers, *_: {"groups": len(exact)}
    )
    monkeypatch.setattr(
        commit_late_fixed, "_rounding", lambda _p, _i, moved: Fraction({7: 1, 10: 1000}[moved["groups"]])
    )
    monkeypatch.setattr(commit_late_fixed, "_stretch", lambda *_: Fraction(1))
    monkeypatch.setattr(commit_late_fixed, "_row_length", lambda _: Fraction(rotation))
    interfaces = interface_of(late.step), interface_of(late.rotation)
    errors = commit_late_fixed.now_errors(filters, late.fixed, (None, None), interfaces, None)
    start = 1000 * (P + L)
    assert errors == (L, start, max(start, P + L + rotation * REACH))


def test_rounding_of_taps_and_of_a_sum_move_a_coefficient():
    """One row of taps 3/8 and -5/8 as 1/4 and -3/4, samples to 100 units of 1/16, a coefficient in units of 1/4."""
    interface = toy()[1]
    fixed = FixedFilters(100, 4, range(1), (), (), (4,), ((), ()), 0)
    # An integer tap is one of 2^(4 - 4 - 2) = 1/4.
    moved = commit_late_fixed._rounding_of_filters(
        [((Fraction(3, 8), Fraction(-5, 8)),)], [((1, -3),)], fixed, interface
    )
    off = (Fraction(1, 8) + Fraction(1, 8)) * Fraction(100, 16)
    assert moved == dict.fromkeys(("c_x", "c_y", "c_z"), off + Fraction(1, 8))
    # The worst group counts.
    groups = [((Fraction(1, 4), Fraction(-3, 4)),), ((Fraction(3, 8), Fraction(-5, 8)),)]
    assert commit_late_fixed._rounding_of_filters(groups, [((1, -3),)] * 2, fixed, interface) == moved


def toy():
    """Return a step that adds multiples of one coefficient to a state, with its interface in fixed point."""
    build = KernelBuilder()
    state = build.input(EULER.state)
    c = build.input(Signal.labelled("legendre_0", "c", "xyz", meaning="coefficient"))
    build.output(
        Signal.labelled("next", "n", "xyzs", meaning="state"),
        [state[0] + 2 * c[0], state[1] - 3 * c[1], state[2] + c[2] / 4, state[3]],
    )
    program = lower(build.kernel("toy", "A sum", "none"))
    settings = Settings(
        ranges={"legendre_0": Fraction(4)},
        formats={"legendre_0": "Q29.2", "state": "Q2.29", "next": "Q20.11"},
    )
    return program, quantize(program, settings).interface


def test_moved_coefficients_reach_the_state_by_their_derivatives():
    program, interface = toy()
    errors = interface.outputs[0].errors
    moved = {"c_x": Fraction(1), "c_y": Fraction(2), "c_z": Fraction(8)}
    exact = sum((e + m) ** 2 for e, m in zip(errors, (2, 6, 2, 0), strict=True))
    length = commit_late_fixed._rounding(program, interface, moved)
    assert exact <= length**2 < exact * (1 + Fraction(1, 2**60))
    nothing = commit_late_fixed._rounding(program, interface, dict.fromkeys(moved, Fraction(0)))
    assert sum(e**2 for e in errors) <= nothing**2 <= sum(e**2 for e in errors) * (1 + Fraction(1, 2**40))


def test_length_of_a_row_is_rounded_up():
    assert commit_late_fixed._row_length([Fraction(1)] * 9) ** 2 > 3
    assert commit_late_fixed._row_length([Fraction(1)] * 9) ** 2 < Fraction(3) + Fraction(1, 2**60)
    assert commit_late_fixed._row_length([Fraction(1)] * 4) >= 2
    rows = [Fraction(x) for x in (0, 0, 1, 0, 3, 4, 2, 0, 0)]
    assert 5 <= commit_late_fixed._row_length(rows) < Fraction(5) + Fraction(1, 2**60)


def test_transition_stretches_by_the_truncation_of_its_series():
    """At 1/4 rad the rotation vector is at least sqrt(3)/4 long, and a series to second order leaves out its third."""
    late = parts("window-3-3")
    program = commit_late_sources.pipeline.program(commit_late_sources.kernels(late.filters, "euler")[1])
    stretch = commit_late_fixed._stretch(
        late.filters,
        late.fixed,
        program,
        interface_of(late.rotation),
        Truncation(2, Fraction(1, 2), "angle_square"),
    )
    largest = late.fixed.limit * Fraction(2) ** -late.fixed.fraction
    length = Fraction(isqrt(3 * 10**24), 10**12) * largest / 2
    assert stretch - 1 > length**3 / 6


def test_header_states_every_bound_rounded_up():
    settings = parts("window-3-3", rounding="truncation").step.fixed.settings
    text = commit_late_sources.sources("window-3-3", target="c-fixed", settings=settings).files
    header = " ".join(text["euler_late_3_3_w32.h"].replace("\n *     ", " ").split())
    errors = parts("window-3-3", rounding="truncation").fixed.now_errors
    running, start, gap = map(above, errors)
    assert f"is at most {running} from" in header
    assert (
        f"before sample 7 at most {start}, and while a lost sample waits to be restored at most {gap}."
        in header
    )
    assert all(Fraction(shown) >= exact for shown, exact in zip((running, start, gap), errors, strict=True))


def test_tap_below_a_power_of_two_has_room():
    """With 31 fraction bits it would be the largest word, and what rounding other taps leaves would go beyond."""
    tap = Fraction(2**31 - 1, 2**31)
    bits = commit_late_fixed._fraction([[Fraction(1, 3), Fraction(1, 3), tap]], 1)
    assert bits == 30
    assert max(map(abs, rounded([Fraction(1, 3), Fraction(1, 3), tap], bits, 2))) < 1 << 31
    assert max(map(abs, rounded([Fraction(1, 3), Fraction(1, 3), tap], 31, 2))) >= 1 << 31, (
        "the reason for the room"
    )
