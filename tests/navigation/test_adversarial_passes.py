"""Passes of described systems against their bounds: never above, and near them on the worst samples that are found."""

from fractions import Fraction

import numpy as np
import pytest

from strapgen.ir.fixed_settings import Settings
from strapgen.ir.formats import Format
from strapgen.navigation.systems.system_comparison import agreement
from strapgen.navigation.systems.system_runner import rescaled, system_runner
from strapgen.navigation.systems.wiring import described

SYSTEMS = ("two-speed-dcm", "two-speed-dcm-1", "two-speed-euler", "two-speed-euler-1")
CYCLES = 2000
#: Part of a bound that the worst samples reach: all but a twentieth, and half where the words of the feedback of an
#: error that is cut off are counted with their whole range on either side.
NEAR, NEAR_CUT = 0.95, 0.45


def hostile(runner, rng):
    """Yield samples of each kind: all sizes, the ends of the range, both mixed at sizes a decade apart."""
    for part in (0.3, 0.9):
        for kind in range(3):
            samples = {}
            for signal in runner.system.inputs:
                argument = runner.fit.arguments[signal.name]
                most = float(argument.unit * min(argument.high, -argument.low))
                sizes = rng.uniform(-1, 1, (CYCLES, signal.size))
                if kind == 1:
                    sizes = np.sign(sizes)
                elif kind == 2:
                    ends = rng.random(sizes.shape) < 0.5
                    sizes = np.where(ends, np.sign(sizes), sizes) * rng.choice([1, 0.1, 0.01], (CYCLES, 1))
                samples[signal.name] = part * most * sizes
            yield samples


@pytest.mark.parametrize(
    ("system", "word", "rounding", "carry"),
    [
        pytest.param(
            *case, marks=() if case == ("two-speed-dcm", 16, "nearest", "none") else pytest.mark.long
        )
        for case in (
            (system, word, rounding, carry)
            for system in SYSTEMS
            for word in (16, 32)
            for rounding in ("nearest", "truncation")
            for carry in ("none", "full")
        )
    ],
)
def test_no_samples_take_a_pass_above_its_bound_and_some_nearly_reach_it(system, word, rounding, carry, rng):
    description = described(system)
    runner = system_runner(description, f"c-fixed{word}", Settings(word=word, rounding=rounding, carry=carry))
    reference = system_runner(description, "numpy")
    nearest = 0.0
    for samples in hostile(runner, rng):
        found = agreement(runner, reference, samples)
        assert found.holds, {name: share for name, share in found.share.items() if share > 1}
        nearest = max(nearest, *found.share.values())
    assert nearest >= (NEAR_CUT if (rounding, carry) == ("truncation", "full") else NEAR)


@pytest.mark.parametrize("places", range(-9, 10))
@pytest.mark.parametrize(("there", "here"), [(32, 16), (16, 32), (32, 32), (16, 16), (64, 32)])
def test_a_value_between_words_is_rounded_half_up_and_held_at_both_ends(there, here, places):
    """Beside exact rationals: floor(x 2^places + 1/2), between the lowest and the largest integer of the word."""
    top, most = (1 << (there - 1)) - 1, (1 << (here - 1)) - 1
    values = [0, 1, -1, 3, -3, 5, -5, 127, -128, 12345, -12345, top, -top, -top - 1, top - 1]
    moved = rescaled(np.array(values, object), Format(there, 0), Format(here, places))
    for value, result in zip(values, moved.tolist(), strict=True):
        exact = (Fraction(value) * Fraction(2) ** places + Fraction(1, 2)).__floor__()
        assert result == max(-most - 1, min(most, exact))
