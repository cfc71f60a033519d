"""The kernels that compensate and separate on every target: C, integers and model beside numpy, inside their bounds."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from derived import program, quantized
from fixed_inputs import corners_and_random, exactly
from gathering import each

import strapgen
from strapgen.catalogue import Choice
from strapgen.ir.fixed_settings import Settings
from strapgen.navigation.instruments.compensation_names import COMPENSATION
from strapgen.run.kernel_sources import sources_of_program

NAMES = [*COMPENSATION]
#: One of each kind; the others have the same code with other signs, or twice.
SOME = ("imu-compensate", "pulse-compensate", "pulse-errors", "scale-factor-heating", "separate-45")
#: Inputs that have no frame.
NO_FRAME = (
    *("cycle", "cycle_rate", "decay", "unbalance", "unbalance_reciprocal", "deviation", "heating_gain"),
    *("nominal", "slope_above", "slope_below", "difference"),
)


def settings(name: str, word: int) -> Settings:
    return Settings(word=word, carry="state" if "heating" in name else "none")


def evaluators(name, word):
    """Return the C and the model of a kernel in words of so many bits."""
    return (
        strapgen.evaluator(name, backend, settings(name, word))
        for backend in (f"c-fixed{word}", "fixed-model")
    )


@pytest.mark.long
@each("name", NAMES)
def test_every_source_states_its_equations_and_where_they_come_from(name):
    kernel = strapgen.derive(name)
    assert "AGARD Lecture Series 133" in kernel.source
    assert any(word in kernel.source for word in ("printed", "repaired", "derived"))
    for signal in kernel.inputs:
        assert signal.bound is not None and signal.unit, signal.name
        assert "axes" in signal.meaning or "axis" in signal.meaning or signal.name in NO_FRAME, signal.name


@pytest.mark.parametrize("word", [pytest.param(16, marks=pytest.mark.long), 32])
@each("name", NAMES)
def test_no_error_exceeds_its_bound(name, word, rng):
    fixed = quantized(Choice(name), settings(name, word))
    model = strapgen.evaluator(name, "fixed-model", settings(name, word))
    inputs = corners_and_random(model, 40, rng)
    feedback = model.fresh(40)
    results, _ = model.run(inputs, feedback)
    worst = 0.0
    for k, sample in enumerate(zip(*(array.tolist() for array in inputs), strict=True)):
        known = exactly(fixed, sample)
        for argument, result in zip(fixed.interface.outputs, results, strict=True):
            for element, integer, bound in zip(argument.values, result[k], argument.errors, strict=True):
                apart = abs(int(integer) * argument.unit - known[element])
                assert apart <= bound, element
                if bound:
                    worst = max(worst, float(Fraction(apart) / bound))
    assert worst > 0.02, "the bound is of the size of the errors"


@pytest.mark.long
@pytest.mark.parametrize("word", [16, 32])
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in SOME else pytest.mark.long) for name in NAMES]
)
def test_c_gives_the_integers_of_the_model(name, word, rng):
    in_c, model = evaluators(name, word)
    integers = corners_and_random(model, 100, rng)
    computed, left = in_c.run(integers, in_c.fresh(100))
    expected, remaining = model.run(integers, model.fresh(100))
    for one, other in zip(computed, expected, strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(left, remaining)


@pytest.mark.long
@pytest.mark.parametrize("backend", ["c", pytest.param("c-float", marks=pytest.mark.long)])
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in SOME else pytest.mark.long) for name in NAMES]
)
def test_c_computes_what_numpy_computes(name, backend, rng):
    in_c, double = strapgen.evaluator(name, backend), strapgen.evaluator(name)
    inputs = [
        np.asarray(rng.uniform(-1, 1, size=(50, *s.shape)) * float(s.bound), in_c.dtype)
        for s in program(Choice(name)).inputs
    ]
    results = [
        evaluator(*(array.astype(evaluator.dtype) for array in inputs)) for evaluator in (in_c, double)
    ]
    computed, expected = (result if isinstance(result, tuple) else (result,) for result in results)
    for errors, one, other in zip(in_c.sources.rounding.errors.values(), computed, expected, strict=True):
        if backend == "c":
            np.testing.assert_array_equal(one, other)  # the same operations in the same order
        # Double itself rounds 2**-29 as much; its bound is within a thousandth of that of float.
        apart = np.abs(one.astype(float) - other).reshape(50, -1)
        assert np.all(apart <= np.array([*map(float, errors)]) * 1.001)
        assert backend == "c" or apart.max() > 0


def test_the_sources_build_for_numpy_too():
    for name in NAMES:
        assert sources_of_program(program(Choice(name)), "numpy", None).function.name == name.replace(
            "-", "_"
        )
