"""Names of the version before: each works as its present one, and warns at the caller's line."""

from __future__ import annotations

import pytest

import strapgen
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
