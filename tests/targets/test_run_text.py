"""What headers say of a run: the formula and the examples are those of the interface, rounded up."""

from __future__ import annotations

import re
from fractions import Fraction

import pytest
from derived import program, quantized

from strapgen.catalogue import Choice
from strapgen.ir.fixed_settings import Settings
from strapgen.targets.contract import run_paragraphs

RATES = {"max_rate_deg_s": 400, "step": "0.01", "increments": 2}


def paragraphs(algorithm: str, settings: Settings, method: str = "rk4") -> list[str]:
    choice = Choice(algorithm, method, 2)
    return run_paragraphs(quantized(choice, settings).interface, program(choice))


@pytest.mark.long
@pytest.mark.parametrize("carry", ["none", "full"])
@pytest.mark.parametrize("algorithm", ["euler", "cayley-klein", "dcm"])
def test_examples_are_the_formula_rounded_up(algorithm, carry):
    settings = Settings.of(**RATES, carry=carry)
    interface = quantized(Choice(algorithm, "rk4", 2), settings).interface
    angles = interface.angle_accumulation
    error = 4 * interface.inputs[0].format.unit
    text = paragraphs(algorithm, settings)
    pattern = r"- N = (\d+)(, an hour)?: (\S+) rad; .* every 1000 steps: (\S+) rad"
    examples = [re.fullmatch(pattern, line).groups() for line in text if line.startswith("- ")]
    assert [(int(steps), hour) for steps, hour, *_ in examples] == [
        (10**4, None),
        (360_000, ", an hour"),
        (10**6, None),
    ]
    for steps, _, alone, normalized in examples:
        exact = angles.bound(int(steps)), angles.bound(int(steps), int(steps) // 1000, error)
        for printed, value in zip((alone, normalized), exact, strict=True):
            assert value <= float(printed) <= 1.001 * value
    formula = re.search(r"at most (?:(\S+) \+ )?(\S+) N rad", text[0])
    once, per_step = (Fraction(part or 0) for part in formula.groups())
    assert angles.once <= once <= Fraction(1001, 1000) * angles.once
    assert angles.per_step <= per_step <= Fraction(1001, 1000) * angles.per_step


def test_a_bound_beyond_half_a_turn_is_none():
    lines = paragraphs("dcm", Settings(16))
    assert any(line.startswith("- N = 1000000: no bound") for line in lines)


def test_a_kernel_that_is_no_step_says_nothing_of_runs():
    choice = Choice("euler-normalize")
    assert run_paragraphs(quantized(choice, Settings()).interface, program(choice)) == []
