"""Checks that hold a kernel on one target to another, for the test modules that name the kernels and their inputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction

import numpy as np
from derived import program, quantized
from fixed_inputs import exactly

import strapgen
from strapgen.catalogue import Choice
from strapgen.ir.fixed_settings import Settings

#: Returns integers for every input of an evaluator, so many of each.
Inputs = Callable[[strapgen.Evaluator, int], Sequence[np.ndarray]]


def _choice(name: str | Choice) -> Choice:
    return name if isinstance(name, Choice) else Choice(name)


def share_of_bound(name: str | Choice, settings: Settings, proper_inputs: Inputs) -> float | None:
    """Hold the errors of a kernel to its bounds, and return the largest share; None where all bounds are zero."""
    fixed = quantized(_choice(name), settings)
    model = strapgen.evaluator(name, "fixed-model", settings)
    inputs = proper_inputs(model, 20)
    results, _ = model.run(inputs, model.fresh(20))
    share = 0.0
    for k, sample in enumerate(zip(*(array.tolist() for array in inputs), strict=True)):
        known = exactly(fixed, sample)
        for argument, result in zip(fixed.interface.outputs, results, strict=True):
            for element, integer, bound in zip(argument.values, result[k], argument.errors, strict=True):
                apart = abs(int(integer) * argument.unit - known[element])
                assert apart <= bound, element
                share = max(share, float(Fraction(apart) / bound) if bound else 0.0)
    return share if any(any(argument.errors) for argument in fixed.interface.outputs) else None


def require_integers_of_the_model(name: str | Choice, settings: Settings, proper_inputs: Inputs) -> None:
    """Require that C returns the integers and the error feedback of the model."""
    backends = (f"c-fixed{settings.word}", "fixed-model")
    in_c, model = (strapgen.evaluator(name, backend, settings) for backend in backends)
    integers = proper_inputs(model, 100)
    computed, left = in_c.run(integers, in_c.fresh(100))
    expected, remaining = model.run(integers, model.fresh(100))
    for one, other in zip(computed, expected, strict=True):
        np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(left, remaining)


def require_what_numpy_computes(
    name: str | Choice, backend: str, settings: Settings, proper_inputs: Inputs
) -> None:
    """Require that C in floating point is within its bounds of numpy."""
    in_c, double = strapgen.evaluator(name, backend), strapgen.evaluator(name)
    model = strapgen.evaluator(name, "fixed-model", settings)
    inputs = [
        (array * float(argument.format.unit)).astype(in_c.dtype).reshape(50, *argument.signal.shape)
        for argument, array in zip(model.interface.inputs, proper_inputs(model, 50), strict=True)
    ]
    results = [
        evaluator(*(array.astype(evaluator.dtype) for array in inputs)) for evaluator in (in_c, double)
    ]
    computed, expected = (result if isinstance(result, tuple) else (result,) for result in results)
    bounds = in_c.sources.rounding
    for signal, one, other in zip(program(_choice(name)).outputs, computed, expected, strict=True):
        apart = np.abs(one.astype(float) - other).reshape(50, -1)
        if bounds.errors:
            # Double itself rounds 2**-29 as much as float; the bounds of both are of twice what either may lose.
            allowed = np.array([*map(float, bounds.errors[signal.signal.name])])
            assert np.all(apart <= allowed * (2 if backend == "c" else 1.001)), signal.signal.name
        else:
            # Functions of the library; the angles of a matrix may differ by what its rounding turns it by.
            turned = np.minimum(apart, np.abs(apart - 2 * np.pi))
            assert turned.max() <= 64 * np.finfo(in_c.dtype).eps * np.abs(other).max(), signal.signal.name
