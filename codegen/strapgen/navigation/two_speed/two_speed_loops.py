"""Derives the three loops of a strapdown algorithm in two speeds: the fast, the slow and the navigation loop."""

from __future__ import annotations

from dataclasses import replace

from strapgen.catalogue.kernels.two_speed_kernels import (
    ANGLE_SUM,
    CONING,
    INCREMENT,
    NAVIGATION_ROTATION,
    NAVIGATION_VELOCITY,
    PREVIOUS,
    PREVIOUS_TURN,
    ROTATION_VECTOR,
    SCULLING,
    TURN,
    VELOCITY_EQUATIONS,
    VELOCITY_INCREMENT,
    VELOCITY_SUM,
    compensated,
    coned,
    frame_correction,
    rotated,
    rotation_sum,
    rotation_vector_of,
    sculled,
    transition,
    turned_frame,
)
from strapgen.catalogue.kinematics import KINEMATICS, SAVAGE
from strapgen.kernel.kernel import Kernel, KernelBuilder

#: Equations of Savage that turn a state by a rotation vector, and with the navigation frame.
_UPDATE = {"dcm": "(2) to (4)", "euler": "(9) to (14)"}
_TURNED_FRAME = {"dcm": "(5), (6)", "euler": "(15)"}


def fast(form: int) -> Kernel:
    """Return the fast loop: coning and sculling from angle and velocity increments, equations (26) and (55) or (56)."""
    build = KernelBuilder()
    beta, coning, past, u, eta, d, dv = map(
        build.input, (ANGLE_SUM, CONING, PREVIOUS, VELOCITY_SUM, SCULLING, INCREMENT, VELOCITY_INCREMENT)
    )
    build.feedback(ANGLE_SUM, beta + d, reset=True)
    build.feedback(CONING, coned(build, coning, beta, past, d), reset=True)
    build.feedback(PREVIOUS, d)
    build.feedback(VELOCITY_SUM, u + dv, reset=True)
    build.feedback(SCULLING, sculled(build, form, eta, beta, u, d, dv), reset=True)
    return build.kernel(
        f"two-speed-fast-{form}",
        f"Two speeds: fast loop with S{form}",
        f"{SAVAGE}, equations (26) and {'(55)' if form == 1 else '(56)'}",
    )


def slow(name: str, form: int) -> Kernel:
    """Return the slow loop, which updates attitude, velocity in navigation axes and rotation of the frame."""
    kinematics = KINEMATICS[name]
    build = KernelBuilder()
    state, v, theta, before = map(
        build.input, (kinematics.state, NAVIGATION_VELOCITY, NAVIGATION_ROTATION, PREVIOUS_TURN)
    )
    beta, coning, u, eta, turn = map(build.input, (ANGLE_SUM, CONING, VELOCITY_SUM, SCULLING, TURN))
    phi = build.stage(ROTATION_VECTOR, rotation_vector_of(beta, coning))
    turned = kinematics.product(state, transition(build, kinematics, phi))
    velocity = v + rotated(build, name, state, compensated(build, form, u, eta, beta))
    build.feedback(kinematics.state, turned, kinematics.next)
    build.feedback(NAVIGATION_VELOCITY, velocity, reset=True)
    build.feedback(NAVIGATION_ROTATION, rotation_sum(theta, before, turn), reset=True)
    build.feedback(PREVIOUS_TURN, turn)
    return build.kernel(
        f"{name}-two-speed-slow-{form}",
        f"Two speeds: slow loop of the {_title(name)}",
        f"{SAVAGE}, equations {_UPDATE[name]}, (22), (27) and {VELOCITY_EQUATIONS[name, form]}",
    )


def navigation(name: str) -> Kernel:
    """Return the loop of the navigation frame, which corrects attitude and velocity for its rotation."""
    kinematics = KINEMATICS[name]
    build = KernelBuilder()
    state, theta, v = map(build.input, (kinematics.state, NAVIGATION_ROTATION, NAVIGATION_VELOCITY))
    build.feedback(kinematics.state, turned_frame(build, kinematics, state, theta), kinematics.next)
    gained = replace(
        NAVIGATION_VELOCITY,
        name="velocity_change",
        elements=tuple(f"change_{axis}" for axis in "xyz"),
        meaning="integral of the specific force over the navigation cycle, navigation axes as they turn",
        over="cycle",
    )
    build.output(gained, v + frame_correction(theta, v))
    return build.kernel(
        f"{name}-two-speed-navigation",
        f"Two speeds: navigation loop of the {_title(name)}",
        f"{SAVAGE}, equations {_TURNED_FRAME[name]} and (59)",
    )


def _title(name: str) -> str:
    """Return the title of the attitude representation for use within a sentence."""
    title = KINEMATICS[name].title
    return title.lower() if name == "dcm" else title
