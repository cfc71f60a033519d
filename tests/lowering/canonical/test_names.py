"""Canonical forms under any names: a vector of the kernel may be called as a quantity of the form."""

from __future__ import annotations

from dataclasses import replace

import pytest
import sympy as sp

from strapgen.catalogue.kinematics import EULER
from strapgen.catalogue.methods.method import increments_signal
from strapgen.ir.kernel_info import AttitudeStep
from strapgen.ir.signals import Signal
from strapgen.kernel import algebra
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.lowering import lower


def two_sample(stage: str, prefix: str, transition: tuple[str, ...], increments: tuple[str, str]) -> Kernel:
    """Return a step whose sum of increments, transition and increments are called as told."""
    build = KernelBuilder()
    state = build.input(EULER.state)
    elements = tuple(f"{vector}_{axis}" for vector in increments for axis in "xyz")
    d = build.input(replace(increments_signal(2), elements=elements))
    first, second = d[0, :].T, d[1, :].T
    total = build.stage(Signal.vector(stage, prefix), first + second)
    phi = build.stage(Signal.vector("phi", "phi"), total + sp.Rational(2, 3) * algebra.cross(first, second))
    p = build.stage(
        Signal("p", (4,), transition),
        [*(phi * (sp.Rational(1, 2) - algebra.dot(phi, phi) / 48)), 1 - algebra.dot(phi, phi) / 8],
    )
    build.output(EULER.next, algebra.quaternion_product(state, p))
    attitude_step = AttitudeStep("euler-product", "euler-normalize", "dcm-from-euler", (0, 0, 0, 1))
    return build.kernel("two-sample", "Two samples", "this test", transition="p", attitude_step=attitude_step)


@pytest.mark.parametrize(
    "transition", [("p_x", "p_y", "p_z", "p_s"), tuple("xyzs"), ("a_x", "b_y", "c_z", "d_s")]
)
@pytest.mark.parametrize(
    ("stage", "prefix", "increments"),
    [
        ("total", "total", ("d_1", "d_2")),
        ("d_1", "total", ("d_1", "d_2")),
        ("d_1_cross_d_2", "d_1_cross_d_2", ("d_1", "d_2")),
        ("total", "total", ("sigma", "delta")),
        ("total", "total", ("sigma_cross_delta", "delta")),
        ("total", "total", ("p_lever", "p_sigma")),
        ("sigma_dot_sigma", "sigma", ("shared_1", "factor_1")),
    ],
)
def test_a_step_is_lowered_to_the_same_polynomials(stage, prefix, increments, transition):
    kernel = two_sample(stage, prefix, transition, increments)
    names = [name for signal in kernel.inputs for name in signal.elements]
    ring, *generators = sp.ring(names, sp.QQ)
    result = lower(kernel).run(dict(zip(names, generators, strict=True)))
    assert [ring(element) for element in result["next"]] == kernel.polynomials()["next"]
