"""Coefficients in words: of filters, whose moments are exact, and as sums of shifted terms."""

from __future__ import annotations

import re
from fractions import Fraction

import numpy as np
import pytest
from derived import program, quantized
from hypothesis import given, settings
from hypothesis import strategies as st

import strapgen
from strapgen import backend, choose, motion, quantize, simulate
from strapgen.catalogue import Choice
from strapgen.catalogue.methods.windows import WINDOWS
from strapgen.fixedpoint import integer_sums
from strapgen.fixedpoint.filters import nearest_word, rounded_together
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.integer_program import FixedProgram, IntegerSum
from strapgen.lab.runs import angles

ONE = Fraction(1)


def filtered(fixed: FixedProgram, samples: list[int]) -> dict[str, int]:
    """Return the integers that the code makes of integer samples about x in its filters, and in sums of samples."""
    known = dict(zip(fixed.interface.inputs[1].signal.elements[::3], samples, strict=True))
    for value in fixed.body:
        total = value.definition
        names = [name for term in (*total.fine, *total.coarse) for name in term.names]
        if not isinstance(total, IntegerSum) or not value.name.endswith("_x") or not known.keys() >= {*names}:
            continue
        fine, coarse = (
            sum(
                term.factor * known[term.names[0]] << term.shift
                if term.shift >= 0
                else term.factor * known[term.names[0]] >> -term.shift
                for term in terms
            )
            for terms in (total.fine, total.coarse)
        )
        half = 1 << (total.shift - 1) if total.shift else 0
        known[value.name] = (fine + half >> total.shift) + coarse
    return known


