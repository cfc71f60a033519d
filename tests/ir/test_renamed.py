"""Names of the version before: each works as its present one, and warns at the caller's line."""

from __future__ import annotations

import inspect
import re
from fractions import Fraction

import numpy as np
import pytest
from public_names import public

import strapgen
from strapgen.catalogue.methods.shaped_coning import SHAPES
from strapgen.ir.kernel_info import Recursion

OLD = {"Companions": "AttitudeStep", "resolution": "EPSILON", "turns_signal": "node_rotations_signal"}


@pytest.mark.parametrize("old", OLD)
def test_old_public_names_warn(old):
    with pytest.warns(DeprecationWarning, match=f"strapgen.{old} is now strapgen.{OLD[old]}") as said:
        assert getattr(strapgen, old) is getattr(strapgen, OLD[old])
    assert said[0].filename == __file__


def test_old_fields_of_a_recursion():
    pairs = (("sum", "next_sum"), ("previous", "next_previous"))
    with pytest.warns(DeprecationWarning, match="kept is now retained") as said:
        old = Recursion(pairs, kept=("previous",))
    assert said[0].filename == __file__
    assert old == Recursion(pairs, retained=("previous",))
    with pytest.warns(DeprecationWarning, match="Recursion.begun_anew is now reset"):
        assert old.begun_anew == old.reset == ("sum",)


def test_old_fields_of_a_step_and_its_kernel():
    kernel = strapgen.derive("euler", "rk1")
    build = strapgen.KernelBuilder()
    with pytest.warns(DeprecationWarning, match="companions is now attitude_step"):
        made = build.kernel("mine", "Mine", "this test", companions=kernel.attitude_step)
    assert made.attitude_step == kernel.attitude_step
    for one in (made, strapgen.lower(kernel), strapgen.generate(strapgen.lower(kernel), "numpy")):
        with pytest.warns(DeprecationWarning, match="companions is now attitude_step"):
            assert one.companions == kernel.attitude_step
        with pytest.warns(DeprecationWarning, match="own is now bundled_"):
            assert one.own == ()


def test_old_names_of_companions_and_extra_increments():
    algorithm = strapgen.backend("euler", "rk1")
    with pytest.warns(DeprecationWarning, match="Backend.beside is now companion"):
        assert algorithm.beside("dcm-from-euler") is algorithm.companion("dcm-from-euler")
    step = strapgen.derive("euler", "coning-compressed", 1, previous=1).attitude_step
    with pytest.warns(DeprecationWarning, match="AttitudeStep.beside is now extra_increments"):
        assert step.beside == step.extra_increments == 1


#: Counts that were called samples: an object, its present attribute, and the number.
COUNTS = {
    "Window": (strapgen.WINDOWS["window-3-3"], "total_increments", 7),
    "ShapedConing": (SHAPES["coning-shaped-8"], "increments", 1),
    "Backend": (strapgen.backend("euler", "coning-compressed", 1, previous=1), "samples_per_step", 2),
}


@pytest.mark.parametrize("name", COUNTS)
def test_an_attribute_samples_that_is_a_count_warns(name):
    value, present, number = COUNTS[name]
    with pytest.warns(DeprecationWarning, match=rf"^{name}\.samples is now {present}$") as said:
        assert value.samples == getattr(value, present) == number
    assert said[0].filename == __file__


def test_a_motion_takes_a_count_as_increments():
    turn = strapgen.motion("constant", z_deg_s=90)
    with pytest.warns(DeprecationWarning, match=r"^samples is now increments$") as said:
        old = turn.increments(Fraction(1), 2, samples=3)
    assert said[0].filename == __file__
    assert np.array_equal(old, turn.increments(Fraction(1), 2, increments=3))


def test_two_speeds_and_studies_take_an_array_as_samples():
    turn, zero = np.full((4, 3), 0.005), np.zeros((4, 3))
    runner = strapgen.TwoSpeed("euler")
    with pytest.warns(DeprecationWarning, match=r"^increments is now samples$"):
        old = runner.run(increments=turn, velocity_increments=zero, fast_cycles=2)
    assert np.array_equal(old.attitudes, runner.run(turn, zero, fast_cycles=2).attitudes)
    (case,) = strapgen.study.cases(words=12, carries="full")
    with pytest.warns(DeprecationWarning, match=r"^increments is now samples$"):
        noise = strapgen.study.expected_noise(case, 1e-5, increments=np.full((9, 2, 3), 1e-3))
    assert noise == strapgen.study.expected_noise(case, 1e-5, np.full((9, 2, 3), 1e-3)) > 0


def test_every_public_count_is_increments_and_every_array_samples():
    found = {}
    for name, value in public().items():
        parts = {name: value}
        if inspect.isclass(value):
            parts = {f"{name}.{key}": part for key, part in vars(value).items() if key[0] != "_"} | parts
        for full, part in parts.items():
            part = getattr(part, "__func__", part)
            if not (inspect.isfunction(part) or (inspect.isclass(part) and not issubclass(part, Exception))):
                continue
            for key, parameter in inspect.signature(part).parameters.items():
                if key in ("samples", "increments"):
                    found[full, key] = str(parameter.annotation)
    is_count = {place: re.match(r"(Annotated\[|ForwardRef\(')?int\b", kind) for place, kind in found.items()}
    assert len(found) > 25
    assert {place for place, count in is_count.items() if bool(count) != (place[1] == "increments")} == set()
