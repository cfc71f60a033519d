"""The kernels of redundant sensors on every target: C, integers and model beside numpy, inside their bounds."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from derived import program, quantized
from fixed_inputs import corners_and_random, exactly
from gathering import each

import strapgen
from strapgen.backends.kernel_sources import sources_of_program
from strapgen.catalogue import REDUNDANCY, Choice
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.recursion import Recursion

NAMES = [*REDUNDANCY]
#: Whole numbers, and fractions: compiled in the quick tests.
SOME = ("parity-hexad", "triad-hexad-134")
SOME_FIRST = [pytest.param(name, marks=() if name in SOME else pytest.mark.long) for name in NAMES]


def settings(word: int) -> Settings:
    return Settings(word=word, carry="state")


def proper_inputs(evaluator, count: int, rng) -> list[np.ndarray]:
    """Return integers for every input: rotations and directions to the place, corners and numbers of all others.

    The weight of a mean is not negative. Where there are states, all stay an eighth below the end of their range, which
    states must not leave in the call.
    """
    states = (evaluator.sources.recursion or Recursion(())).states
    inputs = []
    for argument, array in zip(
        evaluator.interface.inputs, corners_and_random(evaluator, 2 * count, rng), strict=True
    ):
        signal = argument.signal
        proper = array[count:] if signal.constraint else array[:count]
        proper = np.abs(proper) if signal.name == "share" else proper
        inputs.append(proper * 7 // 8 if states and not signal.constraint else proper)
    return inputs


def test_the_bound_of_the_selection_is_zero():
    for word in (16, 32):
        assert not any(quantized(Choice("select-hexad"), settings(word)).error_bounds.values())


@pytest.mark.parametrize("word", [pytest.param(16, marks=pytest.mark.long), 32])
@each("name", NAMES)
def test_no_error_exceeds_its_bound(name, word, rng):
    fixed = quantized(Choice(name), settings(word))
    model = strapgen.evaluator(name, "fixed-model", settings(word))
    inputs = proper_inputs(model, 20, rng)
    results, _ = model.run(inputs, model.fresh(20))
    share = 0.0
    for k, sample in enumerate(zip(*(array.tolist() for array in inputs), strict=True)):
        known = exactly(fixed, sample)
        for argument, result in zip(fixed.interface.outputs, results, strict=True):
            for element, integer, bound in zip(argument.values, result[k], argument.errors, strict=True):
                apart = abs(int(integer) * argument.unit - known[element])
                assert apart <= bound, element
                share = max(share, float(Fraction(apart) / bound) if bound else 0.0)
    certain = all(error == 0 for argument in fixed.interface.outputs for error in argument.errors)
    assert share > 0.02 or certain, "the bound is of the size of the errors"


@pytest.mark.parametrize(
    ("name", "word"),
    [
        *(pytest.param(name, 32, marks=() if name in SOME else pytest.mark.long) for name in NAMES),
        *(pytest.param(name, 16, marks=pytest.mark.long) for name in SOME),
    ],
)
def test_c_gives_the_integers_of_the_model(name, word, rng):
    in_c, model = (
        strapgen.evaluator(name, backend, settings(word)) for backend in (f"c-fixed{word}", "fixed-model")
    )
    integers = proper_inputs(model, 100, rng)
    computed, left = in_c.run(integers, in_c.fresh(100))
    expected, remaining = model.run(integers, model.fresh(100))
    for one, other in zip(computed, expected, strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(left, remaining)


@pytest.mark.parametrize("backend", ["c", pytest.param("c-float", marks=pytest.mark.long)])
@pytest.mark.parametrize("name", SOME_FIRST)
def test_c_computes_what_numpy_computes(name, backend, rng):
    in_c, double = strapgen.evaluator(name, backend), strapgen.evaluator(name)
    model = strapgen.evaluator(name, "fixed-model", settings(32))
    inputs = [
        (array * float(argument.format.unit)).astype(in_c.dtype).reshape(50, *argument.signal.shape)
        for argument, array in zip(model.interface.inputs, proper_inputs(model, 50, rng), strict=True)
    ]
    results = [
        evaluator(*(array.astype(evaluator.dtype) for array in inputs)) for evaluator in (in_c, double)
    ]
    computed, expected = (result if isinstance(result, tuple) else (result,) for result in results)
    bounds = in_c.sources.rounding
    for signal, one, other in zip(program(Choice(name)).outputs, computed, expected, strict=True):
        apart = np.abs(one.astype(float) - other).reshape(50, -1)
        if bounds.errors:
            # Double itself rounds 2**-29 as much as float; the bounds of both are of twice what either may lose.
            allowed = np.array([*map(float, bounds.errors[signal.signal.name])])
            assert np.all(apart <= allowed * (2 if backend == "c" else 1.001)), signal.signal.name
        else:
            # Functions of the library; the angles of a matrix may differ by what its rounding turns it by.
            turned = np.minimum(apart, np.abs(apart - 2 * np.pi))
            assert turned.max() <= 64 * np.finfo(in_c.dtype).eps * np.abs(other).max(), signal.signal.name


def test_the_sources_build_for_numpy_too():
    for name in NAMES:
        sources = sources_of_program(program(Choice(name)), "numpy", None)
        assert sources.function.name == name.replace("-", "_")
