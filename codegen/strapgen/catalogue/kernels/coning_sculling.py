"""Fast and slow loops that compute coning, sculling and the rotation vector by recursion."""

from __future__ import annotations

from fractions import Fraction

import sympy as sp

from strapgen.catalogue.kernels.updates import ROTATION_VECTOR
from strapgen.catalogue.kinematics import SAVAGE
from strapgen.ir.signals import Signal
from strapgen.kernel.algebra import cross
from strapgen.kernel.kernel import Kernel, KernelBuilder

INCREMENT = Signal.vector(
    "increment",
    "d",
    unit="rad",
    meaning="angle increment of the fast cycle, body axes: exact integral of the body rate",
    bound=Fraction(1, 8),
    frame="b",
    over="cycle",
)
PREVIOUS = Signal.vector(
    "previous_increment",
    "past",
    unit="rad",
    meaning="angle increment of the fast cycle before; zero at the start",
    bound=Fraction(1, 8),
    frame="b",
    over="cycle",
)
ANGLE_SUM = Signal.vector(
    "angle_sum",
    "beta",
    unit="rad",
    meaning="sum of the angle increments since the slow cycle began",
    bound=Fraction(1),
    frame="b",
)
CONING = Signal.vector(
    "coning",
    "coning",
    unit="rad",
    meaning="coning correction since the slow cycle began",
    bound=Fraction(1, 8),
    frame="b",
)
VELOCITY_INCREMENT = Signal.vector(
    "velocity_increment",
    "dv",
    unit="m/s",
    meaning="velocity increment of the fast cycle, body axes: exact integral of the specific force",
    bound=Fraction(1),
    frame="b",
    over="cycle",
)
VELOCITY_SUM = Signal.vector(
    "velocity_sum",
    "u",
    unit="m/s",
    meaning="sum of the velocity increments since the slow cycle began",
    bound=Fraction(8),
    frame="b",
)
SCULLING = Signal.vector(
    "sculling",
    "eta",
    unit="m/s",
    meaning="sculling integral since the slow cycle began",
    bound=Fraction(4),
    frame="b",
)


def coned(
    build: KernelBuilder, coning: sp.Matrix, beta: sp.Matrix, past: sp.Matrix, d: sp.Matrix
) -> sp.Matrix:
    """Return the coning correction after a fast cycle, in rad, equation (26); `past` is the previous increment."""
    arm = Signal.vector("arm", "arm", unit="rad", meaning="angle at the middle of the cycle, for coning")
    return coning + cross(build.stage(arm, beta + past / 6), d) / 2


def sculled(
    build: KernelBuilder,
    form: int,
    eta: sp.Matrix,
    beta: sp.Matrix,
    u: sp.Matrix | None,
    d: sp.Matrix,
    dv: sp.Matrix,
) -> sp.Matrix:
    """Return the sculling integral after a fast cycle, in m/s: S1 by equation (55), which needs no u, or S2 by (56)."""
    if form == 1:
        middle = Signal.vector("middle", "middle", unit="rad", meaning="angle at the middle of the cycle")
        return eta + cross(build.stage(middle, beta + d / 2), dv)
    return eta + (cross(beta, dv) + cross(u, d)) / 2


def coning() -> Kernel:
    """Derive the fast loop of the rotation vector, equation (26)."""
    build = KernelBuilder()
    beta, correction, past, d = map(build.input, (ANGLE_SUM, CONING, PREVIOUS, INCREMENT))
    build.feedback(ANGLE_SUM, beta + d, reset=True)
    build.feedback(CONING, coned(build, correction, beta, past, d), reset=True)
    build.feedback(PREVIOUS, d)
    return build.kernel("coning-fast", "Rotation vector by recursion: fast loop", f"{SAVAGE}, equation (26)")


def rotation_vector_of(beta: sp.Matrix, correction: sp.Matrix) -> sp.Matrix:
    """Return the rotation vector of a slow cycle, the sum of increments plus coning correction, equation (22)."""
    return beta + correction


def rotation_vector() -> Kernel:
    """Derive the slow loop of the rotation vector, equation (26)."""
    build = KernelBuilder()
    beta, correction = build.input(ANGLE_SUM), build.input(CONING)
    build.output(ROTATION_VECTOR, rotation_vector_of(beta, correction))
    return build.kernel(
        "coning-slow", "Rotation vector by recursion: slow loop", f"{SAVAGE}, equations (22) and (26)"
    )


def sculling(form: int) -> Kernel:
    """Derive the fast loop of the velocity: S1 by equation (55) for form 1, S2 by (56) for form 2."""
    build = KernelBuilder()
    beta, u, eta, d, dv = map(build.input, (ANGLE_SUM, VELOCITY_SUM, SCULLING, INCREMENT, VELOCITY_INCREMENT))
    build.feedback(ANGLE_SUM, beta + d, reset=True)
    build.feedback(VELOCITY_SUM, u + dv, reset=True)
    build.feedback(SCULLING, sculled(build, form, eta, beta, u, d, dv), reset=True)
    title = "Sculling with rotation compensation apart" if form == 2 else "Sculling and rotation compensation"
    return build.kernel(
        f"sculling-fast-{form}",
        f"{title} by recursion: fast loop",
        f"{SAVAGE}, equation {'(56)' if form == 2 else '(55)'}",
    )
