"""Products with constants as sums of shifted terms: the same integers, and a bound that knows what is cut off."""

import re

import numpy as np
import pytest
from derived import program, quantized

import strapgen
from strapgen.catalogue import Choice
from strapgen.ir.exceptions import InputError
from strapgen.ir.fixed_settings import Settings

RATES = {"max_rate_deg_s": 400, "step": "0.01", "increments": 2}


def settings(**more):
    return Settings.of(**RATES, multiply="shift-add", **more)


@pytest.mark.parametrize("word", [16, 32, pytest.param(64, marks=pytest.mark.long)])
@pytest.mark.parametrize("digits", [0, 3])
def test_the_c_has_the_integers_of_the_model(word, digits, rng):
    fixed = [
        strapgen.backend("euler", "rk4", 2, name, settings=settings(word=word, digits=digits))
        for name in ("fixed-model", *([f"c-fixed{word}"] if word < 64 else []))
    ]
    increments = fixed[0].representable(rng.uniform(-0.034, 0.034, (300, 2, 3)))
    runs = [one.propagate(increments) for one in fixed]
    assert all(np.array_equal(runs[0], run) for run in runs[1:])
    if not digits:  # all digits: the product itself
        plain = strapgen.backend("euler", "rk4", 2, "fixed-model", settings=Settings.of(word=word, **RATES))
        assert np.array_equal(plain.propagate(increments), runs[0])


@pytest.mark.parametrize(("algorithm", "digits"), [("euler", 2), ("dcm", 3)])
def test_the_bound_has_what_is_cut_off(algorithm, digits, rng):
    fixed = quantized(Choice(algorithm, "rk4", 2), settings(digits=digits))
    (result,) = fixed.interface.outputs
    bound = np.array([float(error) for error in result.errors])
    model = strapgen.backend(algorithm, "rk4", 2, "fixed-model", settings=settings(digits=digits))
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
    whole = quantized(Choice(algorithm, "rk4", 2), settings())
    assert bound.max() > 10 * float(max(whole.interface.outputs[0].errors))  # few digits cost accuracy
    assert apart.max() > bound.max() / 100


def test_no_product_with_a_constant_is_left_and_the_header_repeats_the_command():
    fixed = quantized(Choice("euler", "rk4", 2), settings(digits=3))
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
