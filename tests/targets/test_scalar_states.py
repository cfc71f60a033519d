"""A kernel whose one state is a scalar: every target stores it, and the integer model has its one error feedback."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

import strapgen
from strapgen import KernelBuilder, Signal
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.kernel_info import Recursion
from strapgen.ir.signals import after
from strapgen.kernel.kernel import Kernel
from strapgen.run.backends import of_sources

STATE = Signal.scalar("level", meaning="output of a lag", bound=Fraction(1, 2))
DRIVE = Signal.scalar("drive", meaning="input of a lag", bound=Fraction(1, 2))


def lag() -> Kernel:
    """Return a lag whose time constant is 1000 cycles."""
    build = KernelBuilder()
    level, drive = build.scalar(STATE), build.scalar(DRIVE)
    build.output(after(STATE), [level + (drive - level) / 1000])
    return build.kernel("lag", "A lag", "test", recursion=Recursion(((STATE.name, after(STATE).name),)))


@pytest.mark.parametrize("target", ["numpy", "c", "c-float"])
def test_floating_point_stores_a_scalar(target):
    evaluator = of_sources(strapgen.generate(strapgen.lower(lag()), target))
    level = np.array([0.25, -0.125], evaluator.dtype)
    drive = np.array([0.5, 0.25], evaluator.dtype)
    expected = level.astype(float) + (drive.astype(float) - level) / 1000
    np.testing.assert_allclose(evaluator(level, drive), expected, rtol=4 * np.finfo(evaluator.dtype).eps)


@pytest.mark.parametrize("carry", ["none", "state"])
@pytest.mark.parametrize("word", [16, 32])
def test_fixed_point_carries_the_one_rounding_of_a_scalar(word, carry):
    fixed = strapgen.quantize(strapgen.lower(lag()), Settings(word=word, carry=carry))
    assert len(fixed.interface.residuals) == (carry == "state")
    in_c, model = (of_sources(strapgen.generate(fixed, target)) for target in ("c-fixed", "fixed-model"))
    highest = fixed.interface.inputs[1].high
    drive = np.array([[highest], [-highest // 3], [1]], in_c.number)
    states = [np.zeros((3, 1), in_c.number)] * 2
    feedback = [evaluator.fresh(3) for evaluator in (in_c, model)]
    for _ in range(50):
        for k, evaluator in enumerate((in_c, model)):
            (states[k],), feedback[k] = evaluator.run([states[k], drive], feedback[k])
        np.testing.assert_array_equal(*states)
        np.testing.assert_array_equal(*feedback)
    assert states[0][0, 0] > 0 > states[0][1, 0]
