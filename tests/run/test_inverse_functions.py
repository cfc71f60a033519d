"""Arcsine, arccosine, whole turns and the resolution of a target, on every back end."""

from __future__ import annotations

from fractions import Fraction

import mpmath
import numpy as np
import pytest
import sympy as sp
from derived import generated
from precisions import precision

import strapgen
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import Wrapped
from strapgen.kernel.kernel import EPSILON, KernelBuilder
from strapgen.run.backends import BACKENDS, of_sources


def made(backend_name, function, bound=1):
    build = KernelBuilder()
    x = build.scalar(Signal.scalar("x", meaning="argument", bound=Fraction(bound)))
    build.output(Signal("y", (1,), ("y_1",), meaning="value"), [function(x)])
    kernel = build.kernel("tested", "A function", "none")
    return of_sources(generated(strapgen.lower(kernel), backend_name))


def last_place(evaluator, backend_name):
    if BACKENDS[backend_name].fixed:
        return float(evaluator.interface.outputs[0].format.unit)
    return float(np.finfo(evaluator.dtype).eps)


@pytest.mark.parametrize("name", ["asin", "acos"])
def test_inverse_sine_and_cosine(name, backend_name):
    evaluator = made(backend_name, getattr(sp, name))
    unit = last_place(evaluator, backend_name)
    ends = 1 - 2.0 ** -np.arange(1, 53)
    points = np.concatenate([np.linspace(-1, 1, 41), ends, -ends, [1e-9, -1e-300]]).astype(evaluator.dtype)
    if BACKENDS[backend_name].fixed:
        argument = evaluator.interface.inputs[0]
        points = evaluator.numbers(argument, evaluator.integers(argument, points))
        unit = float(evaluator.interface.outputs[0].errors[0])
    else:
        unit *= 4
    for x, y in zip(points, evaluator(points)[:, 0], strict=True):
        assert abs(float(y) - float(getattr(mpmath, name)(mpmath.mpf(float(x))))) <= unit


def test_beyond_the_ends_is_the_end():
    evaluator = made("numpy", sp.asin, 2)
    assert evaluator(1 + 2.0**-52) == pytest.approx(np.pi / 2, abs=1e-15)


def test_whole_turns_are_taken_off(backend_name):
    evaluator = made(backend_name, lambda x: Wrapped(x), 9)
    points = np.array([-9, -4, -3.2, -3.1, 0, 1, 3.1, 3.2, 9])
    wanted = points - 2 * np.pi * np.round(points / (2 * np.pi))
    off = np.abs(evaluator(points.astype(evaluator.dtype))[:, 0] - wanted)
    # The last place of the argument, which is rounded too.
    assert off.max() <= 16 * last_place(evaluator, backend_name)


def test_the_resolution_is_the_targets(backend_name):
    evaluator = made(backend_name, lambda x: x + EPSILON)
    wanted = {"float": 2.0**-23, "32": 2.0**-30, "16": 2.0**-14}
    assert float(evaluator(0.0)[0]) == wanted.get(precision(backend_name), 2.0**-52)
