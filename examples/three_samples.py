"""Euler parameters from three increments, whose cross products have unknown coefficients."""

import sympy as sp

from strapgen import EULER, AttitudeStep, KernelBuilder, Signal, algebra, increments_signal


def algorithm():
    """Return the step; a weighs products of neighbours, b that of the first and the last increment."""
    a, b = sp.symbols("a b")
    build = KernelBuilder()
    build.parameter(a, b)
    state = build.input(EULER.state)
    increments = build.input(increments_signal(3))
    d1, d2, d3 = (increments[k, :].T for k in range(3))
    phi = build.stage(
        Signal.vector("phi", "phi", unit="rad", meaning="rotation vector of the step"),
        d1 + d2 + d3 + a * algebra.cross(d2, d3 - d1) + b * algebra.cross(d1, d3),
    )
    p = build.stage(EULER.transition, algebra.quaternion(phi))
    build.output(EULER.next, algebra.quaternion_product(state, p))
    return build.kernel(
        "three-sample",
        "Euler parameters from three increments",
        "R. B. Miller, J. Guid. Control Dyn. 6 (1983) 287-291",
        transition=EULER.transition.name,
        attitude_step=AttitudeStep(
            "euler-product", "euler-normalize", "dcm-from-euler", (0, 0, 0, 1), isometry=True
        ),
    )
