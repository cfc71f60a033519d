"""Kernels in two speeds that are not in the standard catalogue, on every target: C, integers and model beside numpy."""

from __future__ import annotations

import numpy as np
import pytest
from fixed_inputs import corners_and_random

import strapgen
import strapgen.ir.exceptions
from strapgen import pipeline
from strapgen.catalogue import TWO_SPEED, choose
from strapgen.ir.fixed_settings import Settings
from strapgen.targets.names import external

NAMES = [
    *("dcm-update-5", "euler-update", "euler-update-4", "dcm-navigation-update-2", "euler-navigation-update"),
    *("navigation-rotation", "coning-slow", "sculling-fast-1", "dcm-acceleration", "euler-velocity-1"),
    *("euler-velocity-2", "navigation-velocity", "dcm-rows-orthogonalize", "dcm-third-row"),
    *("euler-normalize-first-order", "euler-from-dcm-continuous"),
]


def test_the_names_are_there():
    assert all(not TWO_SPEED[name].standard for name in NAMES)


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_every_target_computes_the_kernel(name, rng):
    in_c, model = strapgen.evaluator(name, "c-fixed32"), strapgen.evaluator(name, "fixed-model", Settings())
    integers = corners_and_random(model, 100, rng)
    done = []  # what is accepted: a range that is checked may be left at the corners
    for k in range(100):
        sample = [array[k : k + 1] for array in integers]
        try:
            computed, _ = in_c.run(sample, in_c.fresh(1))
        except strapgen.InputError:
            with pytest.raises(strapgen.InputError):
                model.run(sample, model.fresh(1))
            continue
        wanted, _ = model.run(sample, model.fresh(1))
        for one, other in zip(computed, wanted, strict=True):
            np.testing.assert_array_equal(one, other)
        done.append((sample, computed))
    assert len(done) >= 30
    double = strapgen.evaluator(name)
    for sample, computed in done:
        numbers = [
            model.numbers(argument, array).reshape(1, *argument.signal.shape)
            for argument, array in zip(model.interface.inputs, sample, strict=True)
        ]
        results = [backend(*numbers) for backend in (double, strapgen.evaluator(name, "c"))]
        results = [result if isinstance(result, tuple) else (result,) for result in results]
        for argument, made, one, other in zip(model.interface.outputs, computed, *results, strict=True):
            np.testing.assert_allclose(one, other, rtol=0, atol=8e-16 * max(1.0, float(np.abs(one).max())))
            apart = np.abs(model.numbers(argument, made).ravel() - one.ravel())
            assert np.all(apart <= [float(error) * (1 + 1e-6) for error in argument.errors])


#: Higher orders have the same code, and more terms of the same series.
FEW_ORDERS = [
    name for name in TWO_SPEED if not name.rpartition("-update-")[1] or int(name.split("-")[-1]) <= 5
]


@pytest.mark.long
def test_every_kernel_lowers_for_every_target():
    assert len(FEW_ORDERS) == len(TWO_SPEED) - 3 * 15
    for name in FEW_ORDERS:
        choice, function = choose(name), name.replace("-", "_")
        assert pipeline.compile(choice, "numpy").function.name == function
        assert pipeline.compile(choice, "c").function.name == external(function)
        for word in (16, 32):
            in_integers = pipeline.compile(choice, "c-fixed", Settings(word=word))
            assert in_integers.fixed.settings.word == word
            # Errors are below what 8 bits hold, but for a sign that rounding may turn over at half a turn.
            if name != "euler-from-dcm-continuous":
                for argument in in_integers.fixed.outputs:
                    size = float(argument.high * argument.format.unit)
                    assert all(0 <= float(error) < size / 2**8 for error in argument.errors), name