def moments(fixed: FixedProgram, previous: int, stage: str) -> tuple[Fraction, Fraction]:
    """Return the sum of the weights of the samples in a stage, and their first moment about the middle sample."""
    names = fixed.interface.inputs[1].signal.elements
    known = {name: {k // 3: ONE} for k, name in enumerate(names) if name.endswith("_x")}
    for value in fixed.body:
        if isinstance(value.definition, IntegerSum) and all(
            len(term.names) == 1 and term.names[0] in known for term in value.definition.fine
        ):
            weights: dict[int, Fraction] = {}
            for term in (*value.definition.fine, *value.definition.coarse):
                factor = (
                    Fraction(term.factor) / Fraction(2) ** term.coefficient.fraction
                    if term.coefficient
                    else Fraction(term.factor)
                )
                for k, weight in known[term.names[0]].items():
                    weights[k] = weights.get(k, Fraction(0)) + factor * weight
            known[value.name] = weights
    weights = known[f"{stage}_x"]
    return sum(weights.values(), Fraction(0)), sum((k - previous) * w for k, w in weights.items())


def taps(window: str, word: int) -> FixedProgram:
    return quantize(program(choose("euler", window)), Settings(word, Fraction(1, 16)))


@pytest.mark.parametrize(
    ("window", "word"),
    [("window-3-3", 16), ("window-3-3", 32), pytest.param("window-7-7", 32, marks=pytest.mark.long)],
)
def test_filters_in_words_hold_their_conditions(window, word):
    previous, fixed = WINDOWS[window].previous, taps(window, word)
    # c_1 and c_3 are 1/2 and 0 of a rate that grows by one from sample to sample, and 0 of a constant one; what c_3
    # is crossed with is 0 of a constant one.
    assert moments(fixed, previous, "legendre_1") == (0, Fraction(1, 2))
    assert moments(fixed, previous, "legendre_3") == (0, 0)
    assert moments(fixed, previous, "lever_3")[0] == 0
    # c_0 and c_2 are 1 and 0: -1/6 has no finite expansion, but taps are finer than the largest of them.
    total, moment = moments(fixed, previous, "lever_1")
    assert moment == 0
    assert abs(total + Fraction(1, 6)) < Fraction(1, 1 << (word + 3))


def test_at_a_constant_rate_nothing_of_the_taps_adds_up(monkeypatch):
    def stages(rate: int, slope: int) -> list[int]:
        known = filtered(taps("window-3-3", 32), [rate + slope * k for k in range(-3, 4)])
        return [known[f"{name}_x"] for name in ("legendre_1", "legendre_3", "lever_3")]

    for rate in (123_456_789, -200_000_001):
        assert stages(rate, 0) == [0, 0, 0]
    # A rate that grows evenly: only c_1 is there, and no unit of c_3.
    steady = stages(0, 1 << 22)
    assert steady[0] > 0 == steady[1]
    monkeypatch.setattr(integer_sums, "filter_words", lambda *_: {})
    previous = WINDOWS["window-5-5"].previous
    assert moments(taps("window-5-5", 32), previous, "legendre_1")[1] != Fraction(1, 2)
    assert moments(taps("window-5-5", 32), previous, "lever_3")[0] != 0


@settings(derandomize=True, database=None, deadline=None, max_examples=40)
@given(st.lists(st.integers(-(1 << 40), 1 << 40).filter(lambda n: abs(n) % 3), min_size=3, max_size=7))
def test_rounding_together_is_never_worse_than_one_by_one(integers):
    coefficients = tuple(Fraction(n, 3 << 40) for n in integers)
    numbers = tuple((ONE, Fraction(k)) for k in range(len(coefficients)))
    together = rounded_together(coefficients, numbers, 20)
    assert all(abs(integer) < 1 << 19 and (integer % 2 or not integer) for integer, _ in together)

    def errors(words):
        return [Fraction(n) / Fraction(2) ** b - c for (n, b), c in zip(words, coefficients, strict=True)]

    def missed(words):
        zeroth, first = (sum(k**n * error for k, error in enumerate(errors(words))) for n in (0, 1))
        return abs(zeroth) + abs(first) / (len(coefficients) - 1)

    # What is missed counts 1024 times what coefficients are off.
    one_by_one = [nearest_word(c, 20) for c in coefficients]
    assert missed(together) <= missed(one_by_one) + sum(map(abs, errors(one_by_one))) / 1024


@pytest.mark.parametrize(
    "numbers", [((2, 4), (5, 10), (1, 0)), ((-3, 1), (0, 0), (1, 0)), ((0, 0), (1, 3), (1, 0))]
)
def test_coefficients_whose_samples_have_proportional_moments_are_exact_together(numbers):
    """Every whole number is 2 x + 5 y, and x is the number times the inverse of 2 modulo 5; a moment may be none."""
    coefficients = (Fraction(1, 3), Fraction(2, 7), Fraction(1, 2))
    moments = tuple((Fraction(a), Fraction(b)) for a, b in numbers)
    exact = sum(c * m for c, (m, _) in zip(coefficients, moments, strict=True))
    for word in (8, 12, 16):
        words = rounded_together(coefficients, moments, word)
        assert all(isinstance(n, int) and abs(n) < 1 << (word - 1) for n, _ in words)
        rounded = sum(
            Fraction(n) / Fraction(2) ** b * m for (n, b), (m, _) in zip(words, moments, strict=True)
        )
        assert abs(rounded - exact) <= Fraction(1, 1 << word), word


@pytest.mark.long
def test_on_a_cone_that_repeats_its_samples_nothing_adds_up_with_feedback():
    # Ten samples a turn: a rotation vector that were rounded in words would be off the same way in every turn, and
    # the runs of 60 s by 3.5e-7 rad. The filters themselves leave 2e-9.
    cone = motion("cone", half_angle_deg=1, frequency_hz=10)
    for carry in ("state", "full"):
        step = backend("euler", "window-7-7", None, "c-fixed32", settings=Settings(carry=carry))
        unit = Fraction(1, 1 << step.sources.fixed.inputs[1].format.fraction)
        assert np.max(angles(simulate(step, cone, Fraction(1, 100), 60, pulse=unit))) < 1e-8


RATES = {"max_rate_deg_s": 400, "step": "0.01", "increments": 2}


def shift_add(**more):
    return Settings.of(**RATES, multiply="shift-add", **more)


@pytest.mark.parametrize("word", [16, 32, pytest.param(64, marks=pytest.mark.long)])
@pytest.mark.parametrize("digits", [0, 3])
def test_the_c_has_the_integers_of_the_model(word, digits, rng):
    fixed = [
        strapgen.backend("euler", "rk4", 2, name, settings=shift_add(word=word, digits=digits))
        for name in ("fixed-model", *([f"c-fixed{word}"] if word < 64 else []))
    ]
    increments = fixed[0].representable(rng.uniform(-0.034, 0.034, (300, 2, 3)))
    runs = [one.propagate(increments) for one in fixed]
    assert all(np.array_equal(runs[0], run) for run in runs[1:])
    if not digits:  # all digits: the product itself
        plain = strapgen.backend("euler", "rk4", 2, "fixed-model", settings=Settings.of(word=word, **RATES))
        assert np.array_equal(plain.propagate(increments), runs[0])


@pytest.mark.parametrize(("algorithm", "digits"), [("euler", 2), ("dcm", 3)])
def test_bound_includes_the_truncation(algorithm, digits, rng):
    fixed = quantized(Choice(algorithm, "rk4", 2), shift_add(digits=digits))
    (result,) = fixed.interface.outputs
    bound = np.array([float(error) for error in result.errors])
    model = strapgen.backend(algorithm, "rk4", 2, "fixed-model", settings=shift_add(digits=digits))
    corners = rng.choice([-1.0, 1.0], (500, 1, 2, 3)) * 0.0349
    increments = model.representable(corners)
    found = np.array([model.propagate(row)[-1] for row in increments]).reshape(500, -1)
    exact = np.array(
        [
            strapgen.run.exact.propagate(program(Choice(algorithm, "rk4", 2)), row)[-1]
            for row in increments[:40]
        ]
    )
    apart = np.abs(found[:40] - exact.reshape(40, -1)).max(axis=0)
    assert np.all(apart <= bound)
    whole = quantized(Choice(algorithm, "rk4", 2), shift_add())
    assert bound.max() > 10 * float(max(whole.interface.outputs[0].errors))  # few digits cost accuracy
    assert apart.max() > bound.max() / 100


def test_no_product_with_a_constant_is_left_and_the_header_repeats_the_command():
    fixed = quantized(Choice("euler", "rk4", 2), shift_add(digits=3))
    files = strapgen.generate(fixed, "c-fixed").step_files
    text = next(text for name, text in files.items() if name.endswith(".c"))
    assert not re.search(r"_mul\(\w+, INT32_C", text)
    assert re.search(
        r"\(int64_t\)sigma_dot_sigma \* \(INT32_C\(1\) << \d+\)\s+\+ \(int64_t\)sigma_dot_sigma", text
    )
    head = " ".join(line.strip(" *") for line in text.splitlines()[:8])
    assert "--multiply shift-add --digits 3" in head


def test_digits_go_with_shift_add():
    with pytest.raises(InputError, match="digits is 3; it goes with multiply shift-add"):
        Settings.of(**RATES, digits=3)
    with pytest.raises(InputError, match="multiply"):
        Settings.of(**RATES, multiply="shift")
