"""The kernels of an attitude and heading reference on every target, inside their bounds, and what they compute."""

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
from strapgen.navigation.loops.loop_names import LOOPS
from strapgen.run.kernel_sources import sources_of_program

NAMES = [*LOOPS]
#: A recursion with error feedback, and a function: compiled in the quick tests.
SOME = ("level-loop", "heading-loop")
SOME_FIRST = [pytest.param(name, marks=() if name in SOME else pytest.mark.long) for name in NAMES]


def settings(word: int) -> Settings:
    return Settings(word=word, carry="state")


def proper_inputs(evaluator, count: int, rng) -> list[np.ndarray]:
    """Return integers for every input: rotations to the place, corners and numbers of all others.

    States and references reach a quarter of their range, and gains far less, since they are for small errors.
    No corner has two headings that are half a turn apart, where the error of the heading jumps.
    """
    states = [state for state, _ in (evaluator.sources.recursion or Recursion(())).states]
    inputs = []
    pairs = zip(evaluator.interface.inputs, corners_and_random(evaluator, 2 * count, rng), strict=True)
    for argument, array in pairs:
        signal = argument.signal
        proper = array[count:] if signal.constraint else array[:count]
        small = 4 if signal.name in states or signal.name.startswith(("reference", "magnetic")) else 1
        inputs.append(proper // (1 << 14 if signal.name in ("k1", "k2", "k3") else small))
    return inputs


@pytest.mark.parametrize("word", [pytest.param(16, marks=pytest.mark.long), 32])
@each("name", NAMES)
def test_no_error_exceeds_its_bound(name, word, rng):
    share = share_of_bound(name, settings(word), partial(proper_inputs, rng=rng))
    assert share is not None and share > 0.02, "the bound is of the size of the errors"


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


def test_the_sources_build_for_numpy_and_say_what_is_derived():
    for name in NAMES:
        sources = sources_of_program(program(Choice(name)), "numpy", None)
        assert sources.function.name == name.replace("-", "_")
        assert "derived" in strapgen.derive(name).source


def test_a_frame_that_is_commanded_turns_the_other_way_in_body_axes():
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # x of the body along y of the frame
    rate, corrected = strapgen.evaluator("body-feedback")([0.1, 0, 0], turn, [0.02, 0], 0.01, 0.5)
    np.testing.assert_allclose(rate, [0, 0.02, -0.01])
    np.testing.assert_allclose(corrected, [0.1, 0.01, -0.005])
    assert strapgen.evaluator("heading-from-dcm")(turn) == np.pi / 2


def test_a_heading_error_over_the_half_turn_is_the_short_way():
    bias, rate = strapgen.evaluator("heading-loop")(3.0, -3.0, 0.0, 0.5, 0.125, 0.01)
    short = 6 - 2 * np.pi
    np.testing.assert_allclose([bias, rate], [0.01 * 0.125 * short, 0.5 * short], rtol=1e-12)


def test_attitude_mode_is_levelling_without_bias_and_curvature():
    level, erect = strapgen.evaluator("level-loop"), strapgen.evaluator("erection")
    V, change = np.array([0.3, -0.7]), np.array([0.01, 0.02, -0.1])
    velocity, bias, rate = level(V, np.zeros(2), change, np.zeros(2), 0.0, 0.6, 0.01, 0.0, 0.01)
    np.testing.assert_array_equal(bias, 0)
    for one, other in zip((velocity, rate), erect(V, change, 0.6, 0.01, 0.01), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-15)
