"""Kernels in two speeds that are not in the standard catalogue, on every target: C, integers and model beside numpy."""

from __future__ import annotations

import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fixed_inputs import corners_and_random

import strapgen
import strapgen.ir.exceptions
from strapgen import pipeline
from strapgen.catalogue import TWO_SPEED, choose
from strapgen.design.brief import read_brief
from strapgen.ir.fixed_settings import Settings
from strapgen.navigation.two_speed import two_speed_sources
from strapgen.navigation.two_speed.two_speed_selection import TwoSpeedLoops
from strapgen.run import compiler
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


@pytest.mark.parametrize("counts", [(1, 0, 3), (1, 3, 0), (1, 0, 0)], ids=["slow", "fast", "both"])
@pytest.mark.parametrize("target", ["c", "c-fixed"])
def test_run_without_cycles_in_a_loop_is_refused(target, counts):
    sources = two_speed_sources.sources("dcm", target=target)
    module = compiler.load(sources)
    name = next(file for file in sources.files if file.endswith(".h")).removesuffix(".h")
    header = next(text for file, text in sources.files.items() if file == f"{name}_runs.h")
    prototype = " ".join(re.search(rf"int {name}_run\((.*?)\);", header, re.DOTALL)[1].split())
    pointers = prototype.split(",")[3:]
    memory = module.ffi.new(f"{name}_memory *")
    before = bytes(module.ffi.buffer(memory))
    arrays = [module.ffi.new(f"{text.split()[-2]}[64]") for text in pointers[1:]]
    run = getattr(module.lib, f"{name}_run")
    assert run(*counts, memory, *arrays) == 4
    assert bytes(module.ffi.buffer(memory)) == before
    assert all(set(bytes(module.ffi.buffer(array))) == {0} for array in arrays)


BRIEF = Path(__file__).resolve().parents[2] / "examples" / "briefs" / "ahrs.toml"
CYCLES = 4
#: Outputs of the loops with their elements, and the stages that have them.
OUTPUTS = {"next_angle_sum": "fast", "next_coning": "fast", "rotation_vector": "vector", "next": "update"}
SHORTEST = 1 - float(Settings().allowance)


def angle(state: str, unit: float = 0.0, high: int = 0, **errors: tuple[float, ...]) -> float:
    """Return the angle of a slow cycle in rad, for errors of outputs, a unit of samples and their largest sum."""
    loops = TwoSpeedLoops(state, CYCLES, read_brief(BRIEF))
    sources = {
        stage: SimpleNamespace(
            fixed=SimpleNamespace(
                outputs=[
                    SimpleNamespace(signal=SimpleNamespace(name=name), errors=errors.get(name, (0.0,) * 3))
                    for name, its_stage in OUTPUTS.items()
                    if its_stage == stage
                ]
            )
        )
        for stage in ("fast", "vector", "update")
    }
    argument = SimpleNamespace(format=SimpleNamespace(unit=unit), high=high)
    loops.__dict__["fixed"] = SimpleNamespace(
        sources=sources, arguments={"gyro": argument, "fast_angle_sum": argument}
    )
    return loops._angle_of_a_cycle()


@pytest.mark.parametrize("state", ["euler", "dcm"])
def test_errors_of_the_rotation_vector_turn_by_their_length(state):
    assert angle(state, rotation_vector=(2e-6, 3e-6, 6e-6)) == pytest.approx(7e-6, rel=1e-12)
    assert angle(state, next_coning=(3e-6, 4e-6, 0.0)) == pytest.approx(CYCLES * 5e-6, rel=1e-12)
    # A sample is off by a unit, and enters the sum; in the fast cycles it turns with the sum before, 512 units long.
    unit = 2.0**-18
    samples = math.sqrt(3) * unit * (1 + 2 * CYCLES * math.sqrt(3) * 512 * unit)
    assert angle(state, unit, 512) == pytest.approx(samples, rel=1e-12)


def test_parameters_of_the_least_length_turn_by_twice_the_angle_of_an_error_across_them():
    error = (6e-4, 0.0, 0.0, 8e-4)
    assert angle("euler", next=error) == pytest.approx(2 * math.asin(1e-3 / SHORTEST), rel=1e-12)


def test_a_change_across_the_least_stretch_turns_a_matrix_by_the_bound_but_for_its_unevenness():
    """A skew change turns a matrix by its length over the root of 2; where it is uneven, others turn it further."""
    change = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 0]]) * 1e-3
    left, _, right = np.linalg.svd(np.diag([SHORTEST, SHORTEST, 1]) + change)
    rotation = left @ right
    tangent = (rotation[0, 1] - rotation[1, 0]) / (rotation[0, 0] + rotation[1, 1])
    bound = angle("dcm", next=tuple(change.ravel()))
    assert math.atan(tangent) < bound
    longest = math.sqrt(2 - SHORTEST**2)
    further = math.sqrt(1 + ((longest - SHORTEST) / (longest + SHORTEST)) ** 2)
    shortened = SHORTEST / (SHORTEST - np.linalg.norm(change))  # by the error itself
    assert bound == pytest.approx(tangent * further * shortened, rel=1e-12)


def test_words_that_are_too_short_for_a_bound_are_refused():
    with pytest.raises(ValueError, match="the words are too short for a bound"):
        angle("dcm", next=(SHORTEST / 2, 0.0, 0.0))
    with pytest.raises(ValueError, match="the sum of the increments is rounded"):
        angle("dcm", next_angle_sum=(0.0, 0.0, 1e-9))
