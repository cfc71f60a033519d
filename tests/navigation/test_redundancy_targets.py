"""The kernels of redundant sensors on every target: C, integers and model beside numpy, inside their bounds."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from derived import program, quantized
from fixed_inputs import corners_and_random
from gathering import each
from kernel_checks import require_integers_of_the_model, require_what_numpy_computes, share_of_bound

from strapgen.catalogue import Choice
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.recursion import Recursion
from strapgen.navigation.redundancy.redundancy_names import REDUNDANCY
from strapgen.run.kernel_sources import sources_of_program

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


@pytest.mark.long
def test_the_bound_of_the_selection_is_zero():
    for word in (16, 32):
        assert not any(quantized(Choice("select-hexad"), settings(word)).error_bounds.values())


@pytest.mark.parametrize("word", [pytest.param(16, marks=pytest.mark.long), 32])
@each("name", NAMES)
def test_no_error_exceeds_its_bound(name, word, rng):
    share = share_of_bound(name, settings(word), partial(proper_inputs, rng=rng))
    assert share is None or share > 0.02, "the bound is of the size of the errors"


@pytest.mark.parametrize(
    ("name", "word"),
    [
        *(pytest.param(name, 32, marks=() if name in SOME else pytest.mark.long) for name in NAMES),
        *(pytest.param(name, 16, marks=pytest.mark.long) for name in SOME),
    ],
)
def test_c_gives_the_integers_of_the_model(name, word, rng):
    require_integers_of_the_model(name, settings(word), partial(proper_inputs, rng=rng))


@pytest.mark.parametrize("backend", ["c", pytest.param("c-float", marks=pytest.mark.long)])
@pytest.mark.parametrize("name", SOME_FIRST)
def test_c_computes_what_numpy_computes(name, backend, rng):
    require_what_numpy_computes(name, backend, settings(32), partial(proper_inputs, rng=rng))


def test_the_sources_build_for_numpy_too():
    for name in NAMES:
        sources = sources_of_program(program(Choice(name)), "numpy", None)
        assert sources.function.name == name.replace("-", "_")
