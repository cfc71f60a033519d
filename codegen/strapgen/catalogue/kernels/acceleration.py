"""The acceleration transformation takes velocity increments from body to navigation axes."""

from __future__ import annotations

from fractions import Fraction

import sympy as sp

from strapgen.catalogue.kernels.coning_sculling import ANGLE_SUM, SCULLING, VELOCITY_SUM
from strapgen.catalogue.kernels.updates import NAVIGATION_ROTATION
from strapgen.catalogue.kinematics import DCM_MEANING, KINEMATICS, SAVAGE, UNIT
from strapgen.ir.signals import Signal
from strapgen.kernel import rotations
from strapgen.kernel.kernel import Kernel, KernelBuilder
from strapgen.kernel.rotations import cross

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
    """Return vectors in navigation axes instead of body axes: C u, or q u q*.

    Parameters
    ----------
    build : KernelBuilder
    name : str
        "dcm" or "euler".
    state : Matrix
        Attitude, body to navigation axes.
    u : Matrix, 3 x N
        The vectors in body axes.

    Returns
    -------
    Matrix, 3 x N
    """
    if name == "dcm":
        return state * u
    matrix = Signal.matrix(
        "attitude", "C", meaning=DCM_MEANING, bound=UNIT, constraint="rotation", frame="b to n"
    )
    return build.stage(matrix, rotations.quaternion_matrix(state).applyfunc(sp.expand)) * u


def compensated(
    build: KernelBuilder, form: int, u: sp.Matrix, sculling: sp.Matrix, beta: sp.Matrix | None
) -> sp.Matrix:
    """Return the velocity increment of a slow cycle in the body axes of its start: u + S1, or u + beta x u / 2 + S2.

    Parameters
    ----------
    build : KernelBuilder
    form : int
        1 or 2.
    u, sculling : Matrix, 3 x 1
        Sum of the velocity increments and sculling integral at the end of the cycle, in m/s.
    beta : Matrix, 3 x 1
        Sum of the angle increments at the end of the cycle in rad, for form 2.
    """
    meaning = "velocity increment, body axes at the start of the slow cycle"
    named = Signal.vector("compensated", "w", unit="m/s", meaning=meaning)
    return build.stage(named, u + sculling + (cross(beta, u) / 2 if form == 2 else sp.zeros(3, 1)))


def transformation(name: str) -> Kernel:
    """Return the transformation of a vector from body to navigation axes, equations (44) and (57).

    Parameters
    ----------
    name : str
        "dcm" or "euler".

    Returns
    -------
    Kernel
        Inputs ``state`` and ``acceleration`` (3,) in m/s^2; output ``transformed`` (3,).
    """
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
    """Return the slow loop of the velocity, with S1 by equations (51) and (57) or S2 by equations (52) and (58).

    Parameters
    ----------
    name : str
        "dcm" or "euler".
    form : int
        1 if the sculling integral includes the rotation compensation, 2 if this kernel computes it.

    Returns
    -------
    Kernel
        Inputs ``state`` at the start of the slow cycle, ``velocity_sum`` and ``sculling`` (3,) in m/s at its end, and
        for form 2 ``angle_sum`` (3,) in rad; output ``transformed`` (3,) in m/s.
    """
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
    """Return the change of velocity due to the rotation of the navigation frame over its cycle, equation (59)."""
    return -cross(theta, v) / 2


def navigation_velocity() -> Kernel:
    """Return the velocity correction for the rotation of the navigation frame, equation (59).

    Returns
    -------
    Kernel
        Inputs ``navigation_rotation`` (3,) in rad and ``navigation_velocity`` (3,) in m/s; output ``correction`` (3,).
    """
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
