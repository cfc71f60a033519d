"""The kernels of the navigation frame on every target: C, integers and model beside numpy, inside their bounds."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from derived import program
from fixed_inputs import corners_and_random
from gathering import each
from kernel_checks import require_integers_of_the_model, require_what_numpy_computes, share_of_bound

import strapgen
from strapgen.catalogue import Choice
from strapgen.ir.fixed_settings import Settings
from strapgen.ir.recursion import Recursion
from strapgen.navigation.frame.navigation_names import NAVIGATION
from strapgen.run.kernel_sources import sources_of_program

NAMES = [*NAVIGATION]
#: A quotient with a root, a recursion with error feedback, and functions: compiled in the quick tests.
SOME = ("wander-rate-ellipsoid", "position-step", "coarse-leveling")
SOME_FIRST = [pytest.param(name, marks=() if name in SOME else pytest.mark.long) for name in NAMES]


def settings(word: int) -> Settings:
    return Settings(word=word, carry="state")


def proper_inputs(evaluator, count: int, rng) -> list[np.ndarray]:
    """Return integers for every input: rotations and directions to the place, corners and numbers of all others.

    States stay an eighth below the end of their range, which they must not leave in the call.
    """
    states = [state for state, _ in (evaluator.sources.recursion or Recursion(())).states]
    inputs = []
    for argument, array in zip(
        evaluator.interface.inputs, corners_and_random(evaluator, 2 * count, rng), strict=True
    ):
        signal = argument.signal
        proper = array[count:] if signal.constraint else array[:count]
        inputs.append(proper * 7 // 8 if signal.name in states and not signal.constraint else proper)
    return inputs


def test_every_source_says_where_it_comes_from_and_every_input_its_range():
    for name in NAMES:
        kernel = strapgen.derive(name)
        assert "derived" in kernel.source, name
        for signal in kernel.inputs:
            assert signal.bound is not None and signal.unit, (name, signal.name)


@pytest.mark.parametrize("word", [pytest.param(16, marks=pytest.mark.long), 32])
@each("name", NAMES)
def test_no_error_exceeds_its_bound(name, word, rng):
    share = share_of_bound(name, settings(word), partial(proper_inputs, rng=rng))
    assert share is not None and share > 0.02, "the bound is of the size of the errors"


@pytest.mark.long
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
