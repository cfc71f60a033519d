"""Euler parameters from the rotation vector of two increments, with the companions of the catalogue."""

from fractions import Fraction

from strapgen.catalogue.kinematics import EULER
from strapgen.catalogue.methods.method import increments_signal
from strapgen.ir.kernel_info import AttitudeStep
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import cross
from strapgen.kernel.kernel import KernelBuilder


def algorithm():
    """Return the step: half the rotation vector, and its series to third order."""
    build = KernelBuilder()
    state = build.input(EULER.state)
    d = build.input(increments_signal(2))
    first, second = d[0, :].T, d[1, :].T
    half = build.stage(
        Signal.vector("half_phi", "half_phi", unit="rad", meaning="half the rotation vector of the step"),
        (first + second) / 2 + cross(first, second) / 3,
    )
    square = half.dot(half)
    transition = build.stage(EULER.transition, [*(half * (1 - square / 6)), 1 - square / 2])
    build.output(EULER.next, EULER.product(state, transition))
    return build.kernel(
        "picard",
        "Euler parameters: rotation vector of two increments",
        "this test",
        transition="transition",
        attitude_step=AttitudeStep(
            "euler-product", "euler-normalize", "dcm-from-euler", tuple(map(Fraction, (0, 0, 0, 1)))
        ),
    )
