"""Derives what the loops feed back: the commanded rate of the level frame, in body axes."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import sympy as sp

from strapgen.catalogue.kinematics import DCM
from strapgen.ir.signals import CYCLE, Signal
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.navigation.instruments.imu_errors import CYCLE as LENGTH
from strapgen.navigation.loops.loop_signals import HEADING_RATE, LEVEL_RATE, LTR81

_INCREMENT = Signal.vector(
    "increment",
    "d",
    unit="rad",
    meaning="angle increment of the cycle, body axes",
    bound=Fraction(1, 8),
    frame="b",
    over=CYCLE,
)


def body_feedback() -> Kernel:
    """Return the commanded rate of the level frame in body axes, -C' u, and the increment that has it added."""
    build = KernelBuilder()
    increment, C = build.input(_INCREMENT), build.input(replace(DCM.state, name="attitude"))
    level, heading = build.input(LEVEL_RATE), build.scalar(HEADING_RATE)
    cycle = build.scalar(LENGTH)
    rate = Signal.vector(
        "feedback_rate",
        "feedback",
        unit="rad/s",
        meaning="rate to add to that of the gyros: the commanded one of the frame, reversed; body axes",
        frame="b",
    )
    feedback = build.output(rate, -C.T * sp.Matrix([*level, heading]))
    corrected = replace(
        _INCREMENT,
        name="corrected_increment",
        elements=tuple(f"corrected_{axis}" for axis in "xyz"),
        meaning="angle increment of the cycle against the commanded frame, body axes",
        bound=None,
    )
    build.output(corrected, increment + cycle * feedback)
    return build.kernel(
        "body-feedback", "Feedback of the loops in body axes", f"{LTR81}; feedback as in Fig. 9"
    )
