"""The acceleration transformation: velocity increments from body to navigation axes."""

from __future__ import annotations

from fractions import Fraction

import sympy as sp

from strapgen.catalogue.kernels.coning_sculling import ANGLE_SUM, SCULLING, VELOCITY_SUM
from strapgen.catalogue.kernels.updates import NAVIGATION_ROTATION
from strapgen.catalogue.kinematics import DCM_MEANING, KINEMATICS, SAVAGE, UNIT
from strapgen.ir.signals import Signal
from strapgen.kernel import algebra
from strapgen.kernel.algebra import cross
from strapgen.kernel.kernel import Kernel, KernelBuilder

TRANSFORMED = Signal.vector(
    "transformed",
    "v",
    unit="m/s",
    meaning="velocity increment of the slow cycle, navigation axes",
    frame="n",
    over="cycle",
)
NAVIGATION_VELOCITY = Signal.vector(
    "navigation_velocity",
    "v",
    unit="m/s",
    meaning="sum of the velocity increments over the navigation cycle, navigation axes",
    bound=Fraction(64),
    frame="n",
)
#: The equation of Savage that takes the velocity to navigation axes, by state and form of the sculling integral.
VELOCITY_EQUATIONS = {("dcm", 1): "(51)", ("dcm", 2): "(52)", ("euler", 1): "(57)", ("euler", 2): "(58)"}


def rotated(build: KernelBuilder, name: str, state: sp.Matrix, u: sp.Matrix) -> sp.Matrix:
    """Return vectors u (3, N) in navigation axes instead of body axes: C u, or q u q*."""
    if name == "dcm":
        return state * u
    matrix = Signal.matrix(
        "attitude", "C", meaning=DCM_MEANING, bound=UNIT, constraint="rotation", frame="b to n"
    )
    return build.stage(matrix, algebra.quaternion_matrix(state).applyfunc(sp.expand)) * u


def compensated(
    build: KernelBuilder, form: int, u: sp.Matrix, sculling: sp.Matrix, beta: sp.Matrix | None
) -> sp.Matrix:
    """Return the velocity increment of a slow cycle in m/s, body axes at its start: u + S1 or u + beta x u / 2 + S2."""
    meaning = "velocity increment, body axes at the start of the slow cycle"
    named = Signal.vector("compensated", "w", unit="m/s", meaning=meaning)
    return build.stage(named, u + sculling + (cross(beta, u) / 2 if form == 2 else sp.zeros(3, 1)))


def transformation(name: str) -> Kernel:
    """Derive the transformation of a specific force from body to navigation axes, equations (44) and (57)."""
    build = KernelBuilder()
    state = build.input(KINEMATICS[name].state)
    a = build.input(
        Signal.vector(
            "acceleration",
            "a",
            unit="m/s^2",
            meaning="specific force, body axes",
            bound=Fraction(128),
            frame="b",
        )
    )
    build.output(
        Signal.vector("transformed", "v", unit="m/s^2", meaning="specific force, navigation axes", frame="n"),
        rotated(build, name, state, a),
    )
    return build.kernel(
        f"{name}-acceleration",
        f"Acceleration transformation by {_words(name)}",
        f"{SAVAGE}, equation {'(44)' if name == 'dcm' else '(57)'}",
    )


def velocity(name: str, form: int) -> Kernel:
    """Derive the slow loop of the velocity, with S1 by equations (51) and (57) or S2 by equations (52) and (58)."""
    build = KernelBuilder()
    state, u, eta = map(build.input, (KINEMATICS[name].state, VELOCITY_SUM, SCULLING))
    beta = build.input(ANGLE_SUM) if form == 2 else None
    build.output(TRANSFORMED, rotated(build, name, state, compensated(build, form, u, eta, beta)))
    return build.kernel(
        f"{name}-velocity-{form}",
        f"Velocity increment in navigation axes by {_words(name)}, with S{form}",
        f"{SAVAGE}, equation {VELOCITY_EQUATIONS[name, form]}",
    )


def frame_correction(theta: sp.Matrix, v: sp.Matrix) -> sp.Matrix:
    """Return the change of velocity due to the rotation theta of the navigation frame over its cycle, equation (59)."""
    return -cross(theta, v) / 2


def navigation_velocity() -> Kernel:
    """Derive the velocity correction for the rotation of the navigation frame, equation (59)."""
    build = KernelBuilder()
    theta, v = build.input(NAVIGATION_ROTATION), build.input(NAVIGATION_VELOCITY)
    build.output(
        Signal.vector(
            "correction",
            "correction",
            unit="m/s",
            meaning="to be added to the velocity",
            frame="n",
            over="cycle",
        ),
        frame_correction(theta, v),
    )
    return build.kernel(
        "navigation-velocity",
        "Velocity correction for the rotation of the navigation frame",
        f"{SAVAGE}, equation (59)",
    )


def _words(name: str) -> str:
    return KINEMATICS[name].title.lower() if name == "dcm" else "Euler parameters"
