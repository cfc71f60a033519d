"""Sums of products are narrowed to their high words: what that may cost in error, and what it takes."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import strapgen
from strapgen import catalogue, fixedpoint, pipeline
from strapgen.fixedpoint import quantization
from strapgen.fixedpoint.high_words import in_order
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import FixedProgram, IntegerSum, Value, high_word_of_halves, used_by

RATES = {"max_rate_deg_s": 400, "step": "0.01"}


def quantized(algorithm: str, **settings: object) -> FixedProgram:
    program = pipeline.program(catalogue.choose_step(algorithm, "rk4", 2))
    return fixedpoint.quantize(program, Settings.of(increments=2, **RATES, **settings))


def in_units(fixed: FixedProgram) -> Fraction:
    (result,) = fixed.interface.outputs
    return max(result.errors) / result.format.unit


def sums(fixed: FixedProgram) -> list[Value]:
    """Return the values that are narrowed from sums of products."""
    return [
        value
        for value in fixed.body
        if isinstance(value.definition, IntegerSum)
        and value.definition.shift
        and any(len(term.names) == 2 for term in value.definition.fine)
    ]


def test_every_narrowing_of_a_step_but_the_cross_product_is_by_a_word():
    narrowed = {value.name: value.definition.shift for value in sums(quantized("euler"))}
    finer = {name: shift for name, shift in narrowed.items() if shift < 32}
    assert finer.keys() == {f"sigma_cross_d1_{axis}" for axis in "xyz"}
    assert len(narrowed) == 13


def test_the_products_of_a_sum_lie_at_one_place():
    for value in sums(quantized("euler")):
        assert {term.shift for term in value.definition.fine if len(term.names) == 2} == {0}


@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
@pytest.mark.parametrize("word", [16, 32])
@pytest.mark.parametrize("carry", ["none", "full"])
def test_the_error_is_at_most_a_sixtieth_above_that_of_other_formats(algorithm, word, carry, monkeypatch):
    narrowed = quantized(algorithm, word=word, carry=carry)
    monkeypatch.setattr(quantization, "_high_words", lambda *_: None)
    other = quantized(algorithm, word=word, carry=carry)
    assert in_units(narrowed) <= in_units(other) * Fraction(61, 60)
    assert sum(narrowed.operations.values()) <= sum(other.operations.values())
    if carry != "none":  # what adds up in a run
        names = [name for name in ("p_x", "p_s", "A_11", "A_12") if name in narrowed.formats]
        errors = [{value.name: value.error for value in fixed.body} for fixed in (narrowed, other)]
        assert names and all(errors[0][name] <= errors[1][name] * Fraction(61, 60) for name in names)


def test_a_step_in_euler_parameters_is_certified_to_58_hundredths_of_a_unit():
    assert in_units(quantized("euler")) < Fraction(58, 100)


def test_what_is_rounded_down_counts_a_whole_unit():
    fixed = quantized("euler")
    down = [
        value for value in fixed.body if isinstance(value.definition, IntegerSum) and value.definition.down
    ]
    assert {"sigma_dot_sigma", "p_sigma", "d1_dot_d2"} <= {value.name for value in down}
    for value in down:
        assert value.error >= Fraction(1, 1 << value.fraction)


@pytest.mark.parametrize("multiply", ["product", "high", "half"])
@pytest.mark.parametrize("algorithm", ["euler", "dcm"])
def test_errors_of_calls_lie_inside_the_certified_bound(algorithm, multiply, rng):
    settings = Settings.of(increments=2, multiply=multiply, **RATES)
    step = strapgen.backend(algorithm, "rk4", 2, "c-fixed32", settings=settings)
    exact = strapgen.backend(algorithm, "rk4", 2, "numpy")
    unit = float(step.interface.outputs[0].format.unit)
    increments = step.representable(rng.choice([-0.0349, 0.0349], (400, 2, 3)))
    start = np.eye(3) if algorithm == "dcm" else np.array([0.5, -0.5, 0.5, 0.5])
    states = np.broadcast_to(start, (len(increments), *start.shape))
    worst = float(np.abs(step.step(states, increments) - exact.step(states, increments)).max())
    assert 0.3 < worst / unit <= float(in_units(quantized(algorithm, multiply=multiply)))


def test_the_order_of_the_code_computes_each_value_before_its_use():
    fixed = quantized("dcm")
    known = {name for argument in fixed.interface.inputs for name in argument.signal.elements}
    for value in fixed.body:
        assert known.issuperset(used_by(value))
        known.add(value.name)
    names = [value.name for value in fixed.body]
    mixed = in_order(fixed.body, fixed.interface.outputs[0].values[::-1], [])
    assert sorted(value.name for value in mixed) == sorted(names)


def test_numbers_without_a_bound_to_hold_keep_their_formats():
    program = pipeline.program(catalogue.choose("euler-from-cayley-klein"))
    fixed = fixedpoint.quantize(program, Settings())
    assert not any(isinstance(v.definition, IntegerSum) and v.definition.down for v in fixed.body)


@pytest.mark.parametrize("word", [32, 64])
def test_products_are_narrowed_alone_and_added_in_words(word):
    fixed = quantized("euler", word=word, multiply="high")
    assert not any(value.wide for value in fixed.body)
    for value in fixed.body:
        total = value.definition
        products = [t for t in total.fine if len(t.names) == 2 or (t.coefficient and t.names)]
        if products:  # the high word, and nothing else
            assert (total.fine, total.shift, total.coarse) == (tuple(products[:1]), word, ())
        else:
            assert value.peak <= 1 << (word - 1)


def test_the_mean_of_what_products_lose_is_in_the_constant():
    """Three high words lose 0 to 3 units: with 2 in the sum it is off by 2 at most."""
    values = {value.name: value for value in quantized("euler", multiply="high").body}
    total = values["sigma_dot_sigma"]
    (constant,) = [term.factor for term in total.definition.fine if not term.names]
    assert constant == 2 and total.error * 2**total.fraction == 2
    crossed = values["sigma_cross_d1_x"]  # a difference of two loses as much as it gains
    assert all(term.names for term in crossed.definition.fine) and crossed.error * 2**crossed.fraction == 1


def test_high_words_alone_are_certified_to_93_hundredths_of_a_unit():
    assert Fraction(58, 100) < in_units(quantized("euler", multiply="high")) < Fraction(93, 100)


def test_values_are_refined_until_the_error_is_at_most_twice_the_finest():
    """The coarsest formats of a step by second order lose all of its digits."""
    program = pipeline.program(catalogue.choose_step("dcm", "rk2", 2))
    errors = [
        max(fixedpoint.quantize(program, Settings(multiply=way)).error_bounds.values())
        for way in ("product", "high")
    ]
    assert errors[1] < 5 * errors[0]


def test_a_high_word_from_half_words_is_below_the_product_by_less_than_three_units():
    """The worst pair: what each of the three products loses is largest at once."""
    words = [high * 65536 + low for high in (-32768, -3, 0, 1, 3, 32767) for low in (0, 1, 65533, 65535)]
    lost = [Fraction(a * b, 1 << 32) - high_word_of_halves(a, b, 32) for a in words for b in words]
    assert min(lost) >= 0 and Fraction(29, 10) < max(lost) < 3


def test_half_words_lose_three_units_a_product():
    values = {value.name: value for value in quantized("euler", multiply="half").body}
    part, total = values["sigma_dot_sigma_part"], values["sigma_dot_sigma"]
    assert part.definition.halves and part.error * 2**part.fraction == 3
    (constant,) = [term.factor for term in total.definition.fine if not term.names]
    assert constant == 5 and total.error * 2**total.fraction == 5
    assert Fraction(93, 100) < in_units(quantized("euler", multiply="half")) < Fraction(17, 10)


@pytest.mark.parametrize(
    ("multiply", "word", "allowed"),
    [("high", 8, "32 or 64"), ("high", 16, "32 or 64"), ("half", 16, "32"), ("half", 64, "32")],
)
def test_other_words_have_no_high_products(multiply, word, allowed):
    with pytest.raises(
        InputError, match=f"multiply {multiply} goes with words of {allowed} bits; word is {word}"
    ):
        Settings(word=word, multiply=multiply)


def test_a_result_that_high_products_do_not_hold_names_the_option():
    program = pipeline.program(catalogue.choose("dcm-from-euler-angles"))
    with pytest.raises(InputError, match="too short for C_11 with multiply high"):
        fixedpoint.quantize(program, Settings(multiply="high"))
