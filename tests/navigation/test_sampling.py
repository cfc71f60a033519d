"""Sums and shares of increments, and increments from counts: exact, and on every back end inside their bounds."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from derived import kernel, program
from precisions import single

import strapgen
from strapgen.catalogue import choose
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.signals import ANY
from strapgen.navigation.navigation_kernels import SAMPLING

#: Settings and constants with which each runs in fixed point; a unit that is not known has no range of its own.
RANGES = {
    "sum-3": {"sum": Fraction(1), "increment": Fraction(1, 8)},
    "hold-3": {"increment": Fraction(1, 8)},
    "angle-counts": {},
    "velocity-counts": {},
}
CONSTANTS = {
    "hold-3": {"share": "1/3"},
    "angle-counts": {"scale": "1.4544e-5"},
    "velocity-counts": {"scale": "0.01"},
}


def named(name, **values):
    """Return elements by their names in a program, in fractions."""
    signals = {signal.name: signal for signal in program(choose(name)).inputs}
    return {
        element: Fraction(number)
        for key, numbers in values.items()
        for element, number in zip(signals[key].elements, np.atleast_1d(numbers).tolist(), strict=True)
    }


def test_shares_of_an_increment_sum_up_to_it():
    parts, total = 32, [Fraction(0)] * 3
    increment = [Fraction(1, 7), Fraction(-2, 9), Fraction(3)]
    (share,) = (
        program(choose("hold-3")).run(named("hold-3", increment=increment, share=Fraction(1, parts))).values()
    )
    for _ in range(parts):
        (total,) = program(choose("sum-3")).run(named("sum-3", sum=total, increment=share)).values()
    assert total == increment


def test_counts_become_increments_in_the_unit_of_their_scale():
    counts = [3, -2, 1 << 15]
    for name, scale, unit in (("angle-counts", "1/68755", "rad"), ("velocity-counts", "1/100", "m/s")):
        (output,) = (stage.signal for stage in kernel(choose(name)).outputs)
        assert (output.unit, output.frame, output.over) == (unit, "b", "cycle")
        (increment,) = program(choose(name)).run(named(name, count=counts, scale=Fraction(scale))).values()
        assert increment == [count * Fraction(scale) for count in counts]


def test_a_sum_begins_anew_and_is_a_value_at_an_instant_while_increments_are_not():
    sum_, hold = kernel(choose("sum-3")), kernel(choose("hold-3"))
    assert sum_.recursion.reset == ("sum",)
    signals = {
        s.name: s for s in (*sum_.inputs, *hold.inputs, sum_.outputs[0].signal, hold.outputs[0].signal)
    }
    assert (
        {s.unit for s in signals.values() if s.shape}
        == {s.frame for s in signals.values() if s.shape}
        == {ANY}
    )
    over = {name: signal.over for name, signal in signals.items()}
    assert over["sum"] == over["next_sum"] == "" and over["increment_share"] == "cycle"
    assert (
        sum_.inputs[1].over == "cycle" and hold.inputs[0].over == ""
    )  # an increment that is held is sampled again


@pytest.mark.parametrize(
    "name", [name if name == "sum-3" else pytest.param(name, marks=pytest.mark.long) for name in SAMPLING]
)
def test_every_back_end_stays_within_its_bound(name, backend_name, rng):
    choice = choose(name, constants=CONSTANTS.get(name))
    settings = None
    if strapgen.BACKENDS[backend_name].fixed:
        settings = Settings(word=strapgen.BACKENDS[backend_name].word or 32, ranges=RANGES[name])
    evaluator = strapgen.evaluator(choice, backend_name, settings)
    unit = Fraction(1, 1 << (24 if single(backend_name) else 53))
    for _ in range(10):
        inputs = {
            signal.name: [Fraction(int(k), 512) for k in rng.integers(-64, 65, size=3)]
            for signal in program(choice).inputs
        }
        (expected,) = program(choice).run(named(name, **inputs)).values()
        computed = evaluator(*(np.array(x, float).astype(evaluator.dtype) for x in inputs.values()))
        # In floating point a constant and one operation are rounded to the nearest.
        bounds = [abs(y) * ((1 + unit) ** 2 - 1) for y in expected]
        if settings is not None:
            bounds = evaluator.sources.fixed.outputs[0].errors
        for x, y, bound in zip(computed, expected, bounds, strict=True):
            assert abs(Fraction(float(x)) - y) <= bound
